//! Who uses the viewer in its tests: a person, played by egui's harness, and a host with one statue in memory.

use crate::host::{Entry, Folder, Host, Kind, Model, Opened, Preview, Work};
use crate::mailbox::Mailbox;
use crate::panel::prepare;
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
use gigalod_runtime::{ModelFile, Similarity};
use gigalod_synth::{Order as VertexOrder, StatueOptions};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

pub(super) const SIZE: ImageSize = ImageSize { width: 1000, height: 700 };

/// Where the picture is, left of the panel.
pub(super) const MIDDLE: Pos2 = pos2(350.0, 350.0);

/// One statue, whatever is asked for; and a list of what was written.
pub(super) struct Files {
    folder: PathBuf,
    pub(super) statue: Model,
    /// A raw model may be ready.
    pub(super) built: AtomicBool,
    pub(super) written: Mutex<Vec<(PathBuf, String)>>,
}

impl Files {
    pub(super) fn wrote(&self, path: &Path, what: String) -> Result<PathBuf, String> {
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
            Some("hybrid.glod") => Ok(Opened::Model(Model { file: hybrid(&self.folder), ..self.statue.clone() })),
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

fn scan(folder: &Path, triangles: u64) -> Box<dyn gigalod_import::ModelStream> {
    let scan = folder.join(format!("statue{triangles}.ply"));
    let options = StatueOptions { triangles, seed: 3, colors: false, order: VertexOrder::Coherent };
    let mut out = std::fs::File::create(&scan).unwrap();
    gigalod_synth::write_statue(options, &mut out, &mut |_, _| {}).unwrap();
    gigalod_import::open(Box::new(std::fs::File::open(&scan).unwrap())).unwrap()
}

/// Smaller than [`statue`].
fn hybrid(folder: &Path) -> ModelFile {
    let built = folder.join("hybrid.glod");
    gigalod_build::hybrid::build(scan(folder, 2000), &Default::default(), &NoProgress, &built).unwrap();
    ModelFile::open(Container::open(Arc::new(FileStore::open(&built).unwrap())).unwrap()).unwrap()
}

pub(crate) fn statue(folder: &Path) -> Arc<SplatFile> {
    let stream = scan(folder, 20_000);
    let built = folder.join("statue.glod");
    gigalod_build::splats::build(stream, &Default::default(), &NoProgress, &built).unwrap();
    let container = Container::open(Arc::new(FileStore::open(&built).unwrap())).unwrap();
    Arc::new(SplatFile::open(container).unwrap())
}

/// A viewer that has opened `files`, and what it writes.
pub(super) struct Person {
    pub(super) harness: Harness<'static, Viewer>,
    pub(super) files: Arc<Files>,
    pub(super) _folder: tempfile::TempDir,
}

impl Person {
    pub(super) fn opens(names: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let statue = Model {
            source: "statue.glod".into(),
            file: statue(folder.path()).into(),
            original: None,
            unit: None,
            placements: vec![Similarity::IDENTITY],
        };
        let files = Arc::new(Files {
            folder: folder.path().to_owned(),
            statue,
            built: AtomicBool::new(false),
            written: Mutex::default(),
        });
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
        prepare(&harness.ctx);
        harness.run_steps(2);
        let mut person = Self { harness, files, _folder: folder };
        person.waits_until(|viewer| viewer.jobs.running().is_empty());
        person
    }

    pub(super) fn viewer(&mut self) -> &mut Viewer {
        self.harness.state_mut()
    }

    /// Frames until something is so; at most a minute, which is a failure.
    pub(super) fn waits_until(&mut self, is_so: impl Fn(&Viewer) -> bool) {
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

    pub(super) fn event(&mut self, event: Event) {
        self.harness.event(event);
        self.harness.run_steps(1);
    }

    pub(super) fn button(&mut self, pos: Pos2, button: PointerButton, pressed: bool, modifiers: Modifiers) {
        self.harness.event(Event::PointerMoved(pos));
        self.event(Event::PointerButton { pos, button, pressed, modifiers });
    }

    pub(super) fn drags(&mut self, from: Pos2, to: Pos2, button: PointerButton, modifiers: Modifiers) {
        self.event(Event::ModifiersChanged(modifiers));
        self.button(from, button, true, modifiers);
        for part in [0.25, 0.5, 0.75, 1.0] {
            self.event(Event::PointerMoved(from + (to - from) * part));
        }
        self.button(to, button, false, modifiers);
        self.event(Event::ModifiersChanged(Modifiers::NONE));
    }

    pub(super) fn clicks(&mut self, at: Pos2) {
        self.button(at, PointerButton::Primary, true, Modifiers::NONE);
        self.button(at, PointerButton::Primary, false, Modifiers::NONE);
    }

    pub(super) fn turns_wheel(&mut self, at: Pos2, points: f32) {
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

    pub(super) fn presses(&mut self, key: egui::Key) {
        self.harness.key_press(key);
        self.harness.run_steps(2);
    }

    pub(super) fn clicks_on(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_steps(2);
    }

    /// Whether a part of the statue is in the picture: points of its surface, not those that the camera is held by.
    pub(super) fn sees_the_statue(&mut self) -> bool {
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
