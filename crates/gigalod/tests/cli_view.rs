//! `gigalod view` as a person uses it: a real window on a virtual X server, moved by a hand of its own.
//!
//! Needs Xvfb and xdotool; without them the tests are skipped and say so, unless `REQUIRE_GPU` is set.
#![cfg(all(feature = "view", target_os = "linux"))]

mod cli_support;

use cli_support::{Ran, command, folder, gigalod, names_in, shape, splat_statue as statue};
use serde_json::Value;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A virtual screen, of this many pixels.
struct Screen {
    server: Child,
    display: String,
    framebuffer: tempfile::TempDir,
    /// Windows compete for the machine: one at a time.
    _turn: MutexGuard<'static, ()>,
}

const WIDTH: usize = 900;
const HEIGHT: usize = 600;

/// Where the picture is, left of the panel.
const MIDDLE: [i32; 2] = [300, 300];

impl Screen {
    fn open() -> Option<Self> {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let framebuffer = tempfile::tempdir().unwrap();
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &format!("{WIDTH}x{HEIGHT}x24"), "-nolisten", "tcp"])
            // Without that it begins anew, and refuses who comes meanwhile, when the last window is closed.
            .args(["-noreset", "-fbdir"])
            .arg(framebuffer.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let has_hand =
            Command::new("xdotool").arg("version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
        let (Ok(mut server), true) = (server, has_hand) else {
            assert!(std::env::var_os("REQUIRE_GPU").is_none(), "REQUIRE_GPU is set, but Xvfb or xdotool is missing");
            println!("skipped: Xvfb or xdotool is missing");
            return None;
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Some(Self { server, display: format!(":{}", number.trim()), framebuffer, _turn: turn })
    }

    /// Opens the viewer and waits for its window.
    fn view<A: AsRef<OsStr>>(&self, folder: &Path, arguments: impl IntoIterator<Item = A>) -> Viewing<'_> {
        let child = command()
            .args(["view", "--json", "--size", &format!("{WIDTH}x{HEIGHT}")])
            .args(arguments)
            .env("DISPLAY", &self.display)
            .env_remove("WAYLAND_DISPLAY")
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let viewing = Viewing { screen: self, child: Some(child), folder: folder.to_owned() };
        viewing.hand(&["search", "--sync", "--name", "^Gigalod$", "windowfocus"]);
        viewing
    }

    /// Colours on the screen, row by row: 8-bit red, green, blue.
    fn pixels(&self) -> Vec<[u8; 3]> {
        // An X window dump: a header of big-endian words, colours, then rows of 32-bit pixels.
        let dump = std::fs::read(self.framebuffer.path().join("Xvfb_screen0")).unwrap();
        let word = |at: usize| u32::from_be_bytes(dump[4 * at..4 * at + 4].try_into().unwrap()) as usize;
        let (header, row, colors) = (word(0), word(12), word(19));
        let begin = header + colors * 12;
        let pixel = |x: usize, y: usize| {
            let at = begin + y * row + 4 * x;
            [dump[at + 2], dump[at + 1], dump[at]]
        };
        (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
    }
}

impl Screen {
    fn pixel(&self, [x, y]: [i32; 2]) -> [u8; 3] {
        self.pixels()[y as usize * WIDTH + x as usize]
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// A running viewer.
struct Viewing<'a> {
    screen: &'a Screen,
    child: Option<Child>,
    folder: PathBuf,
}

impl Viewing<'_> {
    fn hand(&self, arguments: &[&str]) {
        let status = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.screen.display)
            .stdout(Stdio::null())
            .status()
            .unwrap();
        assert!(status.success(), "xdotool {arguments:?}");
    }

    fn presses(&self, key: &str) {
        self.hand(&["key", key]);
    }

    fn drags(&self, from: [i32; 2], by: [i32; 2], button: &str) {
        let text = |at: [i32; 2]| at.map(|x| x.to_string());
        let [x, y] = text(from);
        self.hand(&["mousemove", &x, &y, "sleep", "0.3", "mousedown", button]);
        for step in 1..=4 {
            let [x, y] = text([from[0] + by[0] * step / 4, from[1] + by[1] * step / 4]);
            self.hand(&["sleep", "0.1", "mousemove", &x, &y]);
        }
        self.hand(&["sleep", "0.3", "mouseup", button]);
    }

    /// Clicks, and takes the cursor out of the way.
    fn clicks(&self, [x, y]: [i32; 2]) {
        let (x, y) = (x.to_string(), y.to_string());
        self.hand(&["mousemove", &x, &y, "sleep", "0.1", "click", "1", "sleep", "0.1", "mousemove", "20", "560"]);
    }

    /// Takes a picture, which is there when nothing gets finer any more.
    fn takes_picture(&self, name: &str) -> PathBuf {
        self.presses("p");
        let path = self.folder.join(name);
        waits_until(|| path.is_file());
        path
    }

    /// The first picture of a model that has to be built: until then there is nothing to take.
    fn takes_picture_when_built(&self) -> PathBuf {
        let path = self.folder.join("splats-1.png");
        waits_until(|| {
            self.presses("p");
            std::thread::sleep(Duration::from_millis(300));
            path.is_file()
        });
        path
    }

    /// Closes the window; the figures.
    fn closes(self) -> Value {
        self.closed().done().json()
    }

    /// Closes the window; how the viewer ended.
    fn closed(mut self) -> Ran {
        self.presses("ctrl+q");
        Ran::of(self.child.take().unwrap().wait_with_output().unwrap())
    }
}

impl Drop for Viewing<'_> {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// At most two minutes, which is a failure.
#[track_caller]
fn waits_until(is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(120), "it never came to be so");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn is_orange([red, green, blue]: [u8; 3]) -> bool {
    red > 200 && (140..200).contains(&green) && blue < 100
}

fn is_green([red, green, blue]: [u8; 3]) -> bool {
    red < 160 && green > 200 && blue < 160
}

fn read_png(path: &Path) -> (usize, Vec<[u8; 3]>) {
    let decoder = png::Decoder::new(BufReader::new(std::fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    (info.width as usize, bytes.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect())
}

fn numbers(value: &Value) -> String {
    value.as_array().unwrap().iter().map(Value::to_string).collect::<Vec<_>>().join(",")
}

#[test]
fn a_rested_picture_is_that_of_render_on_the_screen_and_in_a_file() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    let viewing = screen.view(place.path(), [&statue().glod]);
    let first = viewing.takes_picture("splats-1.png");
    viewing.presses("F2");
    viewing.drags(MIDDLE, [150, 60], "1");
    viewing.hand(&["mousemove", "320", "250", "click", "4", "sleep", "0.2", "click", "4"]);
    viewing.drags(MIDDLE, [30, -20], "3");
    let second = viewing.takes_picture("splats-2.png");
    let (width, shown) = read_png(&second);
    assert_eq!(width, WIDTH);
    assert_ne!(shown, read_png(&first).1, "the camera moved");
    // Nothing but the picture: notices have gone by then.
    waits_until(|| screen.pixels() == shown);
    let figures = viewing.closes();
    assert_eq!(figures["problems"], Value::Array(Vec::new()));
    let drawn = place.path().join("drawn.png");
    let fov = figures["fov"].to_string();
    let (eye, target) = (numbers(&figures["eye"]), numbers(&figures["target"]));
    let size = format!("{WIDTH}x{HEIGHT}");
    let samples = figures["samples"].to_string();
    assert_eq!(samples, "17", "edges are smooth at rest");
    let (glod, view) = (&statue().glod, ["--eye", &eye, "--target", &target, "--fov", &fov, "--size", &size]);
    let arguments = ["render", glod.to_str().unwrap(), "-o", drawn.to_str().unwrap(), "--samples", &samples];
    cli_support::gigalod(arguments.into_iter().chain(view)).done();
    assert!(std::fs::read(&drawn).unwrap() == std::fs::read(&second).unwrap(), "the same bytes");
    assert!(figures["settled"] == Value::Bool(true) && figures["threshold_px"] == 1.0, "{figures}");
    assert_eq!(
        shape(&figures),
        "{adapter bytes_read driver_cpu_ms{max median p99} eye[] first_frame_ms fov frames height input_to_frame_ms{max median p99} limited_by \
         max_error_px measured problems[] rest_to_settled_ms samples settled splats stage_cpu_ms{max median p99} target[] \
         threshold_px up[] width window_cpu_ms{max median p99} written[]}"
    );
}

#[test]
fn a_raw_model_is_built_and_its_measured_points_are_its_own() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    let viewing = screen.view(place.path(), ["--as".as_ref(), "splats".as_ref(), statue().ply.as_os_str()]);
    let _ = viewing.takes_picture_when_built();
    viewing.presses("m");
    // Left of the panel.
    let clicked = [[270, 200], [320, 420]];
    for [x, y] in clicked {
        viewing.clicks([x, y]);
        waits_until(|| is_orange(screen.pixel([x, y])) || is_green(screen.pixel([x, y])));
    }
    // Orange until the original was read, then green.
    for [x, y] in clicked {
        waits_until(|| is_green(screen.pixel([x, y])));
    }
    let figures = viewing.closes();
    let measured = &figures["measured"];
    assert_eq!(measured["uncertain"], 0.0, "{figures}");
    let vector = |value: &Value| glam::DVec3::from_array([0, 1, 2].map(|at| value[at].as_f64().unwrap()));
    let mut stream = gigalod::import::open(Box::new(std::fs::File::open(&statue().ply).unwrap())).unwrap();
    let batch = gigalod::import::read_all(&mut *stream, &mut |_, _| {}).unwrap();
    let mesh = gigalod::verify::mesh_of(batch).unwrap();
    let bvh = gigalod_reference::Bvh::build(&mesh);
    let edge = |name: &str| figures[name].as_u64().unwrap() as u32;
    let size = gigalod::geom::ImageSize { width: edge("width"), height: edge("height") };
    assert!(size.width < WIDTH as u32, "the panel leaves less than the window");
    let camera = gigalod::geom::Camera::look_at(
        vector(&figures["eye"]),
        vector(&figures["target"]),
        vector(&figures["up"]),
        figures["fov"].as_f64().unwrap().to_radians(),
        size,
    );
    for (point, [x, y]) in measured["points"].as_array().unwrap().iter().zip(clicked) {
        let direction = camera.ray_through(glam::DVec2::new(f64::from(x), f64::from(y)));
        let ray = gigalod_reference::triangle::Ray { origin: camera.eye, direction };
        let truth = bvh.first_hit(&ray).expect("the statue is there");
        let error = (vector(point) - (camera.eye + direction * truth.t)).length() / mesh.bounds().diagonal();
        assert!(error < 1e-6, "{error} of the diagonal");
    }
}

#[test]
fn a_window_survives_what_happens_to_it() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    let viewing = screen.view(place.path(), [&statue().glod]);
    let window = |does: &[&str]| viewing.hand(&[&["search", "--name", "^Gigalod$"], does].concat());
    viewing.presses("F2");
    let (_, first) = read_png(&viewing.takes_picture("splats-1.png"));
    // The device is lost, and with it all that lay there.
    viewing.presses("F5");
    let (_, second) = read_png(&viewing.takes_picture("splats-2.png"));
    assert!(first == second, "another device draws the same");
    waits_until(|| screen.pixels() == second);
    window(&["windowunmap", "--sync"]);
    window(&["windowmap", "--sync", "windowfocus", "--sync"]);
    waits_until(|| screen.pixels() == second);
    // While it draws: a window is not given its size while something is on its way to the device.
    for (width, height) in [("500", "300"), ("700", "430"), ("520", "390"), ("730", "310"), ("640", "400")] {
        viewing.hand(&["mousemove", "200", "150", "mousedown", "1", "mousemove", "240", "170"]);
        window(&["windowsize", "--sync", width, height]);
        viewing.hand(&["mouseup", "1"]);
    }
    let (width, smaller) = read_png(&viewing.takes_picture("splats-3.png"));
    assert_eq!((width, smaller.len()), (640, 640 * 400));
    let corner = || {
        let pixels = screen.pixels();
        (0..400).all(|y| pixels[y * WIDTH..][..640] == smaller[y * 640..][..640])
    };
    waits_until(corner);
    let figures = viewing.closes();
    let problems = figures["problems"].as_array().unwrap();
    let is_told = problems.len() == 1 && problems[0].as_str().unwrap().contains("lost and opened anew");
    assert!(is_told, "{problems:?}");
}

/// What another program does to the window, the viewer tells in a line, and writes what it was asked to write.
#[test]
fn a_window_that_is_destroyed_ends_the_viewer_with_a_line() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    // While it draws, and while it rests.
    for picture in ["splats-1.png", "splats-2.png"] {
        let mut viewing = screen.view(place.path(), [&statue().glod]);
        viewing.takes_picture(picture);
        if picture == "splats-1.png" {
            viewing.hand(&["mousemove", "300", "300", "mousedown", "1", "mousemove", "340", "310"]);
        }
        viewing.hand(&["search", "--name", "^Gigalod$", "windowclose"]);
        let ran = Ran::of(viewing.child.take().unwrap().wait_with_output().unwrap());
        viewing.hand(&["mouseup", "1"]);
        assert_eq!(ran.status, 1, "{ran:?}");
        assert_eq!(ran.stderr, "error: the window was closed by force\n");
    }
}

/// Seconds of processor time that a process has taken.
fn cpu_seconds(process: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    let ticks = stat.rsplit_once(") ").unwrap().1.split(' ').skip(11).take(2);
    // Hundredths of a second, on every Linux that there is.
    ticks.map(|ticks| ticks.parse::<f64>().unwrap()).sum::<f64>() / 100.0
}

/// Nothing moves, so nothing is done: a person leaves the window open for a day.
#[test]
fn a_window_at_rest_takes_no_processor_time() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    let viewing = screen.view(place.path(), [&statue().glod]);
    // Taken when nothing gets finer any more; then the notice of it goes.
    viewing.takes_picture("splats-1.png");
    std::thread::sleep(Duration::from_secs(8));
    let process = viewing.child.as_ref().unwrap().id();
    let (before, begun) = (cpu_seconds(process), Instant::now());
    std::thread::sleep(Duration::from_secs(2));
    let share = (cpu_seconds(process) - before) / begun.elapsed().as_secs_f64();
    assert!(share < 0.1, "{share} of a processor");
    viewing.closes();
}

/// Processes that build `model`, and how modest each is: 0 to 19.
fn builds_of(model: &Path) -> Vec<(i32, i64)> {
    let processes = std::fs::read_dir("/proc").unwrap().filter_map(|entry| Some(entry.ok()?.path()));
    let build = |process: PathBuf| {
        let arguments = std::fs::read(process.join("cmdline")).ok()?;
        let arguments: Vec<&[u8]> = arguments.split(|byte| *byte == 0).collect();
        let is_build = arguments.contains(&b"build".as_slice()) && arguments.contains(&model.as_os_str().as_bytes());
        let stat = std::fs::read_to_string(process.join("stat")).ok()?;
        // Counted after the name, which may have blanks.
        let mut numbers = stat.rsplit_once(") ")?.1.split(' ').skip(16);
        let nice = numbers.next()?.parse().ok()?;
        is_build.then_some((process.file_name()?.to_str()?.parse().ok()?, nice))
    };
    processes.filter_map(build).collect()
}

/// The window has what it needs while a model is built, and who ends the viewer ends the build.
#[test]
fn a_build_stands_back_and_ends_with_the_viewer() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    let model = place.path().join("large.ply");
    gigalod([
        OsStr::new("synth"),
        "statue".as_ref(),
        "--triangles".as_ref(),
        "600k".as_ref(),
        "-o".as_ref(),
        model.as_ref(),
    ])
    .done();
    let built = || -> Vec<String> {
        let cache = folder().join("cache").join("gigalod");
        let names = if cache.is_dir() { names_in(&cache) } else { Vec::new() };
        names.into_iter().filter(|name| name.ends_with(".glod")).collect()
    };
    let before = built();
    let mut viewing = screen.view(place.path(), [&model]);
    waits_until(|| builds_of(&model).first().is_some_and(|(_, nice)| *nice == 10));
    let child = viewing.child.take().unwrap();
    let id = nix::unistd::Pid::from_raw(child.id() as i32);
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGTERM).unwrap();
    let ran = Ran::of(child.wait_with_output().unwrap());
    assert_eq!(ran.status, 130, "{ran:?}");
    waits_until(|| builds_of(&model).is_empty());
    assert_eq!(built(), before, "it did not finish");
}

#[test]
fn what_is_wrong_is_told_in_the_window_and_a_window_that_cannot_be_is_an_error() {
    let Some(screen) = Screen::open() else { return };
    let place = tempfile::tempdir_in(folder()).unwrap();
    std::fs::write(place.path().join("scene.toml"), "[[model]]\nfile = \"none.glod\"\n").unwrap();
    std::fs::write(place.path().join("broken.toml"), "up = 3\n").unwrap();
    let viewing = screen.view(place.path(), ["scene.toml", "broken.toml", "nothing.ply"]);
    // All three are told in red.
    let red = || screen.pixels().iter().filter(|[r, g, b]| *r > 90 && *g < 50 && *b < 50).count();
    waits_until(|| red() > 3000);
    let ran = viewing.closed();
    assert_eq!(ran.status, 1, "nothing was shown: {ran:?}");
    let told: Vec<&str> = ran.stderr.lines().collect();
    assert_eq!(told.len(), 3, "{told:?}");
    assert!(told[..2].iter().all(|line| line.starts_with("warning: ")) && told[2].starts_with("error: "), "{told:?}");
    assert!(told.iter().any(|line| line.contains("broken.toml: ") && line.ends_with("(line 1)")), "{told:?}");
    assert!(told.iter().any(|line| line.contains("nothing.ply: ")), "{told:?}");

    let ran = command().args(["view", "--json"]).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").output().unwrap();
    let ran = Ran::of(ran);
    assert_eq!(ran.status, 1, "{ran:?}");
    assert!(ran.stderr.starts_with("error: could not open a window: ") && !ran.stderr.contains(".rs:"), "{ran:?}");
}
