//! What `render` draws, writes and reports.

mod cli_support;

use cli_support::{
    Part, Ran, can_draw, command, damaged, larger_splat_statue, names_in, read_png, splat_statue as statue,
};
use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder for pictures.
struct Easel(TempDir);

impl Easel {
    /// `None` where nothing can be drawn.
    fn set_up() -> Option<Self> {
        can_draw().then(|| Self(tempfile::tempdir().unwrap()))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, model: &Path, options: &str, name: &str) -> Ran {
        let (model, out) = (model.to_str().unwrap().to_string(), self.path(name).to_str().unwrap().to_string());
        let options = options.split_whitespace().map(String::from);
        cli_support::gigalod(["render".into(), model, "-o".into(), out, "--json".into()].into_iter().chain(options))
    }

    /// Draws a model in 160 × 120 pixels; its report.
    fn report(&self, model: &Path, options: &str) -> Value {
        self.run(model, &format!("--size 160x120 {options}"), "report.png").done().json()
    }

    /// Draws the small statue in 160 × 120 pixels; the bytes of the picture.
    fn draw(&self, options: &str) -> Vec<u8> {
        let ran = self.run(&statue().glod, &format!("--size 160x120 {options}"), "picture.png").done();
        assert_eq!(ran.stderr, "", "nothing to warn of");
        std::fs::read(self.path("picture.png")).unwrap()
    }
}

#[test]
fn pictures_have_the_size_and_the_background_asked_for() {
    let Some(easel) = Easel::set_up() else { return };
    for (size, background) in [([64, 48], [255, 128, 3]), ([33, 77], [0, 1, 254]), ([300, 1], [32, 33, 34])] {
        let [r, g, b] = background;
        let options = format!("--size {}x{} --background #{r:02x}{g:02X}{b:02x} --orbit 0,0,0.2", size[0], size[1]);
        let report = easel.run(&statue().glod, &options, "a.png").done().json();
        assert_eq!((&report["width"], &report["height"]), (&size[0].into(), &size[1].into()));
        let (width, height, pixels) = read_png(&easel.path("a.png"));
        assert_eq!([width, height], size);
        let alpha = pixels[0][3];
        for corner in [pixels[0], pixels[size[0] as usize - 1], *pixels.last().unwrap()] {
            assert_eq!(corner, [r, g, b, alpha], "exactly, without blending");
        }
    }
    assert_eq!(names_in(easel.0.path()), ["a.png"], "nothing else is left in the folder");
    easel.run(&statue().glod, "--size 800x600", "b.png").done();
    let (.., pixels) = read_png(&easel.path("b.png"));
    let drawn = pixels.iter().filter(|pixel| pixel[..3] != [0x20, 0x20, 0x24]).count() as f64 / (800.0 * 600.0);
    assert!((0.1..0.9).contains(&drawn), "the model fills the picture's height: {drawn}");
    let ran = easel.run(&statue().glod, "--size 20000x20000", "c.png");
    assert_eq!((ran.status, easel.path("c.png").exists()), (1, false), "too large: {ran:?}");
}

#[test]
fn depth_is_one_float_channel_with_infinity_where_there_is_nothing() {
    let Some(easel) = Easel::set_up() else { return };
    let depth = easel.path("depth.exr");
    let options = format!("--size 80x60 --eye 0,1.3,10 --target 0,1.3,0 --fov 30 --depth {}", depth.to_str().unwrap());
    easel.run(&statue().glod, &options, "a.png").done();
    let image = read_first_flat_layer_from_file(&depth).unwrap();
    let layer = image.layer_data;
    assert_eq!((layer.size.0, layer.size.1), (80, 60));
    let [channel] = &layer.channel_data.list[..] else { panic!("one channel") };
    assert_eq!(channel.name.to_string(), "Z");
    let FlatSamples::F32(samples) = &channel.sample_data else { panic!("32-bit floats") };
    let (.., pixels) = read_png(&easel.path("a.png"));
    let mut drawn = 0;
    for (depth, pixel) in samples.iter().zip(&pixels) {
        let background = pixel[..3] == [0x20, 0x20, 0x24];
        assert_eq!(*depth == f32::INFINITY, background, "{depth} at {pixel:?}");
        drawn += usize::from(!background);
    }
    assert!(drawn > 400, "{drawn} pixels");
    // The statue is some 1.2 deep around the origin: the distance along the axis, in its units.
    let middle = samples[30 * 80 + 40];
    assert!((9.0..10.0).contains(&middle), "{middle}");
}

#[test]
fn kernels_and_colours_of_levels_change_the_picture_and_the_threshold_does_too() {
    let Some(easel) = Easel::set_up() else { return };
    let plain = easel.draw("");
    assert_eq!(easel.draw("--kernel round"), plain, "the default");
    assert_eq!(easel.draw("--error 1"), plain, "the default");
    assert_eq!(easel.draw("--background #202024 --fov 40"), plain, "the defaults");
    for other in ["--kernel square", "--lod-colors", "--error 8", "--fov 60", "--light 1,0,0", "--orbit 90,0"] {
        assert_ne!(easel.draw(other), plain, "{other}");
    }
    assert_ne!(easel.draw("--lod-colors --error 16"), easel.draw("--lod-colors --error 4"));
}

#[test]
fn the_default_view_is_the_orbit_of_nothing() {
    let Some(easel) = Easel::set_up() else { return };
    let plain = easel.draw("");
    assert_eq!(easel.draw("--orbit 0,0,1"), plain);
    assert_eq!(easel.draw("--orbit 0,0"), plain);
    assert_eq!(easel.draw("--orbit=0,-0,1"), plain);
    assert_ne!(easel.draw("--orbit 0,0,2"), plain);
}

#[test]
fn orbits_stand_where_the_contract_says() {
    let Some(easel) = Easel::set_up() else { return };
    let bounds = &run!["info", statue().glod, "--json"].done().json()["bounds"];
    let end = |name: &str| [0, 1, 2].map(|axis| bounds[name][axis].as_f64().unwrap());
    let (min, max) = (end("min"), end("max"));
    let center = [0, 1, 2].map(|axis| (min[axis] + max[axis]) / 2.0);
    let half = [0, 1, 2].map(|axis| (max[axis] - min[axis]) / 2.0);
    let tan = 20f64.to_radians().tan();
    // Axis towards the eye, axis to the right, axis up in the picture, which up that is.
    for (orbit, [toward, right, up], sign, up_text) in [
        ("0,0,1", [2, 0, 1], 1.0, "0,1,0"),
        ("0,0,3", [2, 0, 1], 1.0, "0,1,0"),
        ("90,0,1", [0, 2, 1], 1.0, "0,1,0"),
        ("-90,0,1", [0, 2, 1], -1.0, "0,1,0"),
        ("180,0,2", [2, 0, 1], -1.0, "0,1,0"),
        ("0,90,1", [1, 0, 2], 1.0, "0,0,-1"),
    ] {
        let zoom: f64 = orbit.rsplit(',').next().unwrap().parse().unwrap();
        let fit = f64::max(half[up] / tan, half[right] / (tan * 160.0 / 120.0)) + half[toward];
        let mut eye = center;
        eye[toward] += sign * fit / zoom;
        let text = |v: [f64; 3]| v.map(|x| x.to_string()).join(",");
        let by_orbit = format!("--size 160x120 --orbit {orbit}");
        let by_hand = format!("--size 160x120 --eye {} --target {} --up {up_text}", text(eye), text(center));
        easel.run(&statue().glod, &by_orbit, "orbit.png").done();
        easel.run(&statue().glod, &by_hand, "hand.png").done();
        let found = run!["compare", easel.path("orbit.png"), easel.path("hand.png"), "--json"].done().json();
        // The eye is the same but for rounding.
        let psnr = found["psnr_db"].as_f64().unwrap_or(f64::INFINITY);
        assert!(psnr > 45.0, "{orbit}: {found}");
    }
}

#[test]
fn values_may_start_with_a_minus_sign() {
    let Some(easel) = Easel::set_up() else { return };
    for options in [
        "--eye -1,2,-3 --target -0.5,-1,-2",
        "--eye -1,2,-3 --target -0.5,-1,-2 --up -1,-1,0",
        "--orbit -30,-10",
        "--orbit -30,-10,0.5 --light -1,1,1",
        "--light -.5,-1e-1,-1",
    ] {
        easel.draw(options);
    }
    assert_eq!(easel.draw("--orbit -90,0"), easel.draw("--orbit 270,0"));
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let Some(easel) = Easel::set_up() else { return };
    for options in ["", "--orbit 30,10,8 --kernel square", "--full --lod-colors"] {
        let depth = |name: &str| format!("{options} --depth {}", easel.path(name).to_str().unwrap());
        let (first, second) = (easel.draw(&depth("a.exr")), easel.draw(&depth("b.exr")));
        assert_eq!(first, second, "{options:?}");
        assert_eq!(std::fs::read(easel.path("a.exr")).unwrap(), std::fs::read(easel.path("b.exr")).unwrap());
    }
}

#[test]
fn a_raw_model_is_built_once_and_gives_the_same_picture() {
    let Some(easel) = Easel::set_up() else { return };
    let cache = easel.path("cache");
    let render = |ply: &Path, name: &str| {
        let mut command = command();
        command.env("XDG_CACHE_HOME", &cache).arg("render").arg(ply).arg("-o").arg(easel.path(name));
        Ran::of(command.args(["--as", "splats", "--size", "160x120", "-v", "--json"]).output().unwrap()).done()
    };
    let first = render(&statue().ply, "a.png");
    assert!(first.stderr.contains("built as"), "{first:?}");
    let builds = || {
        let mut names = names_in(&cache.join("gigalod"));
        names.retain(|name| name.ends_with(".glod"));
        names
    };
    let [built] = &builds()[..] else { panic!("one model in the cache") };
    let built = cache.join("gigalod").join(built);
    let made = built.metadata().unwrap().modified().unwrap();
    // The same contents under another name are not built again.
    let copy = easel.path("copy of the scan.ply");
    std::fs::copy(&statue().ply, &copy).unwrap();
    for (ply, name) in [(&statue().ply, "b.png"), (&copy, "c.png")] {
        let again = render(ply, name);
        assert!(again.stderr.contains("built before as"), "{again:?}");
        assert_eq!(built.metadata().unwrap().modified().unwrap(), made);
    }
    let plain = easel.draw("");
    for name in ["a.png", "b.png", "c.png"] {
        assert_eq!(std::fs::read(easel.path(name)).unwrap(), plain, "{name}: as from the built file");
    }
    // What is broken in the cache is built anew; other contents are another file.
    damaged(&statue().glod, Part::Skeleton, &built);
    assert!(render(&statue().ply, "a.png").stderr.contains("built as"));
    assert_eq!(std::fs::read(easel.path("a.png")).unwrap(), plain);
    run!["synth", "statue", "--triangles", "2k", "-o", copy].done();
    assert!(render(&copy, "c.png").stderr.contains("built as"));
    assert_eq!(builds().len(), 2);
}

#[test]
fn a_pose_of_a_path_is_its_eye_and_target() {
    let Some(easel) = Easel::set_up() else { return };
    let path = easel.path("p.json");
    run!["synth", "path", "walk", "--around", statue().glod, "--seconds", "1", "-o", path].done();
    let made: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let vector = |value: &Value| {
        let numbers: Vec<String> = value.as_array().unwrap().iter().map(Value::to_string).collect();
        numbers.join(",")
    };
    for frame in [0, 17, 30] {
        let pose = &made["frames"][frame];
        let by_path = easel.draw(&format!("--path {} --frame {frame}", path.to_str().unwrap()));
        let by_hand = easel.draw(&format!(
            "--eye {} --target {} --up {} --fov {}",
            vector(&pose["eye"]),
            vector(&pose["target"]),
            vector(&made["up"]),
            made["fov"]
        ));
        assert_eq!(by_path, by_hand, "frame {frame}");
    }
}

#[test]
fn a_damaged_page_is_named_and_drawn_coarser() {
    let Some(easel) = Easel::set_up() else { return };
    let bad = easel.path("bad.glod");
    let good = easel.report(&statue().glod, "");
    for part in [Part::LastPage, Part::FirstPage] {
        damaged(&statue().glod, part, &bad);
        let ran = easel.run(&bad, "--size 160x120", "a.png").done();
        let report = ran.json();
        let problem = report["problems"][0].as_str().expect("a problem");
        assert!(problem.contains("page ") && problem.contains("checksum"), "{problem}");
        assert_eq!(ran.stderr, format!("warning: {problem}\n"));
        assert_eq!((&report["limited_by"], &report["converged"]), (&"residency".into(), &false.into()), "{part:?}");
        assert!(report["drawn"]["nodes"].as_u64() < good["drawn"]["nodes"].as_u64(), "{part:?}");
        // The last page refines the smallest spheres: not those with the largest error.
        let (error, whole) = (report["max_error_px"].as_f64(), good["max_error_px"].as_f64());
        assert!(if matches!(part, Part::FirstPage) { error > whole } else { error >= whole }, "{part:?}");
        assert_eq!(read_png(&easel.path("a.png")).0, 160);
    }
    // Only the metadata: nothing of it is needed for a picture.
    damaged(&statue().glod, Part::Metadata, &bad);
    assert_eq!(easel.report(&bad, "")["problems"], serde_json::json!([]));
}

#[test]
fn finer_thresholds_draw_more_and_say_what_limits_them() {
    let Some(easel) = Easel::set_up() else { return };
    let model = &larger_splat_statue().glod;
    let leaves = run!["info", model, "--json"].done().json()["leaves"].as_u64().unwrap();
    let mut before = 0;
    for error in [64.0, 32.0, 16.0, 8.0, 4.0] {
        let report = easel.report(model, &format!("--error {error}"));
        let nodes = report["drawn"]["nodes"].as_u64().unwrap();
        assert!(nodes > before && nodes <= leaves, "{error}: {nodes} nodes, {before} at twice the threshold");
        before = nodes;
        assert_eq!((&report["threshold_px"], &report["converged"]), (&error.into(), &true.into()));
        assert_eq!(report["drawn"]["points"], nodes, "splats are points");
        let met = report["max_error_px"].as_f64().unwrap() <= error;
        assert_eq!(report["limited_by"].is_null(), met, "the promise is kept, or the report says why not: {report}");
    }
    assert!(easel.report(model, "--error 16")["limited_by"].is_null(), "a fine model, a coarse threshold");
    let close = easel.report(model, "--orbit 20,5,12");
    assert_eq!(close["limited_by"], "data", "closer than the scan's samples");
    assert!(close["culled"]["frustum"].as_u64() > Some(0), "{close}");
    let full = easel.report(model, "--full");
    assert_eq!((&full["threshold_px"], &full["limited_by"]), (&0.0.into(), &"data".into()));
    let nodes = full["drawn"]["nodes"].as_u64().unwrap();
    assert!(
        nodes >= before && nodes <= leaves && nodes > leaves / 3,
        "{nodes} of {leaves} leaves, others show their back"
    );
    assert_eq!(full["culled"]["frustum"], 0, "nothing lies beside the picture");
}

#[test]
fn a_coarse_picture_reads_a_part_of_the_file() {
    let Some(easel) = Easel::set_up() else { return };
    let model = &larger_splat_statue().glod;
    let bytes = model.metadata().unwrap().len();
    let [coarse, full] =
        ["--error 16", "--full"].map(|options| easel.report(model, options)["bytes_read"].as_u64().unwrap());
    assert!(coarse > 0 && coarse < bytes / 2, "{coarse} of {bytes} bytes");
    assert!(full > coarse && full <= bytes, "{full} of {bytes} bytes");
}

#[test]
fn too_small_a_budget_is_kept_and_said() {
    let Some(easel) = Easel::set_up() else { return };
    let model = &larger_splat_statue().glod;
    let whole = easel.report(model, "");
    let budget = whole["cpu_bytes"].as_u64().unwrap() / 3;
    let report = easel.report(model, &format!("--cpu-budget {budget}"));
    assert!(report["cpu_bytes"].as_u64().unwrap() <= budget, "{report}");
    assert_eq!((&report["converged"], &report["limited_by"]), (&false.into(), &"budget".into()));
    assert!(report["max_error_px"].as_f64() >= whole["max_error_px"].as_f64());
    let (drawn, all) = (report["drawn"]["nodes"].as_u64(), whole["drawn"]["nodes"].as_u64());
    assert!(drawn > Some(0) && drawn < all, "coarser, but all of it");
}
