//! The panel: what can be chosen, and what is going on ([`figures`]).

mod figures;

use crate::mailbox::ModelKey;
use crate::measure::{digits, length};
use crate::navigation::Input;
use crate::viewer::{Staged, Viewer};
use egui::{
    CollapsingHeader, Color32, DragValue, Grid, Panel, ScrollArea, Sense, Slider, SliderClamping, TextEdit, Ui, Visuals,
};
use gigalod_geom::camera::UpAxis;
use gigalod_render::Kernel;
use gigalod_runtime::ModelFile;
use gigalod_runtime::scene::description::{Light, LightKind, Places, SceneCamera, SceneDescription, SceneModel};
use gigalod_runtime::splats::Tint;
use std::path::{Path, PathBuf};

/// Points.
pub(crate) const WIDTH: f32 = 320.0;

/// Colours of the interface: egui's dark ones, with text that is easier to read.
fn visuals() -> Visuals {
    let mut visuals = Visuals::dark();
    visuals.widgets.noninteractive.fg_stroke.color = Color32::from_gray(190);
    visuals.widgets.inactive.fg_stroke.color = Color32::from_gray(210);
    visuals
}

/// Where frames take a second, a button goes down in one and comes up in the next, however quick the hand: that is a click all the same.
const LONGEST_CLICK: f64 = 10.0;

/// How an interface looks, and what it takes for a click.
pub(crate) fn prepare(context: &egui::Context) {
    context.set_theme(egui::Theme::Dark);
    context.set_visuals_of(egui::Theme::Dark, visuals());
    context.options_mut(|options| options.input_options.max_click_duration = LONGEST_CLICK);
}

impl Viewer {
    pub(crate) fn panel(&mut self, ui: &mut Ui, now: f64) {
        let frame = egui::Frame::side_top_panel(ui.style()).inner_margin(10.0);
        Panel::right("panel").exact_size(WIDTH).resizable(false).frame(frame).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                self.models_section(ui, now);
                section(ui, "Figures", true, |ui| self.figures_section(ui));
                section(ui, "Picture", true, |ui| self.picture_section(ui, now));
                section(ui, "Measure", true, |ui| self.measure_section(ui));
                section(ui, "Save", true, |ui| self.save_section(ui, now));
                section(ui, "Camera path", false, |ui| self.path_section(ui, now));
                section(ui, "Budgets", false, |ui| self.budgets_section(ui));
            });
        });
    }

    fn models_section(&mut self, ui: &mut Ui, now: f64) {
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            ui.heading("Gigalod");
            if ui.button("Open…").on_hover_text("Choose a model, a scene, a folder or a camera path").clicked() {
                self.open(Path::new("."));
            }
            if ui.button("Home").on_hover_text("Look at everything (Home)").clicked() {
                self.steer(&Input::Home, now);
            }
            ui.toggle_value(&mut self.shows_help, "Keys (F1)");
        });
        let (mut removed, mut looked_at): (Option<ModelKey>, Option<ModelKey>) = (None, None);
        for Staged { key, model, preview, .. } in &self.models {
            ui.horizontal(|ui| {
                if ui.small_button("x").on_hover_text("Take this model away").clicked() {
                    removed = Some(*key);
                }
                let name = model.source.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let text = match preview {
                    Some((_, points)) => format!("{name}, a preview of {} points", count(*points)),
                    None => match &model.file {
                        ModelFile::Splats(file) => format!("{name}, {} splats", count(file.skeleton().root().leaves)),
                        ModelFile::Hybrid(file) => format!("{name}, {} nodes", count(file.skeleton().root().nodes)),
                    },
                };
                let name = ui.add(egui::Label::new(text).truncate().sense(Sense::click()));
                if name.on_hover_text(format!("{}\nClick to look at it", model.source.display())).clicked() {
                    looked_at = Some(*key);
                }
            });
        }
        if let Some(key) = looked_at {
            self.look_at(key, now);
        }
        if let Some(key) = removed {
            self.remove(key);
        }
    }

    fn picture_section(&mut self, ui: &mut Ui, now: f64) {
        let (mut up, mut finest_px) = (self.up(), self.finest_px());
        let settings = &mut self.settings;
        Grid::new("picture").num_columns(2).spacing([8.0, 5.0]).show(ui, |ui| {
            let label = ui.label("Error at rest").on_hover_text("Largest error on screen that is wanted");
            // What was asked for on the command line may be beyond its ends.
            let slider = Slider::new(&mut finest_px, 0.25..=32.0).clamping(SliderClamping::Edits);
            if ui.add(slider.logarithmic(true).suffix(" px")).labelled_by(label.id).changed() {
                settings.finest_px = Some(finest_px);
            }
            ui.end_row();
            let label = ui.label("Frame time").on_hover_text("How long a frame may take while the camera moves");
            let slider = Slider::new(&mut settings.target_ms, 8.0..=500.0)
                .clamping(SliderClamping::Edits)
                .logarithmic(true)
                .suffix(" ms");
            ui.add(slider).labelled_by(label.id);
            ui.end_row();
            let label = ui.label("Kernel");
            let chosen = egui::ComboBox::from_id_salt("kernel").selected_text(kernel_name(settings.kernel));
            let list = chosen.show_ui(ui, |ui| {
                for kernel in Kernel::ALL {
                    ui.selectable_value(&mut settings.kernel, kernel, kernel_name(kernel));
                }
            });
            list.response.labelled_by(label.id);
            ui.end_row();
            ui.label("Colours");
            ui.horizontal(|ui| {
                ui.selectable_value(&mut settings.tint, Tint::Model, "model");
                ui.selectable_value(&mut settings.tint, Tint::Level, "levels");
                let fades = ui.checkbox(&mut settings.cross_fade, "cross-fade");
                fades.on_hover_text("Levels of meshes fade into each other while the camera moves; more is drawn");
            });
            ui.end_row();
            let label = ui.label("Background");
            ui.color_edit_button_srgb(&mut settings.background).labelled_by(label.id);
            ui.end_row();
            ui.label("Light").on_hover_text("Drag in the picture with Ctrl held down");
            ui.horizontal(|ui| match settings.towards_light {
                None => {
                    ui.weak("at the shoulder; Ctrl+drag");
                }
                Some(towards) => {
                    ui.label(format!("{:.2} {:.2} {:.2}", towards.x, towards.y, towards.z));
                    if ui.small_button("reset").clicked() {
                        settings.towards_light = None;
                    }
                }
            });
            ui.end_row();
            ui.label("Up").on_hover_text("Many formats do not say which way is up");
            ui.horizontal(|ui| {
                ui.selectable_value(&mut up, UpAxis::Y, "y");
                ui.selectable_value(&mut up, UpAxis::Z, "z");
            });
            ui.end_row();
        });
        if up != self.up() {
            self.stand_up(up, now);
        }
    }

    fn budgets_section(&mut self, ui: &mut Ui) {
        let settings = &mut self.settings;
        Grid::new("budgets").num_columns(2).spacing([8.0, 5.0]).show(ui, |ui| {
            let label = ui
                .label("Smooth edges")
                .on_hover_text("Places at which each pixel is looked at, once all else is drawn");
            let slider = Slider::new(&mut settings.samples, 1..=gigalod_render::MOST_SAMPLES).logarithmic(true);
            ui.add(slider).labelled_by(label.id);
            ui.end_row();
            ui.label("Memory").on_hover_text("Most memory for decoded pages and lists");
            mebibytes(ui, &mut settings.cpu_budget);
            ui.end_row();
            ui.label("Device memory").on_hover_text("Most memory on the graphics device");
            ui.horizontal(|ui| {
                let mut is_limited = settings.gpu_budget.is_some();
                if ui.checkbox(&mut is_limited, "at most").changed() {
                    settings.gpu_budget = is_limited.then_some(1 << 30);
                }
                if let Some(budget) = &mut settings.gpu_budget {
                    mebibytes(ui, budget);
                }
            });
            ui.end_row();
        });
    }

    fn measure_section(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.toggle_value(&mut self.measuring.is_on, "Pick points (M)");
            if ui.button("Clear").clicked() {
                self.measuring.clear();
            }
        });
        let mut is_empty = true;
        for found in self.measuring.points() {
            is_empty = false;
            // A sign takes as much room as none.
            let sign = |x: f64| if x < 0.0 { "" } else { " " };
            let coordinate = |(name, x)| format!("{name} {}{}", sign(x), digits(x, found.uncertain));
            let point = ["x", "y", "z"].into_iter().zip(found.point.to_array()).map(coordinate);
            ui.label(egui::RichText::new(point.collect::<Vec<_>>().join("\n")).monospace());
        }
        if is_empty && self.measuring.is_on {
            ui.weak("Click two points of the surface.");
        }
        if let Some((distance, uncertain, to_come)) = self.measuring.distance() {
            ui.strong(format!("Distance {}", length(distance, uncertain, self.unit())));
            if to_come {
                ui.weak("reading the original");
            } else if uncertain > 0.0 {
                ui.weak("from the splats, as the original is not at hand");
            } else {
                ui.weak("exact, from the original");
            }
        }
    }

    fn path_section(&mut self, ui: &mut Ui, now: f64) {
        ui.horizontal(|ui| {
            let text = if self.recorder.is_recording() { "Stop (R)" } else { "Record (R)" };
            if ui.button(text).clicked() {
                self.toggle_recording(now);
            }
            let text = if self.recorder.is_playing() { "Stop playing" } else { "Play (Space)" };
            if ui.add_enabled(self.recorder.path().is_some(), egui::Button::new(text)).clicked() {
                self.toggle_playing(now);
            }
        });
        if let Some(path) = self.recorder.path() {
            let seconds =
                path.frames.last().map_or(0.0, |pose| pose.t) - path.frames.first().map_or(0.0, |pose| pose.t);
            ui.weak(format!("{} poses, {seconds:.1} s", path.frames.len()));
        }
    }

    fn save_section(&mut self, ui: &mut Ui, now: f64) {
        Grid::new("save").num_columns(2).spacing([8.0, 5.0]).show(ui, |ui| {
            let mut row = |text: &str, name: &mut String, is_enabled: bool| {
                let button = ui.add_enabled(is_enabled, egui::Button::new(text));
                ui.add(TextEdit::singleline(name).desired_width(180.0)).labelled_by(button.id);
                ui.end_row();
                button.clicked()
            };
            let picture = row("Picture (P)", &mut self.names.picture, !self.models.is_empty());
            let path = row("Path", &mut self.names.path, self.recorder.path().is_some());
            let scene = row("Scene", &mut self.names.scene, !self.models.is_empty());
            if picture {
                self.take_picture(now);
            }
            if path && let Some(path) = self.recorder.path() {
                self.jobs.write_path(PathBuf::from(&self.names.path), path.clone());
            }
            if scene {
                self.jobs.write_scene(PathBuf::from(&self.names.scene), self.scene());
            }
        });
    }

    /// What is shown, as a scene.
    pub(crate) fn scene(&self) -> SceneDescription {
        let at = self.own_viewpoint();
        let light = self.settings.towards_light.map(|towards| Light {
            kind: LightKind::Directional { towards },
            size: 0.0,
            color: [255; 3],
            intensity: 1.0,
        });
        let models = self.models.iter().flat_map(|Staged { model, .. }| {
            let one = |place: &gigalod_runtime::Similarity| SceneModel {
                file: model.source.clone(),
                places: Places::One(*place),
            };
            model.placements.iter().map(one).collect::<Vec<_>>()
        });
        SceneDescription {
            up: Some(self.up()),
            background: Some(self.settings.background),
            camera: Some(SceneCamera {
                eye: Some(at.eye),
                target: Some(at.target),
                up: Some(at.up),
                fov_deg: Some(at.fov_deg),
            }),
            ground: None,
            models: models.collect(),
            lights: light.into_iter().collect(),
        }
    }
}

fn section(ui: &mut Ui, name: &str, is_open: bool, contents: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(name).default_open(is_open).show(ui, contents);
}

fn mebibytes(ui: &mut Ui, bytes: &mut u64) {
    let mut mebibytes = *bytes >> 20;
    let value = DragValue::new(&mut mebibytes).range(16..=1 << 20).speed(8.0).suffix(" MiB");
    if ui.add(value).changed() {
        *bytes = mebibytes << 20;
    }
}

fn kernel_name(kernel: Kernel) -> &'static str {
    match kernel {
        Kernel::Square => "square",
        Kernel::Round => "round",
        Kernel::Gauss => "Gaussian",
        Kernel::SquareEllipse => "square, elliptical",
        Kernel::RoundEllipse => "round, elliptical",
        Kernel::GaussEllipse => "Gaussian, elliptical",
        _ => "another",
    }
}

/// With a thin space between thousands.
pub(crate) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

pub(crate) fn bytes(number: u64) -> String {
    match number {
        0..1024 => format!("{number} B"),
        1024..1_048_576 => format!("{:.1} KiB", number as f64 / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", number as f64 / 1_048_576.0),
        _ => format!("{:.2} GiB", number as f64 / 1_073_741_824.0),
    }
}
