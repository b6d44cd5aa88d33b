//! Frame-rate control: how fine the next frame may be so that it takes the time it should.
//!
//! Goes in: how long each frame took and what it drew, and whether the camera moved. Comes out: a [`Fineness`] for the next.
//!
//! Source: the splats paper, section 2.1, adjusts the threshold by the ratio of actual to desired time. That feedback is kept,
//! with two changes. It acts on a count of splats that the target affords, by a cost model learned on the way, because the time
//! of a frame has a part that no threshold changes; and that count also bounds the next cut, so that a sudden turn towards
//! detail makes a coarse frame and not a late one (Funkhouser and Séquin's prediction, in one number).
//!
//! What always holds: while the camera moves, the threshold stays where it is as long as the time is near enough to the target;
//! while it rests, the threshold only falls, step by step, to the finest there is.

use crate::{CutReport, Fineness};

/// A ratio of two frame times that is no reason to change anything.
const DEAD_BAND: f64 = 0.06;

/// The next cut may have this many times the splats that the target affords, before it is made coarser at once.
const CUT_BOUND: f64 = 1.08;

/// A frame at rest has this much of the last one's threshold: half its area.
const REST_STEP: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Splats grow with the threshold's minus second power on a surface, as long as the data go on.
const SPLATS_EXPONENT: f64 = 2.0;

/// Threshold from which on coarser is not faster, in pixels: fewer splats, but as many pixels that they cover. The coarsest of the
/// splats paper's figure 1 are 15.
const COARSEST_PX: f32 = 16.0;

/// Threshold to begin with, in pixels: fast anywhere, and still a picture.
const FIRST_PX: f32 = 8.0;

/// Splats to begin with.
const FIRST_SPLATS: u64 = 100_000;

/// Splats that any frame may have: where so few take too long, it is not for their number, and a heap of discs would be no faster.
const LEAST_SPLATS: u64 = 10_000;

/// Holds a frame time while the camera moves; refines while it rests.
#[derive(Clone, Debug)]
pub struct FrameRate {
    target_ms: f64,
    finest_px: f32,
    cost: CostModel,
    /// Threshold while the camera moves.
    moving_px: f32,
    /// Threshold that the last frame was to have; while the camera moves, the one that it had.
    asked_px: f32,
    /// Splats of the last view at the coarsest threshold there is.
    coarsest_splats: u64,
    resting: bool,
    /// The last frame showed all there is at the finest threshold.
    settled: bool,
}

impl FrameRate {
    /// Frames of `target_ms` milliseconds, never finer than `finest_px` pixels (the paper: 1).
    pub fn new(target_ms: f64, finest_px: f32) -> Self {
        let first_px = finest_px.max(FIRST_PX);
        Self {
            target_ms,
            finest_px,
            cost: CostModel::default(),
            moving_px: first_px,
            asked_px: first_px,
            coarsest_splats: 1,
            resting: false,
            settled: false,
        }
    }

    /// How fine the next frame is to be; `moved` says whether it shows anything else than the last one did.
    pub fn next(&mut self, moved: bool) -> Fineness {
        self.resting = !moved;
        if self.resting {
            self.asked_px = (self.asked_px * REST_STEP).max(self.finest_px);
            return Fineness::px(self.asked_px);
        }
        let affordable = self.cost.splats_within(self.target_ms);
        let most_splats = affordable.map_or(FIRST_SPLATS, |splats| (splats * CUT_BOUND) as u64);
        Fineness { threshold_px: self.moving_px, most_splats: most_splats.max(self.coarsest_splats).max(LEAST_SPLATS) }
    }

    /// Takes note of a frame: how long it took from beginning to end, what it drew, and whether finer pages are on their way.
    pub fn drew(&mut self, frame_ms: f64, report: &CutReport, loading: bool) {
        self.cost.learn(report.drawn as f64, frame_ms);
        // Where a budget does not allow the finest, this is as fine as it gets.
        self.settled = self.resting && self.asked_px <= self.finest_px && !loading;
        if self.resting {
            return;
        }
        let coarsest_px = self.finest_px.max(COARSEST_PX);
        let splats_at = |px: f32| report.drawn as f64 * f64::from(report.threshold_px / px).powf(SPLATS_EXPONENT);
        self.coarsest_splats = (splats_at(coarsest_px) as u64).max(1);
        (self.moving_px, self.asked_px) = (report.threshold_px, report.threshold_px);
        let Some(affordable) = self.cost.splats_within(self.target_ms) else { return };
        if (frame_ms / self.target_ms - 1.0).abs() <= DEAD_BAND {
            return;
        }
        let surplus = report.drawn.max(1) as f64 / affordable.max(1.0);
        // A step is at most an octave: beyond that the count says little.
        let step = surplus.powf(1.0 / SPLATS_EXPONENT).clamp(0.5, 2.0);
        self.moving_px = (report.threshold_px * step as f32).clamp(self.finest_px, coarsest_px);
    }

    /// True when drawing again would draw the same.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// Milliseconds a frame that it aims at.
    pub fn target_ms(&self) -> f64 {
        self.target_ms
    }
}

/// Time of a frame as fixed + a splat's × splats: a line through the last frames, older ones counting ever less.
#[derive(Clone, Copy, Debug, Default)]
struct CostModel {
    weight: f64,
    splats: f64,
    ms: f64,
    splats_squared: f64,
    splats_ms: f64,
    /// The slope is kept while all frames are alike, which says nothing about it.
    splat_ms: f64,
    samples: u32,
}

impl CostModel {
    /// What a frame counts one frame later.
    const MEMORY: f64 = 0.85;
    /// Spread of splats, as a part of their mean, from which frames differ enough to tell a slope.
    const SPREAD: f64 = 0.1;

    fn learn(&mut self, splats: f64, ms: f64) {
        self.samples += 1;
        // The first frame compiles pipelines and fills caches.
        if self.samples == 1 || !ms.is_finite() || ms <= 0.0 {
            return;
        }
        // Errors are a part of the time, so a frame that took ten times as long says as much about each of its splats, and a
        // hundred times less about milliseconds.
        let weight = 1.0 / (ms * ms);
        for (sum, value) in [
            (&mut self.weight, 1.0),
            (&mut self.splats, splats),
            (&mut self.ms, ms),
            (&mut self.splats_squared, splats * splats),
            (&mut self.splats_ms, splats * ms),
        ] {
            *sum = *sum * Self::MEMORY + weight * value;
        }
        let (mean_splats, mean_ms) = (self.splats / self.weight, self.ms / self.weight);
        let variance = self.splats_squared / self.weight - mean_splats * mean_splats;
        let most = mean_ms / mean_splats.max(1.0);
        if variance > (Self::SPREAD * mean_splats).powi(2) {
            self.splat_ms = (self.splats_ms / self.weight - mean_splats * mean_ms) / variance;
        } else if self.splat_ms == 0.0 {
            self.splat_ms = most;
        }
        // A tenth of the time at least is the splats', and not more than all of it.
        self.splat_ms = self.splat_ms.clamp(0.1 * most, most);
    }

    /// Number of splats that a frame of `ms` milliseconds affords; `None` as long as nothing is known.
    fn splats_within(&self, ms: f64) -> Option<f64> {
        if self.weight == 0.0 {
            return None;
        }
        let fixed = self.ms / self.weight - self.splat_ms * self.splats / self.weight;
        // Where the fixed part alone takes too long, a few splats make it no worse.
        Some(((ms - fixed) / self.splat_ms).max(1000.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine that takes `fixed_ms`, and for each splat `splat_ms`; and a view with `detail` splats at one pixel.
    struct Machine {
        fixed_ms: f64,
        splat_ms: f64,
        noise: f64,
        frames: u32,
    }

    impl Machine {
        fn draw(&mut self, control: &mut FrameRate, detail: f64, moved: bool) -> (f64, f32) {
            let wanted = control.next(moved);
            let splats = |px: f32| detail / f64::from(px).powi(2);
            let mut px = wanted.threshold_px;
            while splats(px) > wanted.most_splats as f64 {
                px *= 1.02;
            }
            self.frames += 1;
            let noise = 1.0 + self.noise * f64::from(self.frames).sin();
            let ms = (self.fixed_ms + self.splat_ms * splats(px)) * noise;
            let report = CutReport { drawn: splats(px) as u64, threshold_px: px, ..CutReport::default() };
            control.drew(ms, &report, false);
            (ms, px)
        }
    }

    #[test]
    fn it_holds_the_target_on_any_machine_and_through_a_sudden_turn() {
        for (fixed_ms, splat_ms) in [(2.0, 1e-4), (30.0, 1e-4), (5.0, 4e-4), (60.0, 2e-5)] {
            let mut machine = Machine { fixed_ms, splat_ms, noise: 0.03, frames: 0 };
            let mut control = FrameRate::new(100.0, 0.01);
            let mut late = 0;
            for frame in 0..300 {
                // Detail grows and shrinks slowly; from frame 150 on there is twenty times as much of it.
                let turn = if frame < 150 { 1.0 } else { 20.0 };
                let detail = 2e6 * turn * (1.0 + 0.5 * (f64::from(frame) * 0.05).sin());
                let (ms, _) = machine.draw(&mut control, detail, true);
                let settled = frame > 20 && !(150..153).contains(&frame);
                assert!(!settled || (80.0..120.0).contains(&ms), "{ms} ms in frame {frame} of {fixed_ms} + {splat_ms}");
                late += u32::from(ms > 120.0 && frame > 20);
            }
            assert_eq!(late, 0, "a sudden turn makes a coarse frame, not a late one");
        }
    }

    #[test]
    fn at_rest_the_threshold_only_falls_and_ends_at_the_finest() {
        let mut machine = Machine { fixed_ms: 10.0, splat_ms: 1e-3, noise: 0.1, frames: 0 };
        let mut control = FrameRate::new(50.0, 1.0);
        for _ in 0..30 {
            machine.draw(&mut control, 2e6, true);
        }
        let mut last = control.asked_px;
        assert!(last > 4.0, "{last}");
        let mut frames = 0;
        while !control.is_settled() {
            let (_, px) = machine.draw(&mut control, 2e6, false);
            assert!(px < last || px == 1.0, "{px} after {last}");
            last = px;
            frames += 1;
        }
        assert!(last == 1.0 && frames < 15, "{last} px after {frames} frames");
        // And back at once to what the target affords.
        let (ms, _) = machine.draw(&mut control, 2e6, true);
        assert!((30.0..60.0).contains(&ms), "{ms}");
    }

    #[test]
    fn a_machine_that_is_too_slow_is_not_given_ever_larger_splats() {
        let mut machine = Machine { fixed_ms: 300.0, splat_ms: 1e-3, noise: 0.1, frames: 0 };
        let mut control = FrameRate::new(100.0, 1.0);
        for frame in 0..50 {
            let (_, px) = machine.draw(&mut control, 1e7, true);
            // The first frames know nothing of the view.
            assert!(px <= COARSEST_PX * 1.03 || frame < 3, "{px} in frame {frame}");
        }
        machine.fixed_ms = 10.0;
        let ms = (0..20).map(|_| machine.draw(&mut control, 1e7, true).0).last().unwrap();
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
    fn frames_that_are_all_alike_keep_what_was_learned() {
        let mut cost = CostModel::default();
        for splats in [1e5, 1e5, 2e5, 4e5, 8e5] {
            cost.learn(splats, 20.0 + splats * 1e-4);
        }
        for _ in 0..500 {
            cost.learn(5e5, 70.0);
        }
        let affordable = cost.splats_within(100.0).unwrap();
        assert!((affordable / 8e5 - 1.0).abs() < 0.02, "{affordable}");
    }
}
