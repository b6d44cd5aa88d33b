//! Frame-rate control: how fine the next frame may be so that it takes the time it should.
//!
//! Goes in: how long each frame took and what it drew, and whether the camera moved. Comes out: a [`Fineness`] for the next cut,
//! and, once the cut is made, how large its pixels are drawn.
//!
//! Source: the splats paper, section 2.1, adjusts the threshold by the ratio of actual to desired time. That feedback is kept,
//! with three changes. It acts through a cost model that is learned on the way (`cost`), because the time of a frame has parts that
//! no threshold changes. The number of splats that the target affords also bounds the next cut, so that a sudden turn towards
//! detail makes a coarse frame and not a late one (Funkhouser and Séquin's prediction, in one number). And larger splats cover as
//! many pixels as the small ones that they stand for: where pixels are what takes the time, they are drawn larger
//! ([`crate::Magnified`]). Of all pairs of a threshold and a size of pixels that are in time, the one with the smallest error on screen is
//! taken.
//!
//! What always holds: while the camera moves, nothing changes as long as the time is near enough to the target and the error near
//! enough to the smallest; while it rests, pixels are those of the screen and the threshold only falls, step by step, to the finest
//! there is.

mod cost;

use crate::{CutReport, Fineness};
use cost::{CostModel, Work};

/// A ratio of two frame times that is no reason to change anything.
const DEAD_BAND: f64 = 0.06;

/// Error on screen over the smallest that is to be had which is no reason to change anything.
const GOOD_ENOUGH: f64 = 1.25;

/// The next cut may have this many times the splats that the target affords, before it is made coarser at once.
const CUT_BOUND: f64 = 1.08;

/// No cut has more than so many times the splats of the one before, or [`FIRST_SPLATS`]: what has just turned into view has to be searched for
/// a threshold first, which takes longer than the cut.
const CUT_GROWTH: f64 = 3.0;

/// Pixels are drawn larger where a frame would take more than so many times the target, and smaller where it would take less than
/// so many.
const EDGE_BAND: [f64; 2] = [0.86, 1.08];

/// A frame at rest has this much of the last one's threshold: half its area.
const REST_STEP: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Or as fine as takes so many times the target, if that is finer: steps that nobody sees are left out.
const REST_TARGETS: f64 = 2.0;

/// Splats grow with the threshold's minus second power on a surface, as long as the data go on.
const SPLATS_EXPONENT: f64 = 2.0;

/// Threshold over the diameter of the splats of a cut at that threshold, in the mean of their areas, as long as the data go on.
const THRESHOLD_TO_DIAMETER: f64 = 1.4;

/// Threshold from which on coarser is not faster, in pixels: fewer splats, but as many pixels that they cover. The coarsest of the
/// splats paper's figure 1 are 15.
const COARSEST_PX: f32 = 16.0;

/// Threshold to begin with, in pixels: fast anywhere, and still a picture.
const FIRST_PX: f32 = 8.0;

/// Splats to begin with.
const FIRST_SPLATS: u64 = 100_000;

/// Pixels of the first picture, two of the screen wide: where little is loaded its splats are large, and nothing is known of what that
/// costs.
const FIRST_EDGE_STEP: u32 = 8;

/// Splats that any frame may have: where so few take too long, it is not for their number, and a heap of discs would be no faster.
const LEAST_SPLATS: u64 = 10_000;

/// Splats from which on a cut tells what one costs.
const USUAL_SPLATS: f64 = 1e5;

/// Weight of the last cut in what is known of them.
const CUT_GAIN: f64 = 0.25;

/// Edges of pixels to choose from: eighths of an octave, up to two of them, so that a step changes the number of pixels by a fifth.
const EDGE_STEPS: u32 = 16;

/// Pixels of the screen that a drawn pixel is wide.
fn edge_px(step: u32) -> f64 {
    (f64::from(step) / 8.0).exp2()
}

/// How far from a pixel what it shows was drawn, about: [`crate::Magnified::shift_px`].
fn shift_px(step: u32) -> f64 {
    if step == 0 { 0.0 } else { edge_px(step) * std::f64::consts::FRAC_1_SQRT_2 }
}

/// Holds a frame time while the camera moves; refines while it rests.
#[derive(Clone, Debug)]
pub struct FrameRate {
    target_ms: f64,
    /// What is left of that for cutting and drawing.
    own_ms: f64,
    finest_px: f32,
    /// The largest pixels there may be.
    most_edge_step: u32,
    /// What drawing costs.
    cost: CostModel,
    /// What the cut costs, for each splat that it draws.
    cut_splat_ms: f64,
    /// Threshold while the camera moves.
    moving_px: f32,
    /// Splats that the next cut may have.
    most_splats: u64,
    /// Threshold that the last frame was to have; while the camera moves, the one that it had.
    asked_px: f32,
    /// Pixels of the last frame while the camera moves.
    edge_step: u32,
    /// How long the cut of the frame that is being made took, and how many pixels it covers, as far as is known.
    cut_ms: f64,
    area_px: Option<f64>,
    /// Threshold, splats and the pixels that they cover of the last frame that showed something.
    shown: Option<[f64; 3]>,
    resting: bool,
    /// The last frame showed all there is at the finest threshold.
    settled: bool,
}

/// A way to draw what the last frame drew.
struct Plan {
    threshold_px: f64,
    splats: f64,
    /// On screen; more, where it takes too long.
    error_px: f64,
}

impl FrameRate {
    /// Frames of `target_ms` milliseconds, never finer than `finest_px` pixels (the paper: 1).
    pub fn new(target_ms: f64, finest_px: f32) -> Self {
        let first_px = finest_px.max(FIRST_PX);
        Self {
            target_ms,
            own_ms: target_ms,
            finest_px,
            most_edge_step: 0,
            cost: CostModel::default(),
            cut_splat_ms: 0.0,
            moving_px: first_px,
            most_splats: FIRST_SPLATS,
            asked_px: first_px,
            edge_step: 0,
            cut_ms: 0.0,
            area_px: None,
            shown: None,
            resting: false,
            settled: false,
        }
    }

    /// Pixels may be drawn larger while the camera moves: up to four times as wide. Then [`FrameRate::pixel_edge_px`] says for each
    /// frame how large.
    pub fn with_larger_pixels(mut self) -> Self {
        self.most_edge_step = EDGE_STEPS;
        self
    }

    /// How fine the next frame is to be; `moved` says whether it shows anything else than the last one did.
    pub fn next(&mut self, moved: bool) -> Fineness {
        self.resting = !moved;
        (self.cut_ms, self.area_px) = (0.0, None);
        if self.resting {
            self.asked_px = (self.asked_px * REST_STEP).min(self.soon_px()).max(self.finest_px);
            return Fineness::px(self.asked_px);
        }
        Fineness { threshold_px: self.moving_px, most_splats: self.most_splats, wanted_px: self.finest_px }
    }

    /// How many pixels of the screen a drawn pixel of this frame is to be wide, at least 1: for [`crate::Magnified::new`]. The cut has
    /// been made and took `cut_ms` milliseconds; its splats cover `area_px` pixels of the screen, each by itself
    /// ([`crate::Scene::area_px`]). Always 1 at rest, and without [`FrameRate::with_larger_pixels`].
    pub fn pixel_edge_px(&mut self, report: &CutReport, cut_ms: f64, area_px: f64) -> f64 {
        (self.cut_ms, self.area_px) = (cut_ms, Some(area_px));
        if self.resting {
            return 1.0;
        }
        if !self.cost.is_known() {
            self.edge_step = if self.shown.is_none() { FIRST_EDGE_STEP.min(self.most_edge_step) } else { 0 };
            return edge_px(self.edge_step);
        }
        let work = |step: u32| Work::new(report.primitives() as f64, area_px, edge_px(step));
        let time = |step: u32| (cut_ms + self.cost.ms(&work(step))) / self.own_ms;
        let now = time(self.edge_step);
        if !(EDGE_BAND[0]..=EDGE_BAND[1]).contains(&now) {
            let in_time = (0..self.most_edge_step).find(|step| time(*step) <= 1.0);
            self.edge_step = in_time.unwrap_or(self.most_edge_step);
        }
        edge_px(self.edge_step)
    }

    /// From now on `others_ms` milliseconds of a frame's time go to others, to a window that is painted for example. Half of the time
    /// stays in any case: beyond that, fewer splats cost more than they gain.
    pub fn share(&mut self, others_ms: f64) {
        self.own_ms = self.target_ms - others_ms.clamp(0.0, self.target_ms / 2.0);
    }

    /// Takes note of a frame: how long it took from beginning to end, what it drew, and whether finer pages are on their way.
    pub fn drew(&mut self, frame_ms: f64, report: &CutReport, loading: bool) {
        let splats = report.primitives() as f64;
        // Where even the coarsest is too much, or the eye is amid a model, a budget makes it infinite, from where nothing gets finer.
        let was_px = if report.threshold_px.is_finite() { report.threshold_px } else { self.coarsest_px() };
        let threshold_px = f64::from(was_px);
        let usual_px = threshold_px / THRESHOLD_TO_DIAMETER;
        let area_px = self.area_px.unwrap_or(splats * usual_px * usual_px * std::f64::consts::FRAC_PI_4);
        let edge_step = if self.resting { 0 } else { self.edge_step };
        // Where a budget does not allow the finest, this is as fine as it gets.
        self.settled = self.resting && self.asked_px <= self.finest_px && !loading;
        // An empty picture is drawn by other means, and what turns into view after it is not known to be little.
        if report.drawn == 0 {
            return;
        }
        self.cost.learn(&Work::new(splats, area_px, edge_px(edge_step)), frame_ms - self.cut_ms);
        let cut_splat_ms = self.cut_ms / splats.max(USUAL_SPLATS);
        self.cut_splat_ms += CUT_GAIN * (cut_splat_ms - self.cut_splat_ms);
        self.shown = Some([threshold_px, splats, area_px]);
        if self.resting {
            return;
        }
        (self.moving_px, self.asked_px) = (was_px, was_px);
        if !self.cost.is_known() {
            return;
        }
        let plans = || (0..=self.most_edge_step).map(|step| self.plan(step, splats, threshold_px, area_px));
        let best = plans().min_by(|a, b| a.error_px.total_cmp(&b.error_px)).expect("there is one");
        let error_px = threshold_px + shift_px(self.edge_step);
        let in_time = (frame_ms / self.own_ms - 1.0).abs() <= DEAD_BAND;
        // So coarse that nothing is gained by more of it.
        let coarsest_splats = splats * (threshold_px / f64::from(self.coarsest_px())).powf(SPLATS_EXPONENT);
        let affordable =
            (best.splats * CUT_BOUND).max(coarsest_splats).min((splats * CUT_GROWTH).max(FIRST_SPLATS as f64));
        self.most_splats = (affordable as u64).max(LEAST_SPLATS);
        if in_time && error_px <= best.error_px * GOOD_ENOUGH {
            return;
        }
        // A step is at most an octave: beyond that the count says little.
        let step = (best.threshold_px / threshold_px.max(1e-6)).clamp(0.5, 2.0);
        self.moving_px = (was_px * step as f32).clamp(self.finest_px, self.coarsest_px());
    }

    /// The threshold at which what the last frame showed is still drawn soon; infinite where nothing is known.
    fn soon_px(&self) -> f32 {
        let Some([threshold_px, splats, area_px]) = self.shown.filter(|_| self.cost.is_known()) else {
            return f32::INFINITY;
        };
        let left_ms = REST_TARGETS * self.own_ms - self.cost.ms(&Work::new(0.0, area_px, 1.0));
        let affordable = left_ms / (self.cost.splat_ms() + self.cut_splat_ms);
        if affordable <= 0.0 {
            return f32::INFINITY;
        }
        (threshold_px * (splats / affordable).powf(1.0 / SPLATS_EXPONENT)) as f32
    }

    fn coarsest_px(&self) -> f32 {
        self.finest_px.max(COARSEST_PX)
    }

    /// What the target affords with pixels of some size, if it shows what the last frame showed.
    fn plan(&self, edge_step: u32, splats: f64, threshold_px: f64, area_px: f64) -> Plan {
        let covering_ms = self.cost.ms(&Work::new(0.0, area_px, edge_px(edge_step)));
        // Where the pixels alone take too long, a few splats make it no worse.
        let affordable = ((self.own_ms - covering_ms) / (self.cost.splat_ms() + self.cut_splat_ms)).max(1000.0);
        let ratio = (splats.max(1.0) / affordable).powf(1.0 / SPLATS_EXPONENT);
        // Where the data are coarser than the threshold, only one that is coarser than the data changes anything.
        let data_px = (area_px / splats.max(1.0) / std::f64::consts::FRAC_PI_4).sqrt() * THRESHOLD_TO_DIAMETER;
        let from_px = if ratio > 1.0 { threshold_px.max(data_px) } else { threshold_px };
        let [finest_px, coarsest_px] = [self.finest_px, self.coarsest_px()].map(f64::from);
        let threshold_px = (from_px * ratio).clamp(finest_px, coarsest_px);
        let late = (covering_ms / self.own_ms).max(1.0);
        Plan { threshold_px, splats: affordable, error_px: (threshold_px + shift_px(edge_step)) * late * late }
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

#[cfg(test)]
mod tests;
