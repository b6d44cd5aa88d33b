//! What the window shows and how it answers a person; no window, no device.
//!
//! Its parts: [`inbox`] takes in what other threads have found or made, [`models`] puts models on the stage and takes them off,
//! [`notices`] tells a person, [`names`] calls files what they are to be called. What lies over the picture is drawn by the modules
//! `panel`, `overlay` and `viewport`.
//!
//! Goes in: egui's events, figures of the stage, answers of the picker, files that were opened. Comes out: egui's shapes, wishes and
//! orders for the stage. What always holds: nothing here waits or reads a file; every error ends as a notice on the screen.

mod inbox;
mod models;
mod names;
mod notices;

pub(crate) use names::Names;
pub use names::next_name;
pub(crate) use notices::Notice;

use crate::host::{Folder, Host, Model};
use crate::jobs::{JobNumber, Jobs};
use crate::mailbox::{Figures, Mailbox, ModelKey, Order, Wish};
use crate::measure::Measuring;
use crate::navigation::{Anchor, Input, Navigation};
use crate::panel;
use crate::picker::{Answer, Purpose, Question};
use crate::recorder::{Recorder, Viewpoint};
use crate::report::Tally;
use crate::settings::{FirstLook, Options, Settings};
use gigalod_geom::camera::UpAxis;
use gigalod_geom::{Aabb, Camera, ImageSize};
use glam::DVec2;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};

/// A model on the stage.
pub(crate) struct Staged {
    pub(crate) key: ModelKey,
    pub(crate) model: Model,
    /// Who opened it: models stand in the order in which they were asked for.
    pub(crate) asked: JobNumber,
    /// Of a preview: who builds the model, and how many of its points are shown.
    pub(crate) preview: Option<(JobNumber, u64)>,
}

/// Everything but the window and the device.
pub(crate) struct Viewer {
    pub(crate) mailbox: Arc<Mailbox>,
    pub(crate) ask: Sender<Question>,
    answers: Receiver<Answer>,
    pub(crate) jobs: Jobs,
    pub(crate) settings: Settings,
    pub(crate) fov_deg: f64,
    first_look: FirstLook,
    pub(crate) navigation: Navigation,
    pub(crate) scene_up: Option<UpAxis>,
    pub(crate) models: Vec<Staged>,
    next_key: u64,
    pub(crate) recorder: Recorder,
    pub(crate) measuring: Measuring,
    pub(crate) notices: Vec<Notice>,
    pub(crate) folder: Option<Folder>,
    pub(crate) figures: Figures,
    /// Milliseconds of the last frames.
    pub(crate) frame_times: std::collections::VecDeque<f32>,
    pub(crate) names: Names,
    pub(crate) shows_help: bool,
    pub(crate) shows_panel: bool,
    /// A drag without modifiers turns the eye on the spot.
    pub(crate) flies: bool,
    /// What was found under the cursor, and where that was.
    pub(crate) under_cursor: Option<(DVec2, Option<Anchor>)>,
    /// Zoom that waits for that: how much, where, since when.
    pub(crate) zoom_to_come: Option<ZoomToCome>,
    /// What was found in the middle of the picture during flight.
    pub(crate) ahead: Option<Anchor>,
    pub(crate) size: ImageSize,
    pub(crate) adapter: String,
    /// Why the stage has no device any more.
    pub(crate) wants_recovery: Option<String>,
    /// A person wants another device.
    pub(crate) wants_new_device: bool,
    pub(crate) wants_to_quit: bool,
    /// Names of pictures that show what is wished for next.
    ordered_pictures: Vec<PathBuf>,
    last_wish: Option<Wish>,
    wish_number: u64,
    told_problems: Vec<String>,
    /// What is to be told at exit.
    pub(crate) tally: Tally,
}

/// Zoom towards something that is being looked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ZoomToCome {
    /// What is left of the distance.
    pub(crate) factor: f64,
    /// Where the cursor is, in physical pixels.
    pub(crate) at_px: DVec2,
    /// Seconds of egui's clock.
    pub(crate) since: f64,
}

impl Viewer {
    pub(crate) fn new(
        options: &Options,
        host: Arc<dyn Host>,
        mailbox: Arc<Mailbox>,
        (ask, answers): (Sender<Question>, Receiver<Answer>),
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let fov = options.fov_deg.to_radians();
        let mut viewer = Self {
            jobs: Jobs::new(host, wake),
            mailbox,
            ask,
            answers,
            settings: options.settings,
            fov_deg: options.fov_deg,
            first_look: options.first_look,
            navigation: Navigation::new(Aabb::EMPTY, UpAxis::Y, fov, options.size),
            scene_up: None,
            models: Vec::new(),
            next_key: 0,
            recorder: Recorder::default(),
            measuring: Measuring::default(),
            notices: Vec::new(),
            folder: None,
            figures: Figures::default(),
            frame_times: std::collections::VecDeque::new(),
            names: Names::default(),
            shows_help: false,
            shows_panel: options.size.width > 2 * panel::WIDTH as u32,
            flies: false,
            under_cursor: None,
            zoom_to_come: None,
            ahead: None,
            size: options.size,
            adapter: String::new(),
            wants_recovery: None,
            wants_new_device: false,
            wants_to_quit: false,
            ordered_pictures: Vec::new(),
            last_wish: None,
            wish_number: 0,
            told_problems: Vec::new(),
            tally: Tally::default(),
        };
        if !viewer.shows_panel {
            viewer.notice("F2 shows the panel", 0.0);
        }
        options.files.iter().for_each(|file| viewer.open(file));
        viewer
    }

    /// Opens a file in the background.
    pub(crate) fn open(&mut self, file: &Path) {
        self.jobs.open(file);
    }

    /// One frame of the user interface, for a window of this size in physical pixels.
    pub(crate) fn ui(&mut self, ui: &mut egui::Ui, size: ImageSize) {
        let now = ui.input(|input| input.time);
        self.collect(now);
        for file in ui.input(|input| input.raw.dropped_files.clone()) {
            self.open(file.path());
        }
        self.keys(ui, now);
        if self.shows_panel {
            self.panel(ui, now);
        }
        let free = self.beside_panel(size, ui.ctx().pixels_per_point());
        if free.width.min(free.height) > 0 && free != self.size {
            self.size = free;
            self.navigation.apply(&Input::Orbit { by_px: DVec2::ZERO }, free);
        }
        self.viewport(ui);
        self.overlays(ui, now);
        let viewpoint = self.viewpoint(now);
        self.recorder.note(now, &viewpoint);
        self.wish(&viewpoint);
        if self.recorder.is_playing() || self.recorder.is_recording() {
            ui.request_repaint();
        }
    }

    /// What the panel leaves of a window for the picture: all of one that is too narrow for both.
    fn beside_panel(&self, window: ImageSize, pixels_per_point: f32) -> ImageSize {
        let panel_px = if self.shows_panel { (panel::WIDTH * pixels_per_point).round() as u32 } else { 0 };
        let is_wide = window.width > 2 * panel_px;
        ImageSize { width: if is_wide { window.width - panel_px } else { window.width }, ..window }
    }

    /// Where the camera is at this moment.
    pub(crate) fn viewpoint(&mut self, now: f64) -> Viewpoint {
        if let Some(played) = self.recorder.at(now) {
            if !self.recorder.is_playing() {
                self.navigation.go_to(played.eye, played.target, self.size);
            }
            return played;
        }
        self.own_viewpoint()
    }

    /// Where the person has put the camera.
    pub(crate) fn own_viewpoint(&self) -> Viewpoint {
        Viewpoint {
            eye: self.navigation.eye(),
            target: self.navigation.pivot(),
            up: self.navigation.up_axis().direction(),
            fov_deg: self.fov_deg,
        }
    }

    /// The camera of a viewpoint, as `render` makes it of the same numbers.
    pub(crate) fn camera(&self, at: &Viewpoint) -> Camera {
        Camera::look_at(at.eye, at.target, at.up, at.fov_deg.to_radians(), self.size)
    }

    /// Moves the camera; a path that is being played ends where it is.
    pub(crate) fn steer(&mut self, input: &Input, now: f64) {
        self.leave_path(now);
        if !matches!(input, Input::Zoom { .. }) {
            (self.under_cursor, self.zoom_to_come) = (None, None);
        }
        self.navigation.apply(input, self.size);
    }

    /// A path that is being played ends where it is.
    pub(crate) fn leave_path(&mut self, now: f64) {
        if let Some(played) = self.recorder.at(now) {
            self.recorder.pause();
            self.navigation.go_to(played.eye, played.target, self.size);
        }
    }

    /// Asks for what is under the cursor.
    pub(crate) fn pick(&mut self, purpose: Purpose, at_px: DVec2) {
        let camera = self.camera(&self.own_viewpoint());
        // Where the picker is gone there is nothing to find.
        let _ = self.ask.send(Question::Point { purpose, camera, at_px });
    }

    fn wish(&mut self, viewpoint: &Viewpoint) {
        if self.models.is_empty() {
            return;
        }
        let Settings { tint, cross_fade, target_ms, cpu_budget, gpu_budget, .. } = self.settings;
        let (camera, finest_px) = (self.camera(viewpoint), self.finest_px());
        let look = self.settings.look();
        let wish = Wish { camera, look, tint, cross_fade, finest_px, target_ms, cpu_budget, gpu_budget };
        if self.last_wish != Some(wish) {
            self.last_wish = Some(wish);
            self.wish_number += 1;
            self.tally.wished(self.wish_number);
            self.mailbox.wish(self.wish_number, wish);
        }
        for name in self.ordered_pictures.drain(..) {
            self.mailbox.order(Order::Picture(name, wish));
        }
    }

    /// At exit, when nobody looks any more: ends builds, and waits until all that is being written is on disk.
    pub(crate) fn finish(&mut self) {
        self.collect(0.0);
        self.jobs.running().iter().for_each(|job| job.work.cancel());
        while self.jobs.is_writing() || !self.jobs.running().is_empty() {
            std::thread::sleep(std::time::Duration::from_millis(5));
            self.collect(0.0);
        }
    }

    /// The next free name of a picture: numbers go up, and no file is replaced unasked.
    pub(crate) fn take_picture(&mut self, now: f64) {
        if self.models.is_empty() {
            self.notice("nothing to take a picture of", now);
            return;
        }
        self.ordered_pictures.push(self.names.next_picture());
        self.notice("the picture is taken of this view, as fine as it gets, as soon as nothing moves", now);
    }

    pub(crate) fn toggle_recording(&mut self, now: f64) {
        let at = self.own_viewpoint();
        if self.recorder.is_recording() {
            self.recorder.stop(now, &at);
            let frames = self.recorder.path().map_or(0, |path| path.frames.len());
            self.notice(&format!("recorded {frames} poses; play them, or save them"), now);
        } else {
            self.recorder.start(now);
        }
    }
}
