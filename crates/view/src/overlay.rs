//! What lies over the picture: help, work in progress, a folder's models to choose from, notices.

use crate::host::{Kind, Progress};
use crate::panel::bytes;
use crate::viewer::{Notice, Viewer};
use egui::{Align, Align2, Color32, Frame, Layout, ProgressBar, RichText, ScrollArea, Ui, Window, vec2};
use std::path::Path;
use std::time::Duration;

/// Of the list of what is being opened, in egui's points.
const WORK_WIDTH: f32 = 360.0;

/// Most that news and errors take before they go on in the next line, in points.
const MESSAGE_WIDTH: f32 = 620.0;
/// Of theirs, from the picture's edges.
const MESSAGE_MARGIN: f32 = 20.0;

/// What mouse and keys do.
const HELP: [(&str, &str); 19] = [
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
    ("F5", "open the graphics device anew"),
    ("F1", "this help"),
    ("Esc", "leave help, measuring and the list of files"),
    ("Ctrl+Q", "close the window"),
];

impl Viewer {
    pub(crate) fn overlays(&mut self, ui: &Ui, now: f64) {
        self.help(ui);
        self.work(ui);
        self.choice(ui);
        self.notices(ui, now);
        self.modes(ui);
    }

    /// What keys have switched on, and what switches it off.
    fn modes(&self, ui: &Ui) {
        let modes = [
            (self.recorder.is_recording(), "recording (R stops)", Color32::from_rgb(255, 90, 80)),
            (self.flies, "dragging turns the head (F)", Color32::from_rgb(120, 190, 255)),
            (self.measuring.is_on, "click two points (Esc ends)", Color32::from_rgb(255, 170, 60)),
        ];
        let area = egui::Area::new(egui::Id::unique("modes")).anchor(Align2::LEFT_TOP, vec2(12.0, 10.0));
        area.interactable(false).show(ui.ctx(), |ui| {
            for (_, text, color) in modes.into_iter().filter(|(is_on, ..)| *is_on) {
                // In one line: a new area is as narrow as can be.
                ui.add(egui::Label::new(RichText::new(text).color(color).size(16.0)).extend());
            }
        });
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
        // In the middle, or out of the way of what there is to see.
        let center = self.picture_rect(ui).center_top();
        let (place, pivot) = match self.models.is_empty() {
            true => (self.picture_rect(ui).center(), Align2::CENTER_CENTER),
            false => (center + vec2(0.0, 12.0), Align2::CENTER_TOP),
        };
        let window = Window::new("Opening").collapsible(false).resizable(false).title_bar(false);
        window.pivot(pivot).current_pos(place).movable(false).show(ui.ctx(), |ui| {
            ui.set_width(WORK_WIDTH);
            for job in self.jobs.running() {
                let Progress { phase, part, left } = job.work.progress();
                ui.horizontal(|ui| {
                    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                        let is_cancelled = job.work.is_cancelled();
                        if ui.add_enabled(!is_cancelled, egui::Button::new("Cancel")).clicked() {
                            job.work.cancel();
                        }
                        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                            ui.add(egui::Label::new(RichText::new(&job.name).strong()).truncate());
                        });
                    });
                });
                let bar = ProgressBar::new(part.unwrap_or(0.0)).desired_width(WORK_WIDTH).animate(part.is_none());
                ui.add(bar.desired_height(8.0));
                ui.horizontal(|ui| {
                    let percent = part.map(|part| format!(", {:.0} %", part * 100.0)).unwrap_or_default();
                    ui.label(format!("{phase}{percent}"));
                    if let Some(left) = left {
                        ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.weak(time_left(left)));
                    }
                });
            }
        });
    }

    /// What a folder has to choose from.
    fn choice(&mut self, ui: &Ui) {
        let Some(folder) = &self.folder else { return };
        let (mut is_open, mut chosen) = (true, None);
        let place = self.picture_rect(ui);
        let width = (place.width() - 60.0).clamp(240.0, 520.0);
        let window = Window::new("Open").open(&mut is_open).collapsible(false).resizable(false);
        window.pivot(Align2::CENTER_CENTER).current_pos(place.center()).movable(false).show(ui.ctx(), |ui| {
            ui.set_width(width);
            ui.horizontal(|ui| {
                let above = folder.path.parent();
                if ui.add_enabled(above.is_some(), egui::Button::new("Up")).clicked() {
                    chosen = above.map(Path::to_owned);
                }
                // The end of a long name says more than its beginning.
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    ui.add(egui::Label::new(RichText::new(folder.path.to_string_lossy()).weak()).truncate())
                });
            });
            ui.separator();
            if folder.entries.is_empty() {
                ui.label("This folder has nothing that can be shown.");
            }
            let rows = ScrollArea::vertical().max_height((place.height() - 160.0).clamp(120.0, 460.0));
            rows.auto_shrink([false, true]).show(ui, |ui| {
                let columns = [width - 250.0, 130.0, 80.0];
                for entry in &folder.entries {
                    ui.horizontal(|ui| {
                        let name = entry.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                        let height = ui.spacing().interact_size.y;
                        let button = egui::Button::new(&name).frame(false).truncate();
                        let name_row = Layout::left_to_right(Align::Center).with_main_justify(false);
                        ui.allocate_ui_with_layout(vec2(columns[0], height), name_row, |ui| {
                            ui.set_width(columns[0]);
                            if ui.add(button).on_hover_text(&name).clicked() {
                                chosen = Some(entry.path.clone());
                            }
                        });
                        ui.allocate_ui_with_layout(vec2(columns[1], height), name_row, |ui| {
                            ui.set_width(columns[1]);
                            ui.weak(kind_name(entry.kind));
                        });
                        let size_row = Layout::right_to_left(Align::Center);
                        ui.allocate_ui_with_layout(vec2(columns[2], height), size_row, |ui| {
                            ui.set_width(columns[2]);
                            if entry.kind != Kind::Folder {
                                ui.weak(bytes(entry.bytes));
                            }
                        });
                    });
                }
            });
        });
        if let Some(path) = &chosen {
            self.open(path);
        }
        if chosen.is_some() || !is_open {
            self.folder = None;
        }
    }

    /// Where the picture is, in egui's points.
    pub(crate) fn picture_rect(&self, ui: &Ui) -> egui::Rect {
        let scale = ui.ctx().pixels_per_point();
        let size = vec2(self.size.width as f32, self.size.height as f32) / scale;
        egui::Rect::from_min_size(egui::Pos2::ZERO, size)
    }

    /// The newest piece of news, through which clicks reach the picture, and errors until they are closed.
    fn notices(&mut self, ui: &Ui, now: f64) {
        self.notices.retain(|notice| notice.until > now);
        let width = (self.picture_rect(ui).width() - 2.0 * MESSAGE_MARGIN).clamp(100.0, MESSAGE_WIDTH);
        let below_recording = if self.recorder.is_recording() { 36.0 } else { 10.0 };
        let news = egui::Area::new(egui::Id::unique("news")).anchor(Align2::LEFT_TOP, vec2(12.0, below_recording));
        if let Some(notice) = self.notices.iter().find(|notice| !notice.is_error) {
            news.interactable(false).show(ui.ctx(), |ui| {
                ui.set_max_width(width);
                bubble(ui, Color32::from_rgb(45, 60, 80), |ui| text_of(ui, notice));
            });
            ui.ctx().request_repaint_after(Duration::from_secs_f64((notice.until - now).max(0.02)));
        }
        if !self.notices.iter().any(|notice| notice.is_error) {
            return;
        }
        let errors = egui::Area::new(egui::Id::unique("errors")).anchor(Align2::LEFT_BOTTOM, vec2(12.0, -12.0));
        errors.show(ui.ctx(), |ui| {
            ui.set_max_width(width);
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

fn kind_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Folder => "folder",
        Kind::Model => "ready",
        Kind::Built => "built before",
        Kind::Raw => "to be built",
        Kind::Scene => "scene",
        Kind::Path => "camera path",
    }
}

fn time_left(left: Duration) -> String {
    match left.as_secs() {
        0 => "a moment left".to_string(),
        seconds @ 1..60 => format!("{seconds} s left"),
        seconds @ 60..3600 => format!("{} min {} s left", seconds / 60, seconds % 60),
        seconds => format!("{} h {} min left", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_as_people_do() {
        let texts = [0, 59, 61, 7261].map(|seconds| time_left(Duration::from_secs(seconds)));
        assert_eq!(texts, ["a moment left", "59 s left", "1 min 1 s left", "2 h 1 min left"]);
    }
}
