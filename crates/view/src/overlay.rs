//! What lies over the picture: help, work in progress, a folder's models to choose from, notices.

use crate::viewer::{Notice, Viewer};
use egui::{Align2, Color32, Frame, ProgressBar, RichText, ScrollArea, Ui, Window, vec2};

/// What mouse and keys do.
const HELP: [(&str, &str); 18] = [
    ("drag", "turn around the pivot"),
    ("right or middle drag, Shift+drag", "move across"),
    ("wheel", "come nearer to what is under the cursor"),
    ("double click", "turn around this point"),
    ("Home", "look at everything"),
    ("W A S D", "fly forward, left, back, right"),
    ("E Q", "fly up, down"),
    ("Shift", "fly faster"),
    ("F", "dragging turns the head, and back"),
    ("Ctrl+drag", "move the light"),
    ("M", "measure: click two points"),
    ("P", "save a picture"),
    ("R", "record a camera path, and stop"),
    ("Space", "play it, and stop"),
    ("F2", "hide the panel, and show it"),
    ("F1", "this help"),
    ("Esc", "leave help and measuring"),
    ("Ctrl+Q", "close the window"),
];

impl Viewer {
    pub(crate) fn overlays(&mut self, ui: &Ui, now: f64) {
        self.help(ui);
        self.work(ui);
        self.choice(ui);
        self.notices(ui, now);
        if self.recorder.is_recording() {
            let recording = egui::Area::new(egui::Id::unique("recording")).anchor(Align2::LEFT_TOP, vec2(12.0, 10.0));
            recording.interactable(false).show(ui.ctx(), |ui| {
                ui.label(RichText::new("recording").color(Color32::from_rgb(255, 90, 80)).size(16.0));
            });
        }
    }

    fn help(&mut self, ui: &Ui) {
        let mut is_open = self.shows_help;
        let window = Window::new("Mouse and keys").open(&mut is_open).collapsible(false).resizable(false);
        window.anchor(Align2::LEFT_TOP, vec2(16.0, 16.0)).show(ui.ctx(), |ui| {
            egui::Grid::new("help").num_columns(2).spacing([18.0, 4.0]).show(ui, |ui| {
                for (keys, does) in HELP {
                    ui.strong(keys);
                    ui.label(does);
                    ui.end_row();
                }
            });
        });
        self.shows_help = is_open;
    }

    /// Files that are being opened, with a way to stop that.
    fn work(&mut self, ui: &Ui) {
        if self.jobs.running().is_empty() {
            return;
        }
        let window = Window::new("Opening").collapsible(false).resizable(false).title_bar(false);
        window.anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(ui.ctx(), |ui| {
            for job in self.jobs.running() {
                let progress = job.work.progress();
                ui.set_width(340.0);
                ui.strong(&job.name);
                ui.horizontal(|ui| {
                    let part = progress.part.unwrap_or(0.0);
                    let bar = ProgressBar::new(part).desired_width(250.0).animate(progress.part.is_none());
                    ui.add(bar.text(match progress.part {
                        Some(part) => format!("{} {:.0} %", progress.phase, part * 100.0),
                        None => progress.phase.clone(),
                    }));
                    let is_cancelled = job.work.is_cancelled();
                    if ui.add_enabled(!is_cancelled, egui::Button::new("Cancel")).clicked() {
                        job.work.cancel();
                    }
                });
            }
        });
    }

    /// Models of a folder.
    fn choice(&mut self, ui: &Ui) {
        let Some(files) = &self.folder else { return };
        let (mut is_open, mut chosen) = (true, None);
        let window = Window::new("Choose a model").open(&mut is_open).collapsible(false).default_width(380.0);
        window.anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(ui.ctx(), |ui| {
            if files.is_empty() {
                ui.label("This folder has no models.");
            }
            ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
                for file in files {
                    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    if ui.button(name).clicked() {
                        chosen = Some(file.clone());
                    }
                }
            });
        });
        if let Some(file) = &chosen {
            self.open(file);
        }
        if chosen.is_some() || !is_open {
            self.folder = None;
        }
    }

    /// The newest piece of news, through which clicks reach the picture, and errors until they are closed.
    fn notices(&mut self, ui: &Ui, now: f64) {
        self.notices.retain(|notice| notice.until > now);
        let below_recording = if self.recorder.is_recording() { 36.0 } else { 10.0 };
        let news = egui::Area::new(egui::Id::unique("news")).anchor(Align2::LEFT_TOP, vec2(12.0, below_recording));
        if let Some(notice) = self.notices.iter().find(|notice| !notice.is_error) {
            news.interactable(false).show(ui.ctx(), |ui| {
                bubble(ui, Color32::from_rgb(45, 60, 80), |ui| text_of(ui, notice));
            });
            ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64((notice.until - now).max(0.02)));
        }
        if !self.notices.iter().any(|notice| notice.is_error) {
            return;
        }
        let errors = egui::Area::new(egui::Id::unique("errors")).anchor(Align2::LEFT_BOTTOM, vec2(12.0, -12.0));
        errors.show(ui.ctx(), |ui| {
            ui.set_max_width(620.0);
            self.notices.retain(|notice| {
                notice.is_error.then(|| {
                    bubble(ui, Color32::from_rgb(110, 30, 30), |ui| {
                        ui.horizontal(|ui| {
                            let is_closed = ui.small_button("x").clicked();
                            text_of(ui, notice);
                            !is_closed
                        })
                        .inner
                    })
                }) != Some(false)
            });
        });
    }
}

fn bubble<R>(ui: &mut Ui, fill: Color32, content: impl FnOnce(&mut Ui) -> R) -> R {
    Frame::popup(ui.style()).fill(fill).show(ui, content).inner
}

fn text_of(ui: &mut Ui, notice: &Notice) {
    ui.add(egui::Label::new(RichText::new(&notice.text).color(Color32::WHITE)).wrap().selectable(false));
}
