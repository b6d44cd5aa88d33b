//! The user interface without a window: egui's own harness plays a person, a host in memory the files.

use crate::host::{Entry, Folder, Host, Kind, Model, Opened, Preview, Work};
use crate::mailbox::{Figures, Mailbox, Order};
use crate::navigation::Input;
use crate::pick::{Hit, Ray};
use crate::picker;
use crate::settings::{FirstLook, Options, Settings};
use crate::viewer::Viewer;
use egui::{Event, Modifiers, MouseWheelUnit, PointerButton, Pos2, pos2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use gigalod_build::NoProgress;
use gigalod_format::splats::SplatFile;
use gigalod_format::{Container, FileStore};
use gigalod_geom::{CameraPath, ImageSize};
use gigalod_runtime::scene::description::SceneDescription;
use gigalod_runtime::{CutReport, Limit, Similarity};
use gigalod_synth::{Order as VertexOrder, StatueOptions};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const SIZE: ImageSize = ImageSize { width: 1000, height: 700 };

/// Where the picture is, left of the panel.
const MIDDLE: Pos2 = pos2(350.0, 350.0);

/// One statue, whatever is asked for; and a list of what was written.
struct Files {
    statue: Model,
    /// A raw model may be ready.
    built: AtomicBool,
    written: Mutex<Vec<(PathBuf, String)>>,
}

impl Files {
    fn wrote(&self, path: &Path, what: String) -> Result<PathBuf, String> {
        self.written.lock().unwrap().push((path.to_owned(), what));
        Ok(path.to_owned())
    }
}

impl Host for Files {
    fn open(&self, path: &Path, work: &Work) -> Result<Opened, String> {
        match path.to_str() {
            Some("raw.ply") => {
                work.preview(Preview { model: self.statue.clone(), points: 1234 });
                work.at("tree", Some(0.4), Some(Duration::from_secs(90)));
                while !self.built.load(Ordering::Relaxed) {
                    if work.is_cancelled() {
                        return Err("raw.ply: cancelled".into());
                    }
                    std::thread::sleep(Duration::from_millis(1));
                }
                Ok(Opened::Model(self.statue.clone()))
            }
            Some("statue.glod") => Ok(Opened::Model(self.statue.clone())),
            Some("folder") => {
                let entry = |path: &str, kind, bytes| Entry { path: path.into(), kind, bytes };
                let entries = vec![entry("statue.glod", Kind::Model, 4096), entry("other.ply", Kind::Built, 7 << 20)];
                Ok(Opened::Folder(Folder { path: "/models".into(), entries }))
            }
            _ => Err(format!("{}: no such file", path.display())),
        }
    }

    fn exact_point(&self, _: &Path, ray: &Ray, near: &Hit, _: &Work) -> Result<Option<DVec3>, String> {
        Ok(Some(ray.origin + ray.direction * near.t))
    }

    fn write_picture(&self, path: &Path, size: ImageSize, rgba: &[u8]) -> Result<PathBuf, String> {
        self.wrote(path, format!("{}x{}, {} bytes", size.width, size.height, rgba.len()))
    }

    fn write_path(&self, path: &Path, camera_path: &CameraPath) -> Result<PathBuf, String> {
        self.wrote(path, format!("{} poses", camera_path.frames.len()))
    }

    fn write_scene(&self, path: &Path, scene: &SceneDescription) -> Result<PathBuf, String> {
        self.wrote(path, format!("{} models", scene.models.len()))
    }
}

pub(crate) fn statue(folder: &Path) -> Arc<SplatFile> {
    let scan = folder.join("statue.ply");
    let options = StatueOptions { triangles: 20_000, seed: 3, colors: false, order: VertexOrder::Coherent };
    let mut out = std::fs::File::create(&scan).unwrap();
    gigalod_synth::write_statue(options, &mut out, &mut |_, _| {}).unwrap();
    let stream = gigalod_import::open(Box::new(std::fs::File::open(&scan).unwrap())).unwrap();
    let built = folder.join("statue.glod");
    gigalod_build::splats::build(stream, &Default::default(), &NoProgress, &built).unwrap();
    let container = Container::open(Arc::new(FileStore::open(&built).unwrap())).unwrap();
    Arc::new(SplatFile::open(container).unwrap())
}

/// A viewer that has opened `files`, and what it writes.
struct Person {
    harness: Harness<'static, Viewer>,
    files: Arc<Files>,
    _folder: tempfile::TempDir,
}

impl Person {
    fn opens(names: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let statue = Model {
            source: "statue.glod".into(),
            file: statue(folder.path()).into(),
            original: None,
            unit: None,
            placements: vec![Similarity::IDENTITY],
        };
        let files = Arc::new(Files { statue, built: AtomicBool::new(false), written: Mutex::default() });
        let options = Options {
            files: names.iter().map(PathBuf::from).collect(),
            settings: Settings::default(),
            fov_deg: 40.0,
            first_look: FirstLook::Whole,
            size: SIZE,
        };
        let mailbox = Arc::new(Mailbox::new(|| {}));
        let picker = picker::start(files.clone(), || {}).unwrap();
        let viewer = Viewer::new(&options, files.clone(), mailbox, picker, || {});
        let mut harness = Harness::builder()
            .with_size(vec2(SIZE.width as f32, SIZE.height as f32))
            .with_step_dt(1.0 / 60.0)
            .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui, SIZE), viewer);
        harness.run_steps(2);
        let mut person = Self { harness, files, _folder: folder };
        person.waits_until(|viewer| viewer.jobs.running().is_empty());
        person
    }

    fn viewer(&mut self) -> &mut Viewer {
        self.harness.state_mut()
    }

    /// Frames until something is so; at most a minute, which is a failure.
    fn waits_until(&mut self, is_so: impl Fn(&Viewer) -> bool) {
        let begun = Instant::now();
        loop {
            self.harness.run_steps(1);
            if is_so(self.harness.state()) {
                self.harness.run_steps(1);
                return;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "it never came to be so");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn event(&mut self, event: Event) {
        self.harness.event(event);
        self.harness.run_steps(1);
    }

    fn button(&mut self, pos: Pos2, button: PointerButton, pressed: bool, modifiers: Modifiers) {
        self.harness.event(Event::PointerMoved(pos));
        self.event(Event::PointerButton { pos, button, pressed, modifiers });
    }

    fn drags(&mut self, from: Pos2, to: Pos2, button: PointerButton, modifiers: Modifiers) {
        self.event(Event::ModifiersChanged(modifiers));
        self.button(from, button, true, modifiers);
        for part in [0.25, 0.5, 0.75, 1.0] {
            self.event(Event::PointerMoved(from + (to - from) * part));
        }
        self.button(to, button, false, modifiers);
        self.event(Event::ModifiersChanged(Modifiers::NONE));
    }

    fn clicks(&mut self, at: Pos2) {
        self.button(at, PointerButton::Primary, true, Modifiers::NONE);
        self.button(at, PointerButton::Primary, false, Modifiers::NONE);
    }

    fn turns_wheel(&mut self, at: Pos2, points: f32) {
        self.harness.event(Event::PointerMoved(at));
        self.event(Event::MouseWheel {
            unit: MouseWheelUnit::Point,
            delta: vec2(0.0, points),
            phase: egui::TouchPhase::Move,
            source: egui::MouseWheelSource::Wheel,
            modifiers: Modifiers::NONE,
        });
        // Zoom waits for what is under the cursor.
        self.harness.run_steps(30);
    }

    fn presses(&mut self, key: egui::Key) {
        self.harness.key_press(key);
        self.harness.run_steps(2);
    }

    fn clicks_on(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_steps(2);
    }

    /// Whether a part of the statue is in the picture: points of its surface, not those that the camera is held by.
    fn sees_the_statue(&mut self) -> bool {
        let viewer = self.harness.state();
        let (camera, size) = (viewer.camera(&viewer.own_viewpoint()), viewer.size);
        let bounds = viewer.bounds();
        let (middle, half) = (bounds.center(), bounds.extent() * 0.5);
        let mut pages = crate::pick::Pages::default();
        let near = (0..=24).flat_map(|x| (0..=16).map(move |y| (x, y))).any(|(x, y)| {
            let at = DVec2::new(f64::from(x * size.width) / 24.0, f64::from(y * size.height) / 16.0);
            let ray = Ray { origin: camera.eye, direction: camera.ray_through(at) };
            pages.first_hit(self.files.statue.file.splats().unwrap(), &ray).unwrap().is_some()
        });
        let view = camera.view_point(middle);
        let small = view.z > half.length() && {
            let pixel = camera.pixel_of_view_point(view);
            pixel.x > 0.0 && pixel.y > 0.0 && pixel.x < f64::from(size.width) && pixel.y < f64::from(size.height)
        };
        near || small
    }
}

#[test]
fn a_file_that_cannot_be_opened_is_told_and_a_folder_is_a_choice() {
    let mut person = Person::opens(&["missing.ply", "folder"]);
    assert!(person.harness.query_by_label_contains("missing.ply: no such file").is_some());
    assert!(person.harness.state().models.is_empty());
    for told in ["/models", "ready", "4.0 KiB", "built before", "7.0 MiB"] {
        assert!(person.harness.query_by_label(told).is_some(), "{told}");
    }
    person.clicks_on("statue.glod");
    person.waits_until(|viewer| viewer.models.len() == 1);
    assert!(person.harness.query_by_label("other.ply").is_none(), "the choice is made");
}

/// A file that is let go over the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("the viewer opens files by their names".into())
    }
}

#[test]
fn what_is_dropped_onto_the_window_is_shown_with_the_rest() {
    let mut person = Person::opens(&["statue.glod"]);
    person.harness.input_mut().dropped_files.push(Arc::new(Dropped("statue.glod".into())));
    person.waits_until(|viewer| viewer.models.len() == 2);
    let orders = person.viewer().mailbox.receive(Some(Duration::ZERO)).orders;
    assert!(matches!(&orders[..], [Order::Add(first, ..), Order::Add(second, ..)] if first != second));
}

#[test]
fn the_mouse_turns_moves_and_comes_nearer() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    person.drags(MIDDLE, MIDDLE + vec2(80.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let turned = person.viewer().own_viewpoint();
    assert_eq!(turned.target, home.target);
    assert!((turned.eye - home.eye).length() > 0.1 * (home.eye - home.target).length());
    person.drags(MIDDLE, MIDDLE + vec2(0.0, 60.0), PointerButton::Secondary, Modifiers::NONE);
    let moved = person.viewer().own_viewpoint();
    assert!(((moved.eye - moved.target) - (turned.eye - turned.target)).length() < 1e-9 && moved.eye != turned.eye);
    person.turns_wheel(MIDDLE, 200.0);
    let nearer = person.viewer().own_viewpoint();
    assert!((nearer.eye - nearer.target).length() < 0.7 * (moved.eye - moved.target).length());
    person.presses(egui::Key::Home);
    assert_eq!(person.viewer().own_viewpoint(), home);
    // A drag over the panel is not one over the picture.
    person.drags(pos2(900.0, 400.0), pos2(900.0, 300.0), PointerButton::Primary, Modifiers::NONE);
    assert_eq!(person.viewer().own_viewpoint(), home);
    person.drags(MIDDLE, MIDDLE + vec2(40.0, 0.0), PointerButton::Primary, Modifiers::CTRL);
    assert_eq!(person.viewer().own_viewpoint(), home);
    assert!(person.viewer().settings.towards_light.is_some(), "with Ctrl it is the light that moves");
}

#[test]
fn a_double_click_makes_a_point_of_the_surface_the_pivot() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    let camera = person.viewer().camera(&home);
    person.clicks(pos2(310.0, 300.0));
    person.clicks(pos2(310.0, 300.0));
    person.waits_until(|viewer| viewer.own_viewpoint().target != home.target);
    let pivot = person.viewer().own_viewpoint().target;
    let pixel = camera.pixel_of_view_point(camera.view_point(pivot));
    assert!((pixel - DVec2::new(310.0, 300.0)).length() < 1e-6, "{pixel}: it lay under the cursor");
}

#[test]
fn whoever_drags_at_random_does_not_lose_the_model() {
    let mut person = Person::opens(&["statue.glod"]);
    person.waits_until(|viewer| viewer.navigation.has_anchors());
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    for step in 0..120 {
        let mut place = || pos2(random(700) as f32, random(700) as f32);
        let (from, to) = (place(), place());
        match random(6) {
            0 | 1 => person.drags(from, to, PointerButton::Primary, Modifiers::NONE),
            2 => person.drags(from, to, PointerButton::Secondary, Modifiers::NONE),
            3 => person.turns_wheel(from, random(800) as f32 - 300.0),
            4 => {
                person.presses(egui::Key::F);
                person.drags(from, to, PointerButton::Primary, Modifiers::NONE);
                person.presses(egui::Key::F);
            }
            _ => {
                person.clicks(from);
                person.clicks(from);
            }
        }
        // Picks come from another thread.
        for _ in 0..3 {
            std::thread::sleep(Duration::from_millis(2));
            person.harness.run_steps(1);
        }
        assert!(person.sees_the_statue(), "lost in step {step}: {:?}", person.viewer().own_viewpoint());
    }
}

#[test]
fn a_path_is_recorded_played_and_saved() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    person.clicks_on("Camera path");
    person.harness.run_steps(30);
    person.clicks_on("Record (R)");
    person.drags(MIDDLE, MIDDLE + vec2(120.0, -40.0), PointerButton::Primary, Modifiers::NONE);
    person.clicks_on("Stop (R)");
    let end = person.viewer().own_viewpoint();
    let frames = person.viewer().recorder.path().unwrap().frames.clone();
    assert_eq!((frames[0].eye, frames[frames.len() - 1].eye), (home.eye, end.eye));
    person.presses(egui::Key::Home);
    person.presses(egui::Key::Space);
    assert!(person.viewer().recorder.is_playing());
    person.waits_until(|viewer| !viewer.recorder.is_playing());
    let arrived = person.viewer().own_viewpoint();
    assert!((arrived.eye - end.eye).length() < 1e-9 && (arrived.target - end.target).length() < 1e-9);
    for button in ["Path", "Scene"] {
        // The field beside it has the same name.
        person.harness.get_by_role_and_label(egui::accesskit::Role::Button, button).click();
        person.harness.run_steps(2);
    }
    person.waits_until(|viewer| !viewer.jobs.is_writing());
    let mut written = person.files.written.lock().unwrap().clone();
    written.sort();
    let expected = [("statue.json", format!("{} poses", frames.len())), ("statue.toml", "1 models".to_string())];
    assert_eq!(written, expected.map(|(name, what)| (PathBuf::from(name), what)));
}

#[test]
fn a_distance_is_that_of_the_points_that_were_clicked() {
    let mut person = Person::opens(&["statue.glod"]);
    person.clicks_on("Pick points (M)");
    for at in [pos2(260.0, 300.0), pos2(400.0, 420.0)] {
        person.clicks(at);
        // Two clicks in one place at once would be a double click.
        person.harness.run_steps(60);
    }
    person.waits_until(|viewer| viewer.measuring.distance().is_some());
    let viewer = person.viewer();
    let camera = viewer.camera(&viewer.own_viewpoint());
    let points: Vec<DVec3> = viewer.measuring.points().map(|found| found.point).collect();
    for (point, clicked) in points.iter().zip([DVec2::new(260.0, 300.0), DVec2::new(400.0, 420.0)]) {
        let pixel = camera.pixel_of_view_point(camera.view_point(*point));
        assert!((pixel - clicked).length() < 1e-6, "{pixel}");
    }
    assert_eq!(viewer.measuring.distance().unwrap().0, (points[0] - points[1]).length());
    assert!(person.harness.query_by_label_contains("Distance ").is_some());
    assert!(person.harness.query_by_label_contains("from the splats").is_some());
}

#[test]
fn a_point_is_where_the_click_was_and_not_where_the_mouse_went_in_the_same_frame() {
    let mut person = Person::opens(&["statue.glod"]);
    person.clicks_on("Pick points (M)");
    let (at, button, modifiers) = (pos2(260.0, 300.0), PointerButton::Primary, Modifiers::NONE);
    person.harness.event(Event::PointerMoved(at));
    person.harness.run_steps(1);
    let [down, up] = [true, false].map(|pressed| Event::PointerButton { pos: at, button, pressed, modifiers });
    person.harness.input_mut().events.extend([down, up, Event::PointerMoved(pos2(20.0, 560.0))]);
    person.harness.run_steps(1);
    person.waits_until(|viewer| viewer.measuring.points().count() == 1);
    let viewer = person.viewer();
    let camera = viewer.camera(&viewer.own_viewpoint());
    let point = viewer.measuring.points().next().unwrap().point;
    let pixel = camera.pixel_of_view_point(camera.view_point(point));
    assert!((pixel - DVec2::new(260.0, 300.0)).length() < 1e-6, "{pixel}");
}

#[test]
fn a_click_on_a_models_name_looks_at_it() {
    let mut person = Person::opens(&["statue.glod"]);
    let home = person.viewer().own_viewpoint();
    person.viewer().steer(&Input::Pan { by_px: DVec2::new(90.0, 40.0) }, 0.0);
    person.viewer().steer(&Input::Orbit { by_px: DVec2::new(50.0, 0.0) }, 0.0);
    let leaves = person.files.statue.file.splats().expect("a statue of splats").skeleton().root().leaves;
    person.clicks_on(&format!("statue.glod, {} splats", crate::panel::count(leaves)));
    let now = person.viewer().own_viewpoint();
    assert!((now.target - home.target).length() < 1e-6, "at its middle");
    assert!(((now.eye - now.target).length() / (home.eye - home.target).length() - 1.0).abs() < 1e-6, "all of it");
    assert!((now.eye - home.eye).length() > 0.1, "from where the person was");
    // Also while the camera follows a path.
    person.presses(egui::Key::R);
    person.drags(MIDDLE, MIDDLE + vec2(120.0, -40.0), PointerButton::Secondary, Modifiers::NONE);
    person.presses(egui::Key::R);
    person.presses(egui::Key::Space);
    assert!(person.viewer().recorder.is_playing());
    person.clicks_on(&format!("statue.glod, {} splats", crate::panel::count(leaves)));
    assert!(!person.viewer().recorder.is_playing());
    assert!((person.viewer().own_viewpoint().target - home.target).length() < 1e-6);
}

#[test]
fn a_model_is_stood_up_whatever_its_format_says() {
    let mut person = Person::opens(&["statue.glod"]);
    person.waits_until(|viewer| viewer.navigation.has_anchors());
    let home = person.viewer().own_viewpoint();
    person.clicks_on("z");
    let upright = person.viewer().own_viewpoint();
    assert_eq!((home.up, upright.up, upright.target), (DVec3::Y, DVec3::Z, home.target));
    assert!(person.viewer().navigation.has_anchors() && person.sees_the_statue());
    person.drags(MIDDLE, MIDDLE + vec2(60.0, 20.0), PointerButton::Primary, Modifiers::NONE);
    person.presses(egui::Key::Home);
    assert_eq!(person.viewer().own_viewpoint(), upright);
    assert_eq!(person.viewer().scene().up, Some(gigalod_geom::camera::UpAxis::Z));
    person.clicks_on("y");
    assert_eq!(person.viewer().own_viewpoint(), home);
}

#[test]
fn what_is_chosen_in_the_panel_is_wished_for() {
    let mut person = Person::opens(&["statue.glod"]);
    let wished = |person: &mut Person| person.viewer().mailbox.receive(Some(Duration::ZERO));
    let before = wished(&mut person).wish.unwrap().1;
    person.clicks_on("levels");
    let levels = wished(&mut person).wish.unwrap().1;
    assert!(levels.tint != before.tint && levels.camera == before.camera);
    person.presses(egui::Key::P);
    let orders = wished(&mut person).orders;
    assert!(matches!(&orders[..], [Order::Picture(name)] if name == Path::new("statue-1.png")));
    assert_eq!(person.viewer().names.picture, "statue-2.png");
    person.presses(egui::Key::F1);
    assert!(person.harness.query_by_label("Mouse and keys").is_some());
    person.presses(egui::Key::F2);
    assert!(person.harness.query_by_label("levels").is_none(), "the panel is hidden");
}

#[test]
fn a_preview_is_shown_until_the_model_is_there_and_nobody_is_moved() {
    let mut person = Person::opens(&[]);
    person.viewer().open(Path::new("raw.ply"));
    person.waits_until(|viewer| viewer.models.len() == 1 && viewer.navigation.has_anchors());
    for told in ["a preview of 1 234 points", "a preview: its error is not known", "1 min 30 s left", "tree, 40 %"] {
        assert!(person.harness.query_by_label_contains(told).is_some(), "{told}");
    }
    person.drags(MIDDLE, MIDDLE + vec2(80.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let before = person.viewer().own_viewpoint();
    person.files.built.store(true, Ordering::Relaxed);
    person.waits_until(|viewer| viewer.jobs.running().is_empty());
    assert!(person.viewer().models.iter().all(|staged| staged.preview.is_none()));
    assert_eq!(person.viewer().models.len(), 1);
    assert_eq!(person.viewer().own_viewpoint(), before);
    let orders = person.viewer().mailbox.receive(Some(Duration::ZERO)).orders;
    let [Order::Add(preview, ..), Order::Add(model, ..), Order::Remove(gone)] = &orders[..] else {
        panic!("{}: something is shown all the time", orders.len());
    };
    assert!(gone == preview && model != preview);
}

#[test]
fn a_build_that_is_cancelled_takes_its_preview_along() {
    let mut person = Person::opens(&[]);
    person.viewer().open(Path::new("raw.ply"));
    person.waits_until(|viewer| viewer.models.len() == 1);
    person.clicks_on("Cancel");
    person.waits_until(|viewer| viewer.jobs.running().is_empty());
    assert!(person.viewer().models.is_empty());
    assert!(person.harness.query_by_label_contains("raw.ply: cancelled").is_some());
}

#[test]
fn the_panel_fits_a_small_window_and_says_how_fine_the_picture_is() {
    let person = Person::opens(&[]);
    assert!(person.harness.query_by_label("nothing to show yet").is_some());
    let mut person = {
        drop(person);
        Person::opens(&["statue.glod"])
    };
    let mut shows = |limited_by, settled| {
        let report = CutReport { max_error_px: 7.3, threshold_px: 1.0, limited_by, ..Default::default() };
        let figures = Figures { report, typical_px: 2.1, settled, frames: 1, ..Default::default() };
        person.viewer().mailbox.show(None, figures);
        person.harness.run_steps(2);
        let told = |text: &str| person.harness.query_by_label(text).is_some();
        assert!(told("7.30 px") && told("2.10 px"));
        [
            "as fine as the data are",
            "as fine as asked for",
            "as fine as a budget allows",
            "being loaded",
            "being refined",
        ]
        .into_iter()
        .filter(|text| told(text))
        .collect::<Vec<_>>()
    };
    assert_eq!(shows(Some(Limit::Data), true), ["as fine as the data are"]);
    assert_eq!(shows(Some(Limit::Data), false), ["being refined"]);
    assert_eq!(shows(Some(Limit::Residency), false), ["being loaded"]);
    assert_eq!(shows(Some(Limit::Budget), true), ["as fine as a budget allows"]);
    assert_eq!(shows(None, true), ["as fine as asked for"]);
    let last = person.harness.get_by_label("Budgets").rect();
    assert!(last.bottom() < SIZE.height as f32, "{last}: all sections can be seen");
}

#[test]
fn who_comes_near_stops_before_the_surface() {
    let mut person = Person::opens(&["statue.glod"]);
    person.waits_until(|viewer| viewer.navigation.has_anchors());
    for _ in 0..30 {
        person.turns_wheel(MIDDLE, 300.0);
    }
    let at = person.viewer().own_viewpoint();
    let camera = person.viewer().camera(&at);
    let (x, y) = (f64::from(MIDDLE.x), f64::from(MIDDLE.y));
    let ray = Ray { origin: camera.eye, direction: camera.ray_through(DVec2::new(x, y)) };
    let hit = crate::pick::Pages::default()
        .first_hit(person.files.statue.file.splats().unwrap(), &ray)
        .unwrap()
        .expect("a surface");
    let leaves = hit.t * 2.0 * camera.tan_half_fov().y / (2.0 * hit.radius);
    assert!((8.0..40.0).contains(&leaves), "{leaves} leaves, one above the other");
}
