//! Frame-rate control of machines that are made up.

use super::*;

/// A machine that takes `picture_ms` for a picture, and so much for each splat and each pixel that splats cover.
#[derive(Default)]
struct Machine {
    picture_ms: f64,
    splat_ms: f64,
    covered_ms: f64,
    noise: f64,
    frames: u32,
}

/// A view with `detail` splats at one pixel, none of which is smaller than `data_px`.
#[derive(Clone, Copy)]
struct View {
    detail: f64,
    data_px: f64,
}

/// What a frame was.
struct Shown {
    ms: f64,
    px: f32,
    edge_px: f64,
}

fn view(detail: f64) -> View {
    View { detail, data_px: 0.0 }
}

impl Machine {
    fn draw(&mut self, control: &mut FrameRate, view: View, moved: bool) -> Shown {
        let wanted = control.next(moved);
        let diameter = |px: f32| (f64::from(px) / 1.4).max(view.data_px);
        let splats = |px: f32| view.detail / (diameter(px) * 1.4).powi(2);
        let mut px = wanted.threshold_px;
        while splats(px) > wanted.most_splats as f64 {
            px *= 1.02;
        }
        let report =
            CutReport { drawn: splats(px) as u64, points: splats(px) as u64, threshold_px: px, ..CutReport::default() };
        let area_px = splats(px) * diameter(px).powi(2) * 0.785;
        let larger = control.most_edge_step > 0;
        // A quarter of what a splat costs is the cut's.
        let cut_ms = 0.25 * self.splat_ms * splats(px);
        let edge_px = if larger { control.pixel_edge_px(&report, cut_ms, area_px) } else { 1.0 };
        self.frames += 1;
        let noise = 1.0 + self.noise * f64::from(self.frames).sin();
        let for_pixels = (self.picture_ms + self.covered_ms * area_px) / (edge_px * edge_px);
        let ms = (for_pixels + self.splat_ms * splats(px)) * noise;
        control.drew(ms, &report, false);
        Shown { ms, px, edge_px }
    }
}

#[test]
fn it_holds_the_target_on_any_machine_and_through_a_sudden_turn() {
    for (picture_ms, splat_ms) in [(2.0, 1e-4), (30.0, 1e-4), (5.0, 4e-4), (60.0, 2e-5)] {
        let mut machine = Machine { picture_ms, splat_ms, noise: 0.03, ..Machine::default() };
        let mut control = FrameRate::new(100.0, 0.01);
        let mut late = 0;
        for frame in 0..300 {
            // Detail grows and shrinks slowly; from frame 150 on there is twenty times as much of it.
            let turn = if frame < 150 { 1.0 } else { 20.0 };
            let detail = 2e6 * turn * (1.0 + 0.5 * (f64::from(frame) * 0.05).sin());
            let ms = machine.draw(&mut control, view(detail), true).ms;
            let settled = frame > 20 && !(150..155).contains(&frame);
            assert!(!settled || (80.0..120.0).contains(&ms), "{ms} ms in frame {frame} of {picture_ms} + {splat_ms}");
            late += u32::from(ms > 120.0 && frame > 20);
        }
        assert_eq!(late, 0, "a sudden turn makes a coarse frame, not a late one");
    }
}

#[test]
fn from_a_cut_without_a_threshold_it_finds_back() {
    // A budget that not even the coarsest cut keeps to.
    let mut control = FrameRate::new(100.0, 1.0);
    let report = CutReport { drawn: 1, triangles: 300_000, threshold_px: f32::INFINITY, ..CutReport::default() };
    for _ in 0..5 {
        control.next(true);
        control.drew(30.0, &report, false);
        assert!(control.moving_px <= COARSEST_PX, "{control:?}");
    }
    let steps = (0..12).take_while(|_| control.next(false).threshold_px > 1.0).count();
    assert!(steps < 10, "{control:?}");
}

#[test]
fn what_turns_out_of_view_and_back_is_asked_for_as_it_was() {
    let mut machine = Machine { picture_ms: 5.0, splat_ms: 1e-4, ..Machine::default() };
    let mut control = FrameRate::new(100.0, 1.0);
    let before = (0..30).map(|_| machine.draw(&mut control, view(2e7), true).px).last().expect("frames");
    for frame in 0..50 {
        machine.draw(&mut control, view(0.0), frame % 3 > 0);
    }
    // Finer, and the cut of the whole would be in vain.
    assert_eq!(control.next(true).threshold_px, before);
}

#[test]
fn at_rest_the_threshold_only_falls_and_ends_at_the_finest() {
    let mut machine = Machine { picture_ms: 10.0, splat_ms: 1e-3, noise: 0.1, ..Machine::default() };
    let mut control = FrameRate::new(50.0, 1.0);
    for _ in 0..30 {
        machine.draw(&mut control, view(2e6), true);
    }
    let mut last = control.asked_px;
    assert!(last > 4.0, "{last}");
    let mut frames = 0;
    while !control.is_settled() {
        let px = machine.draw(&mut control, view(2e6), false).px;
        assert!(px < last || px == 1.0, "{px} after {last}");
        last = px;
        frames += 1;
    }
    assert!(last == 1.0 && frames < 15, "{last} px after {frames} frames");
    // And back at once to what the target affords.
    let ms = machine.draw(&mut control, view(2e6), true).ms;
    assert!((30.0..60.0).contains(&ms), "{ms}");
}

#[test]
fn a_machine_that_is_too_slow_is_not_given_ever_larger_splats() {
    let mut machine = Machine { picture_ms: 300.0, splat_ms: 1e-3, noise: 0.1, ..Machine::default() };
    let mut control = FrameRate::new(100.0, 1.0);
    for frame in 0..50 {
        let px = machine.draw(&mut control, view(1e7), true).px;
        // The first frames know nothing of the view.
        assert!(px <= COARSEST_PX * 1.03 || frame < 3, "{px} in frame {frame}");
    }
    machine.picture_ms = 10.0;
    let ms = (0..20).map(|_| machine.draw(&mut control, view(1e7), true).ms).last().unwrap();
    assert!((80.0..120.0).contains(&ms), "{ms}: a faster one recovers");
}

#[test]
fn what_is_still_being_loaded_is_waited_for() {
    let mut control = FrameRate::new(50.0, 1.0);
    for loading in [true, false] {
        (0..20).for_each(|_| assert!(control.next(false).threshold_px >= 1.0));
        control.drew(10.0, &CutReport::default(), loading);
        assert_eq!(control.is_settled(), !loading);
    }
}

#[test]
fn where_pixels_take_the_time_they_are_drawn_larger_and_a_sudden_turn_is_not_late() {
    // The last one is a machine that larger pixels cannot help, so that there are none.
    for (picture_ms, splat_ms, covered_ms) in [(40.0, 4e-5, 1e-5), (60.0, 1e-5, 2e-5), (5.0, 2e-4, 0.0)] {
        let mut machine = Machine { picture_ms, splat_ms, covered_ms, noise: 0.03, frames: 0 };
        let mut control = FrameRate::new(100.0, 1.0).with_larger_pixels();
        let mut widest_px = 1.0f64;
        for frame in 0..300 {
            // Close up: few splats, all as large as the data have them, covering each pixel thirty times.
            let close = frame >= 150;
            let wave = 1.0 + 0.3 * (f64::from(frame) * 0.05).sin();
            let seen = if close { View { detail: 4e7 * wave, data_px: 9.0 } } else { view(1e7 * wave) };
            let Shown { ms, edge_px, .. } = machine.draw(&mut control, seen, true);
            let what = || format!("{ms} ms in frame {frame} of {picture_ms} {splat_ms} {covered_ms}, {edge_px} px");
            let settled = frame > 20 && !(150..155).contains(&frame);
            let least_ms = if covered_ms == 0.0 && close { 0.0 } else { 80.0 };
            assert!(!settled || (least_ms..120.0).contains(&ms), "{}", what());
            assert!(ms < 125.0 || frame <= 20, "{}", what());
            widest_px = widest_px.max(if frame > 20 { edge_px } else { 1.0 });
        }
        assert!((widest_px > 1.3) == (covered_ms > 0.0), "{widest_px} for {covered_ms}");
        // Nothing stays large where there is time for more.
        let cheap = (0..20).map(|_| machine.draw(&mut control, view(1e3), true).edge_px).last().unwrap();
        assert!(cheap == 1.0, "{cheap}");
    }
}

#[test]
fn what_nothing_is_known_of_is_approached_step_by_step() {
    let mut machine = Machine { picture_ms: 20.0, splat_ms: 1e-4, covered_ms: 1e-5, noise: 0.0, frames: 0 };
    let mut control = FrameRate::new(100.0, 1.0).with_larger_pixels();
    // The first picture, whose splats are as large as what is loaded, is drawn with larger pixels; the next one tells what they cost.
    let edges = [(); 2].map(|()| machine.draw(&mut control, View { detail: 2e3, data_px: 30.0 }, true).edge_px);
    assert_eq!(edges, [2.0, 1.0]);
    // What turns into view after a few splats comes in cuts that are at most three times as large as the one before.
    let cuts: Vec<u64> = (0..6)
        .map(|_| {
            let most = control.next(true).most_splats;
            machine.draw(&mut control, view(5e7), true);
            most
        })
        .collect();
    assert!(cuts[0] <= FIRST_SPLATS && cuts.windows(2).all(|pair| pair[1] <= 3 * pair[0]), "{cuts:?}");
    assert!(cuts[5] > 3 * FIRST_SPLATS, "{cuts:?}");
}

#[test]
fn at_rest_pixels_are_those_of_the_screen() {
    let mut machine = Machine { picture_ms: 60.0, splat_ms: 4e-5, covered_ms: 1e-5, noise: 0.1, frames: 0 };
    let mut control = FrameRate::new(60.0, 1.0).with_larger_pixels();
    let seen = View { detail: 4e7, data_px: 3.0 };
    let moving = (0..30).map(|_| machine.draw(&mut control, seen, true)).last().unwrap();
    assert!(moving.edge_px > 1.3, "{}", moving.edge_px);
    let mut last_px = moving.px;
    for _ in 0..20 {
        let Shown { px, edge_px, .. } = machine.draw(&mut control, seen, false);
        assert!(edge_px == 1.0 && (px < last_px || px == 1.0), "{edge_px} {px}");
        last_px = px;
    }
    assert!(control.is_settled() && last_px == 1.0);
    // And back at once to what the target affords.
    let Shown { ms, edge_px, .. } = machine.draw(&mut control, seen, true);
    assert!((48.0..72.0).contains(&ms) && edge_px > 1.3, "{ms} {edge_px}");
}

#[test]
fn what_others_take_is_part_of_the_target_up_to_half_of_it() {
    for (others_ms, own_ms) in [(0.0, 100.0), (30.0, 70.0), (500.0, 50.0), (-5.0, 100.0)] {
        let mut machine = Machine { picture_ms: 5.0, splat_ms: 1e-4, ..Machine::default() };
        let mut control = FrameRate::new(100.0, 0.01);
        for frame in 0..60 {
            control.share(others_ms);
            let ms = machine.draw(&mut control, view(2e6), true).ms;
            assert!(frame < 20 || (0.8 * own_ms..1.2 * own_ms).contains(&ms), "{ms} of {own_ms} ms in frame {frame}");
        }
    }
}
