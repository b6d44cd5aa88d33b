//! What is going on, in figures: how fine the picture is, what it took to draw, how long frames take.

use super::{bytes, count};
use crate::viewer::Viewer;
use egui::{CollapsingHeader, Color32, Grid, Sense, Stroke, Ui, vec2};
use gigalod_runtime::Limit;

impl Viewer {
    /// How fine the picture is, in words, and whether that is all there is.
    fn fineness(&self) -> (&'static str, bool) {
        let figures = &self.figures;
        if self.models.is_empty() {
            return ("nothing to show yet", false);
        }
        if self.models.iter().any(|staged| staged.preview.is_some()) {
            return ("a preview: its error is not known", false);
        }
        match (figures.report.limited_by, figures.settled) {
            _ if figures.frames == 0 => ("the first picture is being drawn", false),
            (Some(Limit::Residency), false) => ("being loaded", false),
            (_, false) => ("being refined", false),
            (_, true) if !figures.finished => ("as fine as it gets, edges are being smoothed", false),
            (None, true) => ("as fine as asked for", true),
            (Some(Limit::Data), true) => ("as fine as the data are", true),
            (Some(Limit::Residency), true) => ("as fine as its memory allows", true),
            (Some(Limit::Budget), true) => ("as fine as a budget allows", true),
        }
    }

    pub(super) fn figures_section(&mut self, ui: &mut Ui) {
        let (words, is_done) = self.fineness();
        let color = if is_done { Color32::from_rgb(130, 200, 140) } else { Color32::from_rgb(220, 190, 110) };
        ui.colored_label(color, words);
        if self.models.is_empty() || self.figures.frames == 0 {
            return;
        }
        self.plot(ui);
        let figures = &self.figures;
        let report = &figures.report;
        let largest = match report.max_error_px {
            px if px.is_finite() => format!("{px:.2} px"),
            _ => "around the eye".to_string(),
        };
        let rows = |ui: &mut Ui, name: &str, rows: &[(&str, &str, String)]| {
            Grid::new(name).num_columns(2).spacing([8.0, 2.0]).show(ui, |ui| {
                for (name, explained, value) in rows {
                    ui.label(*name).on_hover_text(*explained);
                    ui.monospace(value);
                    ui.end_row();
                }
            });
        };
        let explained = "No point of the surface is drawn farther off than this: the diameter of the largest splat. Where the \
                         data end, as close up, it is larger than asked for";
        let mut main = match report.triangles {
            0 => {
                let typical = format!("{:.2} px", figures.typical_px);
                vec![
                    ("largest splat", explained, largest),
                    ("typical splat", "Half of the splats are no larger than this", typical),
                    ("splats drawn", "Of all that there are", count(report.points)),
                ]
            }
            triangles => vec![
                ("largest error", "No point of the surface is drawn farther off than this", largest),
                ("triangles drawn", "Of all levels of detail", count(triangles)),
                ("points drawn", "For triangles smaller than a pixel, and splats", count(report.points)),
            ],
        };
        main.extend([
            ("frame", "Choosing what to draw, and drawing it", format!("{:.0} ms", figures.frame_ms)),
            ("read", "From the file, so far", bytes(figures.bytes_read)),
        ]);
        rows(ui, "figures", &main);
        let more = [
            ("threshold", "Error that the last frame was cut at", format!("{:.2} px", report.threshold_px)),
            ("pixels", "Of the screen, that a drawn one is wide", format!("{:.2} px wide", figures.pixel_edge_px)),
            ("to select", "Part of the frame's time", format!("{:.1} ms", figures.select_ms)),
            ("nodes visited", "By that choice", count(report.visited)),
            ("page misses", "Pages that would have made it finer and were not there", count(figures.misses)),
            ("pages resident", "Decoded", bytes(figures.resident_bytes)),
            ("memory", "Pages and lists", bytes(figures.cpu_bytes)),
            ("device memory", "Buffers and targets", bytes(figures.gpu_bytes)),
            ("picture", "Physical pixels", format!("{}x{}", self.size.width, self.size.height)),
        ];
        CollapsingHeader::new("more").id_salt("more figures").show(ui, |ui| {
            rows(ui, "more", &more);
            ui.add(egui::Label::new(egui::RichText::new(&self.adapter).weak()).truncate());
        });
    }

    /// Times of the last frames, with the one aimed at.
    fn plot(&self, ui: &mut Ui) {
        let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 56.0), Sense::hover());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
        let target = self.settings.target_ms as f32;
        let most = self.frame_times.iter().copied().fold(target * 1.5, f32::max);
        let y = |ms: f32| rect.bottom() - rect.height() * (ms / most).min(1.0);
        let width = rect.width() / 200.0;
        for (at, ms) in self.frame_times.iter().enumerate() {
            let left = rect.left() + at as f32 * width;
            let color =
                if *ms > target * 1.5 { Color32::from_rgb(230, 140, 70) } else { Color32::from_rgb(110, 170, 230) };
            let bar = egui::Rect::from_min_max(egui::pos2(left, y(*ms)), egui::pos2(left + width, rect.bottom()));
            painter.rect_filled(bar, 0.0, color);
        }
        painter.hline(rect.x_range(), y(target), Stroke::new(1.0, ui.visuals().weak_text_color()));
        let label = format!("{most:.0} ms");
        let font = egui::FontId::proportional(10.0);
        let galley = painter.layout_no_wrap(label, font, ui.visuals().text_color());
        let at = egui::Rect::from_min_size(rect.left_top() + vec2(3.0, 2.0), galley.size());
        painter.rect_filled(at.expand(2.0), 2.0, ui.visuals().extreme_bg_color);
        painter.galley(at.min, galley, ui.visuals().text_color());
    }
}
