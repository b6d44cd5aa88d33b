//! What a frame costs: milliseconds for each pixel, each splat, and each pixel that splats cover, learned on the way.
//!
//! Goes in: what frames drew and how long they took. Comes out: how long another would take. What always holds: no cost is
//! negative, and none is so small that it could not grow again.
//!
//! Frames of a moving camera are much alike, so most of the time they say nothing about what belongs to what. Hence a Kalman
//! filter on three costs that drift: a surprise is put down to what is least certain, and what alike frames leave open is kept.

/// What a frame draws, as far as it costs time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Work {
    /// Pixels, as a part of the whole picture's.
    pub(super) pixels: f64,
    /// Number of splats.
    pub(super) splats: f64,
    /// Drawn pixels that they cover, each by itself.
    covered: f64,
}

impl Work {
    /// A frame of `splats` splats that cover `area_px` pixels of the screen, each by itself, drawn with pixels that are
    /// `edge_px` pixels of the screen wide.
    pub(super) fn new(splats: f64, area_px: f64, edge_px: f64) -> Self {
        let pixels = 1.0 / (edge_px * edge_px);
        Self { pixels, splats, covered: area_px * pixels }
    }

    fn features(&self) -> [f64; 3] {
        [self.pixels, self.splats, self.covered]
    }
}

/// Milliseconds of a frame as a sum over its work.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CostModel {
    /// Of a whole picture, a splat, and a covered pixel.
    ms: [f64; 3],
    covariance: [[f64; 3]; 3],
    samples: u32,
}

/// What each cost is taken to be a part of at first.
const FIRST_SHARES: [f64; 3] = [0.3, 0.35, 0.35];
/// Work of a usual frame. Of one with less the work it says nothing about what a piece of it costs.
const USUAL: [f64; 3] = [0.1, 3e5, 1e6];
/// Standard deviation of a frame's time, as a part of it.
const NOISE: f64 = 0.06;
/// By how much a cost changes from frame to frame, as a part of it; and as a part of a surprise.
const DRIFT: f64 = 0.04;
const SURPRISE_DRIFT: f64 = 0.3;
/// No cost is more uncertain than so many times itself, or what it was taken to be at first.
const MOST_UNCERTAIN: f64 = 1.0;
/// A cost makes up this much of a frame at least, for its work or the usual.
const LEAST_SHARE: f64 = 0.02;
/// A frame that took more than so many times what was expected tells no more than that.
const MOST_SURPRISE: f64 = 2.5;

impl CostModel {
    /// False as long as nothing has been learned.
    pub(super) fn is_known(&self) -> bool {
        self.samples > 1
    }

    /// How long a frame takes; 0 as long as nothing is known.
    pub(super) fn ms(&self, work: &Work) -> f64 {
        std::iter::zip(self.ms, work.features()).map(|(ms, amount)| ms * amount).sum()
    }

    /// What a splat costs, besides the pixels that it covers.
    pub(super) fn splat_ms(&self) -> f64 {
        self.ms[1]
    }

    /// Takes note of a frame. The first one is not counted: it compiles pipelines and fills caches.
    pub(super) fn learn(&mut self, work: &Work, frame_ms: f64) {
        if !frame_ms.is_finite() || frame_ms <= 0.0 {
            return;
        }
        self.samples = self.samples.saturating_add(1);
        let amounts = work.features();
        match self.samples {
            1 => return,
            2 => return self.begin(amounts, frame_ms),
            _ => {}
        }
        let expected = self.ms(work);
        let measured = frame_ms.clamp(expected / MOST_SURPRISE, expected * MOST_SURPRISE);
        // What surprises has changed more than usual.
        let drift = DRIFT.max(SURPRISE_DRIFT * (measured / expected - 1.0).abs());
        for at in 0..3 {
            let about = self.ms[at].max(FIRST_SHARES[at] * measured / amounts[at].max(USUAL[at]));
            self.covariance[at][at] += (drift * about).powi(2);
            self.bound_uncertainty(at, MOST_UNCERTAIN * about);
        }
        let along = self.covariance.map(|row| std::iter::zip(row, amounts).map(|(a, b)| a * b).sum::<f64>());
        let spread: f64 = std::iter::zip(along, amounts).map(|(a, b)| a * b).sum();
        let spread = spread + (NOISE * expected).powi(2);
        if spread <= 0.0 {
            return;
        }
        let gain = along.map(|value| value / spread);
        for (row, gain) in gain.into_iter().enumerate() {
            self.ms[row] += gain * (measured - expected);
            for (covariance, along) in std::iter::zip(&mut self.covariance[row], along) {
                *covariance -= gain * along;
            }
        }
        for at in 0..3 {
            self.ms[at] = self.ms[at].max(LEAST_SHARE * measured / amounts[at].max(USUAL[at]));
        }
    }

    /// With the covariances, so that they stay those of something.
    fn bound_uncertainty(&mut self, at: usize, most_ms: f64) {
        let (variance, most) = (self.covariance[at][at], most_ms * most_ms);
        if variance > most {
            let factor = (most / variance).sqrt();
            for other in 0..3 {
                self.covariance[at][other] *= factor;
                self.covariance[other][at] *= factor;
            }
        }
    }

    fn begin(&mut self, amounts: [f64; 3], frame_ms: f64) {
        for at in 0..3 {
            self.ms[at] = FIRST_SHARES[at] * frame_ms / amounts[at].max(USUAL[at]);
            self.covariance[at] = [0.0; 3];
            self.covariance[at][at] = (MOST_UNCERTAIN * self.ms[at]).powi(2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: [f64; 3] = [25.0, 6e-5, 6e-6];

    fn truth(work: &Work) -> f64 {
        std::iter::zip(TRUTH, work.features()).map(|(ms, amount)| ms * amount).sum()
    }

    #[test]
    fn what_differs_is_told_apart_and_what_is_alike_keeps_what_was_learned() {
        let mut cost = CostModel::default();
        for round in 0..40 {
            let edge_px = [1.0, 2.0, 1.4, 1.0][round % 4];
            let splats = [1e5, 8e5, 4e5, 1e6][(round / 2) % 4];
            let work = Work::new(splats, [2e6, 1e7, 3e7][round % 3], edge_px);
            cost.learn(&work, truth(&work) * (1.0 + 0.03 * (round as f64).sin()));
        }
        let others = [Work::new(5e5, 5e6, 1.0), Work::new(1e6, 2e7, 3.0), Work::new(1e5, 3e7, 1.2)];
        let check = |cost: &CostModel| {
            for work in &others {
                let (expected, truth) = (cost.ms(work), truth(work));
                assert!((expected / truth - 1.0).abs() < 0.15, "{expected} {truth} {cost:?}");
            }
        };
        check(&cost);
        let alike = Work::new(4e5, 1e7, 1.4);
        (0..500).for_each(|round| cost.learn(&alike, truth(&alike) * (1.0 + 0.03 * f64::from(round).sin())));
        check(&cost);
    }

    #[test]
    fn a_machine_that_becomes_faster_or_slower_is_followed_and_a_hiccup_is_not() {
        let mut cost = CostModel::default();
        let work = Work::new(5e5, 5e6, 1.0);
        (0..20).for_each(|_| cost.learn(&work, truth(&work)));
        cost.learn(&work, 50.0 * truth(&work));
        (0..3).for_each(|_| cost.learn(&work, truth(&work)));
        assert!((cost.ms(&work) / truth(&work) - 1.0).abs() < 0.2, "{cost:?}");
        for factor in [4.0, 0.25] {
            (0..12).for_each(|_| cost.learn(&work, factor * truth(&work)));
            assert!((cost.ms(&work) / (factor * truth(&work)) - 1.0).abs() < 0.1, "{factor} {cost:?}");
        }
    }
}
