//! Mouse and keys over the picture.

use crate::measure::length;
use crate::navigation::{Anchor, Input};
use crate::picker::Purpose;
use crate::viewer::{Viewer, ZoomToCome};
use egui::{Align2, Color32, CursorIcon, Event, FontId, Key, Modifiers, PointerButton, Pos2, Sense, Stroke, Ui};
use gigalod_geom::Camera;
use glam::{DQuat, DVec2, DVec3};
use std::time::Duration;

/// What is left of the distance after a notch of the wheel, 50 points of scrolling.
const ZOOM_PER_NOTCH: f64 = 0.8;
const POINTS_PER_NOTCH: f64 = 50.0;

/// Flight, in distances to the pivot a second.
const SPEED: f64 = 0.8;

/// With the shift key.
const FASTER: f64 = 4.0;

/// A surface point stays under the cursor as long as that moves no farther, in pixels.
const SAME_PLACE_PX: f64 = 6.0;

/// Seconds that a zoom waits for what is under the cursor.
const LONGEST_SEARCH: f64 = 0.3;

/// Marks of picked points that are known to the leaves' radius only, and of those that lie on the original.
const UNCERTAIN: Color32 = Color32::from_rgb(255, 170, 60);
const EXACT: Color32 = Color32::from_rgb(110, 220, 120);

/// Points that a button moves at least between going down and coming up in one frame, unless that is a click; as egui has it.
const LEAST_FLICK: f32 = 6.0;

/// Radians that the light turns for each point of a drag.
const LIGHT_PER_POINT: f64 = 0.005;

impl Viewer {
    /// Keys that work wherever the mouse is, unless something is being typed.
    pub(crate) fn keys(&mut self, ui: &Ui, now: f64) {
        // By the modifiers at the moment of the key: they may be up again by now.
        self.wants_new_device |= ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F5));
        self.wants_to_quit |= ui.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::Q));
        if ui.ctx().text_edit_focused() {
            return;
        }
        let pressed = |key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        if pressed(Key::Home) {
            self.steer(&Input::Home, now);
        }
        if pressed(Key::P) {
            self.take_picture(now);
        }
        if pressed(Key::R) {
            self.toggle_recording(now);
        }
        if pressed(Key::Space) {
            self.toggle_playing(now);
        }
        for (key, toggled) in [
            (Key::F1, &mut self.shows_help),
            (Key::F, &mut self.flies),
            (Key::F2, &mut self.shows_panel),
            (Key::M, &mut self.measuring.is_on),
        ] {
            *toggled ^= pressed(key);
        }
        // An open list is closed by it, and nothing else.
        let leaves = !egui::Popup::is_any_open(ui.ctx()) && pressed(Key::Escape);
        if leaves && self.folder.is_some() {
            self.folder = None;
        } else if leaves {
            (self.shows_help, self.measuring.is_on) = (false, false);
            self.measuring.clear();
        }
        self.fly(ui, now);
    }

    pub(crate) fn toggle_playing(&mut self, now: f64) {
        if self.recorder.is_playing() {
            self.steer(&Input::Orbit { by_px: DVec2::ZERO }, now);
        } else if self.recorder.path().is_some() {
            self.recorder.play(now);
        } else {
            self.notice("no camera path: record one, or drop a PATH.json here", now);
        }
    }

    /// Flight while its keys are down.
    fn fly(&mut self, ui: &Ui, now: f64) {
        let (by, seconds) = ui.input(|input| {
            let axis = |plus: Key, minus: Key| {
                f64::from(u8::from(input.key_down(plus))) - f64::from(u8::from(input.key_down(minus)))
            };
            let by = DVec3::new(axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S));
            let held = if input.modifiers.command { DVec3::ZERO } else { by };
            (held * if input.modifiers.shift { FASTER } else { 1.0 }, f64::from(input.stable_dt).min(0.1))
        });
        if by == DVec3::ZERO {
            self.ahead = None;
            return;
        }
        if by.z > 0.0 {
            let middle = DVec2::new(f64::from(self.size.width), f64::from(self.size.height)) * 0.5;
            self.pick(Purpose::Ahead, middle);
        }
        self.steer(&Input::Fly { by: by * (SPEED * seconds), ahead: self.ahead }, now);
        ui.request_repaint();
    }

    /// The picture's part of the window: drags, wheel, clicks.
    pub(crate) fn viewport(&mut self, ui: &mut Ui) {
        let frame = egui::CentralPanel::no_frame();
        frame.show(ui, |ui| {
            let rect = ui.max_rect();
            let response = ui.interact(rect, ui.scope_id().with("picture"), Sense::click_and_drag());
            self.mouse(ui, &response);
            self.draw_measurement(ui);
            if self.models.is_empty() || self.figures.frames == 0 {
                let [r, g, b] = self.settings.background;
                ui.painter().rect_filled(rect, 0.0, Color32::from_rgb(r, g, b));
                // Readable on whatever background.
                let is_dark = u32::from(r) + u32::from(g) + u32::from(b) < 384;
                let color = Color32::from_gray(if is_dark { 190 } else { 60 });
                let texts = [
                    ("Drop a model, a scene, a folder or a camera path here", 22.0, -16.0),
                    ("or choose one with Open…", 16.0, 16.0),
                ];
                let is_busy = !self.jobs.running().is_empty() || self.folder.is_some() || !self.models.is_empty();
                for (text, size, down) in texts.into_iter().filter(|_| !is_busy) {
                    let at = rect.center() + egui::vec2(0.0, down);
                    ui.painter().text(at, Align2::CENTER_CENTER, text, FontId::proportional(size), color);
                }
            }
        });
    }

    fn mouse(&mut self, ui: &Ui, response: &egui::Response) {
        let now = ui.input(|input| input.time);
        let scale = f64::from(ui.ctx().pixels_per_point());
        let px = |at: Pos2| DVec2::new(f64::from(at.x), f64::from(at.y)) * scale;
        let modifiers = ui.input(|input| input.modifiers);
        for button in [PointerButton::Primary, PointerButton::Secondary, PointerButton::Middle] {
            let drag = dragged(ui, response, button);
            let by_px = DVec2::new(f64::from(drag.x), f64::from(drag.y)) * scale;
            if drag == egui::Vec2::ZERO {
                continue;
            } else if modifiers.ctrl && button == PointerButton::Primary {
                self.drag_light(drag);
            } else if modifiers.shift || button != PointerButton::Primary {
                self.steer(&Input::Pan { by_px }, now);
            } else if self.flies {
                // The eye follows the hand, as a head that turns.
                self.steer(&Input::Look { by_px: -by_px }, now);
            } else {
                self.steer(&Input::Orbit { by_px }, now);
            }
        }
        if self.measuring.is_on && response.hovered() {
            ui.set_cursor_icon(CursorIcon::Crosshair);
        }
        // Where the button came up: where frames are long, the mouse is elsewhere at their end.
        let came_up = |event: &Event| match event {
            Event::PointerButton { pos, button: PointerButton::Primary, pressed: false, .. } => Some(*pos),
            _ => None,
        };
        let clicked_at = ui.input(|input| input.events.iter().rev().find_map(came_up));
        if let Some(at) = clicked_at.or(response.interact_pointer_pos()) {
            if response.double_clicked() && !self.measuring.is_on {
                self.pick(Purpose::Pivot, px(at));
            } else if response.clicked() && self.measuring.is_on {
                let number = self.measuring.begin();
                self.pick(Purpose::Measure(number), px(at));
            }
        }
        let wheel = ui.input(|input| f64::from(input.smooth_scroll_delta().y)) / POINTS_PER_NOTCH;
        let pinch = ui.input(|input| f64::from(input.zoom_delta()));
        let factor = ZOOM_PER_NOTCH.powf(wheel) / pinch;
        if let Some(at) = response.hover_pos().filter(|_| factor != 1.0) {
            self.zoom(px(at), factor, now);
        }
        // Who waits too long zooms towards what is as far away as the pivot.
        if let Some(ZoomToCome { factor, at_px, since }) = self.zoom_to_come {
            if now - since > LONGEST_SEARCH {
                self.zoom_to_come = None;
                self.steer(&Input::Zoom { factor, at_px, surface: None }, now);
            } else {
                ui.ctx().request_repaint_after(Duration::from_secs_f64(LONGEST_SEARCH));
            }
        }
    }

    /// Zooms towards what is under the cursor, once that is known.
    pub(crate) fn zoom(&mut self, at_px: DVec2, factor: f64, now: f64) {
        let camera = self.camera(&self.own_viewpoint());
        let is_there = |(place, surface): &(DVec2, Option<Anchor>)| {
            let at = |surface: &Anchor| camera.pixel_of_view_point(camera.view_point(surface.at));
            place.distance(at_px) <= SAME_PLACE_PX
                && surface.is_none_or(|surface| at(&surface).distance(at_px) <= SAME_PLACE_PX)
        };
        match self.under_cursor.filter(is_there) {
            Some((_, surface)) => {
                self.steer(&Input::Zoom { factor, at_px, surface }, now);
                if surface.is_none() {
                    // Something may come under the cursor.
                    self.pick(Purpose::Zoom, at_px);
                }
            }
            None => {
                let before = self.zoom_to_come.map_or(1.0, |before| before.factor);
                let since = self.zoom_to_come.map_or(now, |before| before.since);
                self.zoom_to_come = Some(ZoomToCome { factor: before * factor, at_px, since });
                self.pick(Purpose::Zoom, at_px);
            }
        }
    }

    /// Turns the light as if it hung on the hand.
    fn drag_light(&mut self, by: egui::Vec2) {
        let camera = self.camera(&self.own_viewpoint());
        let light = self.settings.towards_light.unwrap_or(camera.shoulder_light());
        let turn = DQuat::from_axis_angle(camera.up, f64::from(by.x) * LIGHT_PER_POINT)
            * DQuat::from_axis_angle(camera.right, f64::from(by.y) * LIGHT_PER_POINT);
        self.settings.towards_light = (turn * light).try_normalize();
    }

    /// Picked points, and the distance between them; those that are exact in another colour.
    fn draw_measurement(&mut self, ui: &Ui) {
        let now = ui.input(|input| input.time);
        let viewpoint = self.viewpoint(now);
        let camera = self.camera(&viewpoint);
        let scale = ui.ctx().pixels_per_point();
        let color = |uncertain| if uncertain > 0.0 { UNCERTAIN } else { EXACT };
        let places: Vec<(Pos2, Color32)> = self
            .measuring
            .points()
            .filter_map(|found| Some((place(&camera, found.point, scale)?, color(found.uncertain))))
            .collect();
        let painter = ui.painter();
        if let ([(a, _), (b, _)], Some((distance, uncertain, _))) = (&places[..], self.measuring.distance()) {
            painter.line_segment([*a, *b], Stroke::new(1.5, color(uncertain)));
            let middle = *a + (*b - *a) * 0.5;
            let text = length(distance, uncertain, self.unit());
            let font = FontId::proportional(15.0);
            let galley = painter.layout_no_wrap(text, font, Color32::WHITE);
            let at = egui::Rect::from_center_size(middle, galley.size());
            painter.rect_filled(at.expand(4.0), 4.0, Color32::from_black_alpha(190));
            painter.galley(at.min, galley, Color32::WHITE);
        }
        for (at, color) in places {
            painter.circle(at, 4.0, color, Stroke::new(1.0, Color32::BLACK));
        }
    }
}

/// How far a button has dragged the picture since the last frame, in points. Where frames are long it goes down and comes up within
/// one, or comes up on the way: what lies between counts, and nothing after it.
fn dragged(ui: &Ui, response: &egui::Response, button: PointerButton) -> egui::Vec2 {
    let was_dragged = response.dragged_by(button) || response.drag_stopped_by(button);
    let is_on_picture = |at: Pos2| {
        response.rect.contains(at) && ui.ctx().layer_id_at(at).is_none_or(|layer| layer == response.layer_id)
    };
    let is_told = |event: &&Event| match event {
        Event::PointerMoved(_) => true,
        Event::PointerButton { button: of, .. } => *of == button,
        _ => false,
    };
    let (events, before) = ui.input(|input| {
        let before = input.pointer.latest_pos().map(|at| at - input.pointer.delta());
        (input.events.iter().filter(is_told).cloned().collect::<Vec<_>>(), before)
    });
    // Unless it goes down in this frame, it has been down before.
    let turn = events.iter().find_map(|event| match event {
        Event::PointerButton { pressed, .. } => Some(*pressed),
        _ => None,
    });
    let (mut sum, mut is_flick) = (egui::Vec2::ZERO, false);
    let mut last = before.filter(|_| was_dragged && turn != Some(true));
    for event in events {
        match event {
            Event::PointerMoved(at) => {
                sum += last.map_or(egui::Vec2::ZERO, |last| at - last);
                last = last.map(|_| at);
            }
            Event::PointerButton { pos, pressed: false, .. } => {
                sum += last.map_or(egui::Vec2::ZERO, |last| pos - last);
                is_flick |= last.is_some() && sum.length() > LEAST_FLICK;
                last = None;
            }
            Event::PointerButton { pos, .. } => last = Some(pos).filter(|at| is_on_picture(*at)),
            _ => {}
        }
    }
    if was_dragged || is_flick { sum } else { egui::Vec2::ZERO }
}

/// Where a world-space point appears, in egui's points; `None` behind the eye.
fn place(camera: &Camera, point: DVec3, scale: f32) -> Option<Pos2> {
    let in_view = camera.view_point(point);
    let pixel = camera.pixel_of_view_point(in_view);
    (in_view.z > 0.0 && pixel.is_finite()).then(|| Pos2::new(pixel.x as f32 / scale, pixel.y as f32 / scale))
}
