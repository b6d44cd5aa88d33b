//! What the window shows and how it answers a person; no window, no device.
//!
//! Goes in: egui's events, figures of the stage, answers of the picker, files that were opened. Comes out: egui's shapes, wishes and
//! orders for the stage. What always holds: nothing here waits or reads a file; every error ends as a notice on the screen.

use crate::host::{Folder, Host, Model, Opened, OpenedScene, Preview, up_of};
use crate::jobs::{Finished, JobNumber, Jobs};
use crate::mailbox::{Figures, Mailbox, ModelKey, News, Order, Wish};
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

/// Something to tell a person.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Notice {
    pub(crate) text: String,
    pub(crate) is_error: bool,
    /// Seconds of egui's clock at which it goes by itself; errors stay.
    pub(crate) until: f64,
}

/// A model on the stage.
pub(crate) struct Staged {
    pub(crate) key: ModelKey,
    pub(crate) model: Model,
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

/// Names of files to write, as a person may change them.
pub(crate) struct Names {
    pub(crate) picture: String,
    pub(crate) path: String,
    pub(crate) scene: String,
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
            names: Names { picture: "view-1.png".into(), path: "path.json".into(), scene: "scene.toml".into() },
            shows_help: false,
            shows_panel: true,
            flies: false,
            under_cursor: None,
            zoom_to_come: None,
            ahead: None,
            size: options.size,
            adapter: String::new(),
            wants_recovery: None,
            wants_new_device: false,
            wants_to_quit: false,
            last_wish: None,
            wish_number: 0,
            told_problems: Vec::new(),
            tally: Tally::default(),
        };
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
        if let Some(played) = self.recorder.at(now) {
            self.recorder.pause();
            self.navigation.go_to(played.eye, played.target, self.size);
        }
        if !matches!(input, Input::Zoom { .. }) {
            (self.under_cursor, self.zoom_to_come) = (None, None);
        }
        self.navigation.apply(input, self.size);
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
        let Settings { tint, finest_px, target_ms, cpu_budget, gpu_budget, .. } = self.settings;
        let camera = self.camera(viewpoint);
        let wish = Wish { camera, look: self.settings.look(), tint, finest_px, target_ms, cpu_budget, gpu_budget };
        if self.last_wish != Some(wish) {
            self.last_wish = Some(wish);
            self.wish_number += 1;
            self.tally.wished(self.wish_number);
            self.mailbox.wish(self.wish_number, wish);
        }
    }

    /// Takes in what other threads have to say.
    fn collect(&mut self, now: f64) {
        let delivery = self.mailbox.collect();
        for figures in delivery.figures {
            self.tally.drawn(&figures);
            self.frame_times.push_back(figures.frame_ms as f32);
            if self.frame_times.len() > 200 {
                self.frame_times.pop_front();
            }
            for problem in &figures.problems {
                if !self.told_problems.contains(problem) {
                    self.told_problems.push(problem.clone());
                    self.notice_error(problem);
                }
            }
            self.figures = figures;
        }
        for news in delivery.news {
            match news {
                News::Picture(name, size, rgba) => self.jobs.write_picture(name, size, rgba),
                News::DeviceLost(why) => self.wants_recovery = Some(why),
                News::Problem(problem) => self.notice_error(&problem),
            }
        }
        while let Ok(answer) = self.answers.try_recv() {
            self.hear(answer, now);
        }
        let previews: Vec<(JobNumber, Preview)> =
            self.jobs.running().iter().filter_map(|job| Some((job.number, job.work.take_preview()?))).collect();
        for (job, Preview { model, points }) in previews {
            self.add(model, Some((job, points)));
            self.show_whole();
        }
        for finished in self.jobs.finished() {
            match finished {
                Finished::Opened(job, opened) => {
                    let previews = self.previews_of(job);
                    match *opened {
                        Ok(opened) => self.take(opened, !previews.is_empty(), now),
                        Err(error) => self.notice_error(&error),
                    }
                    // Not before the model is there: something is shown all the time.
                    previews.into_iter().for_each(|key| self.remove(key));
                }
                Finished::Cancelled(job, name) => {
                    self.notice(&format!("{name}: cancelled"), now);
                    self.previews_of(job).into_iter().for_each(|key| self.remove(key));
                }
                Finished::Wrote(path, Ok(())) => {
                    self.tally.written.push(path.display().to_string());
                    self.notice(&format!("written: {}", path.display()), now);
                }
                Finished::Wrote(_, Err(error)) => self.notice_error(&error),
            }
        }
    }

    fn previews_of(&self, job: JobNumber) -> Vec<ModelKey> {
        let is_of_job = |staged: &&Staged| staged.preview.is_some_and(|(number, _)| number == job);
        self.models.iter().filter(is_of_job).map(|staged| staged.key).collect()
    }

    /// Shows what was opened; from where a person looks at its preview, if there was one.
    fn take(&mut self, opened: Opened, had_preview: bool, now: f64) {
        match opened {
            Opened::Model(model) => {
                self.add(model, None);
                if had_preview {
                    self.navigation.set_bounds(self.bounds(), self.size);
                } else {
                    self.show_whole();
                }
            }
            Opened::Scene(scene) => self.show_scene(scene),
            Opened::Folder(folder) => self.folder = Some(folder),
            Opened::Path(path) => {
                self.recorder.load(path);
                self.recorder.play(now);
            }
        }
    }

    fn hear(&mut self, answer: Answer, now: f64) {
        match answer {
            Answer::Anchors(anchors) => self.navigation.set_anchors(&anchors, self.size),
            Answer::Problem(problem) => self.notice_error(&problem),
            Answer::Point { purpose: Purpose::Measure(number), found, .. } => {
                if let Some(found) = found {
                    self.navigation.apply(&Input::Anchor(found.anchor()), self.size);
                }
                self.measuring.found(number, found);
            }
            Answer::Point { purpose: Purpose::Pivot, found: Some(found), .. } => {
                self.navigation.apply(&Input::Pivot(found.anchor()), self.size);
            }
            Answer::Point { purpose: Purpose::Zoom, at_px, found } => {
                self.under_cursor = Some((at_px, found.map(|found| found.anchor())));
                if let Some(ZoomToCome { factor, at_px, .. }) = self.zoom_to_come.take() {
                    self.zoom(at_px, factor, now);
                }
            }
            Answer::Point { purpose: Purpose::Ahead, found, .. } => self.ahead = found.map(|found| found.anchor()),
            Answer::Point { .. } => {}
        }
    }

    /// Puts a model on the stage.
    fn add(&mut self, model: Model, preview: Option<(JobNumber, u64)>) {
        let key = ModelKey(self.next_key);
        self.next_key += 1;
        self.mailbox.order(Order::Add(key, model.file.clone(), model.placements.clone()));
        let _ = self.ask.send(Question::Add(key, model.clone()));
        if self.models.is_empty() {
            let stem = stem_of(&model.source);
            self.names =
                Names { picture: format!("{stem}-1.png"), path: format!("{stem}.json"), scene: format!("{stem}.toml") };
        }
        self.models.push(Staged { key, model, preview });
    }

    pub(crate) fn remove(&mut self, key: ModelKey) {
        self.models.retain(|staged| staged.key != key);
        self.mailbox.order(Order::Remove(key));
        let _ = self.ask.send(Question::Remove(key));
        self.measuring = Measuring::default();
    }

    fn show_scene(&mut self, scene: OpenedScene) {
        let OpenedScene { description, models } = scene;
        let gone: Vec<ModelKey> = self.models.iter().map(|staged| staged.key).collect();
        gone.into_iter().for_each(|key| self.remove(key));
        self.scene_up = description.up;
        self.settings.background = description.background.unwrap_or(self.settings.background);
        self.settings.towards_light = description.towards_light();
        description.not_drawn().iter().for_each(|missing| self.notice_error(missing));
        models.into_iter().for_each(|model| self.add(model, None));
        let camera = description.camera.unwrap_or_default();
        self.fov_deg = camera.fov_deg.unwrap_or(self.fov_deg);
        self.show_whole();
        if camera.eye.is_some() || camera.target.is_some() {
            let (eye, target) = (self.navigation.eye(), self.navigation.pivot());
            self.navigation.set_home(camera.eye.unwrap_or(eye), camera.target.unwrap_or(target), self.size);
        }
    }

    /// Around all models; world space.
    pub(crate) fn bounds(&self) -> Aabb {
        let corners = self.models.iter().flat_map(|Staged { model, .. }| {
            let corners = model.file.skeleton().root().bounds.corners();
            let place = move |at: &gigalod_runtime::Similarity| {
                let at = *at;
                corners.map(|corner| at.position + at.rotation * (corner * at.scale))
            };
            model.placements.iter().flat_map(place)
        });
        Aabb::of(corners)
    }

    /// Which way is up.
    pub(crate) fn up(&self) -> UpAxis {
        let first = self.models.first().map(|staged| std::slice::from_ref(&staged.model));
        self.scene_up.unwrap_or(up_of(first.unwrap_or_default()))
    }

    /// Looks at everything, from where the options say.
    fn show_whole(&mut self) {
        let (bounds, up, fov) = (self.bounds(), self.up(), self.fov_deg.to_radians());
        self.navigation = Navigation::new(bounds, up, fov, self.size);
        match self.first_look {
            FirstLook::Whole => {}
            FirstLook::From { eye, target } => self.navigation.set_home(eye, target, self.size),
            FirstLook::Orbit([azimuth, elevation, zoom]) => {
                let camera = Camera::orbit(&bounds, up, [azimuth, elevation], zoom, fov, self.size);
                self.navigation.set_home(camera.eye, bounds.center(), self.size);
            }
        }
        (self.under_cursor, self.zoom_to_come, self.ahead) = (None, None, None);
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

    /// Tells something that may be forgotten.
    /// Tells news, in the place of older news.
    pub(crate) fn notice(&mut self, text: &str, now: f64) {
        self.notices.retain(|notice| notice.is_error);
        self.notices.push(Notice { text: text.to_string(), is_error: false, until: now + 6.0 });
    }

    /// Tells of something that went wrong and was put right.
    pub(crate) fn notice_mended(&mut self, text: &str, now: f64) {
        self.tally.problems.push(text.to_string());
        self.notice(text, now);
    }

    /// Tells an error, once as long as it is shown.
    pub(crate) fn notice_error(&mut self, text: &str) {
        if self.notices.iter().any(|notice| notice.text == text) {
            return;
        }
        self.tally.problems.push(text.to_string());
        self.notices.push(Notice { text: text.to_string(), is_error: true, until: f64::INFINITY });
    }

    /// The next free name of a picture: numbers go up, and no file is replaced unasked.
    pub(crate) fn take_picture(&mut self, now: f64) {
        if self.models.is_empty() {
            self.notice("nothing to take a picture of", now);
            return;
        }
        let name = PathBuf::from(&self.names.picture);
        self.mailbox.order(Order::Picture(name));
        self.names.picture = next_name(&self.names.picture);
        self.notice("the picture is taken as soon as it is as fine as it gets", now);
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

/// `a/scan.ply.gz` → `scan`.
fn stem_of(model: &Path) -> String {
    let name = model.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// `statue-1.png` → `statue-2.png`; a name without a number gets one.
fn next_name(name: &str) -> String {
    let path = Path::new(name);
    let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy())).unwrap_or_default();
    let stem = name.strip_suffix(&extension).unwrap_or(name);
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (front, number) = stem.split_at(stem.len() - digits);
    match number.parse::<u64>() {
        Ok(number) => format!("{front}{}{extension}", number.saturating_add(1)),
        Err(_) => format!("{stem}-2{extension}"),
    }
}

#[cfg(test)]
mod tests {
    use super::{Path, next_name, stem_of};

    #[test]
    fn what_is_saved_is_called_as_the_model() {
        let stems = ["a/scan.ply.gz", "lion.copc.laz", "b"].map(|name| stem_of(Path::new(name)));
        assert_eq!(stems, ["scan", "lion.copc", "b"]);
    }

    #[test]
    fn names_count_up() {
        assert_eq!(next_name("statue-1.png"), "statue-2.png");
        assert_eq!(next_name("a/b9.png"), "a/b10.png");
        assert_eq!((next_name("x.png").as_str(), next_name("x").as_str()), ("x-2.png", "x-2"));
    }
}
