//! Which threshold a number of splats allows.
//!
//! In: hierarchies of either kind as they are resident, a threshold, a number. Out: the threshold, or the next steps above it, at which no more
//! splats are drawn than that.
//! What always holds: the answer depends on nothing else, neither on threads nor on earlier answers.
//!
//! A node below ancestors of at least m pixels is drawn or opened where the threshold is below m. So each group of k nodes in
//! view adds k − 1 splats to every threshold below its m, and one traversal that counts them by m answers for all thresholds from
//! its own upwards. It need not finish at its own: as soon as too many are counted, its threshold is raised to where they are not,
//! and what is below is not visited. From a threshold far too fine, most of the time goes to where it begins; so a search is a few
//! counts, from coarse thresholds first ([`ThresholdSearch::finer_px`]), and together they visit about as many nodes as the cut will.

use super::group::{Below, Group, Inconsistent, Stored, ones};
use super::lanes::Look;
use super::walk::CHECK_GROUPS;
use crate::fineness::Interrupt;
use crate::residency::PageTable;
use gigalod_format::splats::{Page, Root};

/// Steps of the threshold: 16 in each octave, between 2⁻²⁰ and 2³² pixels.
const STEPS: usize = 52 << STEP_BITS;
const STEP_BITS: u32 = 4;
const SHIFT: u32 = 23 - STEP_BITS;
const FIRST: u32 = (127 - 20) << STEP_BITS;

/// The ratio to a threshold that draws `drawn` primitives of one that probably draws a little more than `most` of them.
///
/// On a surface, the number grows with the threshold's minus second power, and more slowly where data end. So the farther away, the more
/// is added: a count raises its threshold, never lowers it.
pub(crate) fn finer_by(drawn: u64, most: u64) -> f32 {
    let ratio = (drawn.max(1) as f64 / most.max(1) as f64).sqrt();
    (0.97 * ratio.powf(if ratio < 1.0 { 1.1 } else { 1.0 })) as f32
}

/// The last step whose threshold is not above `px` ≥ 0.
fn step(px: f32) -> usize {
    ((px.to_bits() >> SHIFT).saturating_sub(FIRST) as usize).min(STEPS - 1)
}

/// The threshold of a step; infinite behind the last one.
fn px_of_step(step: usize) -> f32 {
    if step >= STEPS { f32::INFINITY } else { f32::from_bits((step as u32 + FIRST) << SHIFT) }
}

/// The next threshold above `px`.
pub(crate) fn coarser(px: f32) -> f32 {
    if px < px_of_step(0) { px_of_step(0) } else { px_of_step(step(px) + 1) }
}

/// One search over all hierarchies of a view.
#[derive(Debug)]
pub(crate) struct ThresholdSearch {
    threshold_px: f32,
    most_splats: u64,
    /// Splats, triangles and points drawn, as long as the threshold has not been raised.
    drawn: u64,
    /// First step above the threshold, once it was raised.
    raised: Option<usize>,
    /// The same at an infinite threshold.
    roots: i64,
    /// What groups add, by the step of their m.
    added: Box<[i64; STEPS]>,
    /// `roots` and all that is added from the raised step on.
    counted: i64,
    stack: Vec<Group>,
}

impl ThresholdSearch {
    pub(crate) fn new() -> Self {
        Self {
            threshold_px: 0.0,
            most_splats: 0,
            drawn: 0,
            raised: None,
            roots: 0,
            added: Box::new([0; STEPS]),
            counted: 0,
            stack: Vec::with_capacity(256),
        }
    }

    /// Bytes that it keeps.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of::<Self>() + size_of_val(&*self.added) + self.stack.capacity() * size_of::<Group>()) as u64
    }

    /// Begins with a threshold.
    pub(crate) fn begin(&mut self, threshold_px: f32, most_splats: u64) {
        (self.threshold_px, self.most_splats) = (threshold_px, most_splats);
        (self.drawn, self.raised, self.roots, self.counted) = (0, None, 0, 0);
        self.added.fill(0);
    }

    /// The threshold at which what was counted so far is not too much.
    pub(crate) fn threshold_px(&self) -> f32 {
        self.threshold_px
    }

    /// Where to look for a finer threshold that is not too much, once all is counted. `None` where there is no finer one.
    pub(crate) fn finer_px(&self) -> Option<f32> {
        self.raised
            .is_none()
            .then(|| self.threshold_px * finer_by(self.drawn, self.most_splats).clamp(1.0 / 16.0, 0.95))
    }

    /// Splats, triangles and points at the threshold; too many, where it was raised.
    pub(crate) fn drawn(&self) -> u64 {
        self.drawn
    }

    /// Counts a hierarchy of which nothing is resident.
    pub(super) fn count_root(&mut self) {
        self.drawn += 1;
        self.add_root(1);
        self.raise_if_too_many();
    }

    /// What a hierarchy draws at an infinite threshold.
    pub(crate) fn add_root(&mut self, primitives: u64) {
        self.roots += primitives as i64;
        self.counted += primitives as i64;
    }

    /// What is drawn at the threshold, as long as it has not been raised.
    pub(crate) fn add_drawn(&mut self, primitives: u64) {
        self.drawn += primitives;
    }

    /// What a node that is opened adds to every threshold below `least_px`, the smallest error of it and all that is above.
    pub(crate) fn add(&mut self, least_px: f32, primitives: i64) {
        let step = step(least_px);
        self.added[step] += primitives;
        if self.raised.is_some_and(|first| step >= first) {
            self.counted += primitives;
        }
    }

    /// Counts a hierarchy. False where it was broken off.
    pub(super) fn count(
        &mut self,
        mut look: Look,
        (table, frame): (&PageTable<Page>, u32),
        root: &Root,
        interrupt: &Interrupt,
    ) -> bool {
        self.add_root(1);
        let (mut visited, mut groups) = (0, 0u32);
        self.stack.clear();
        self.stack.push(Group::root(root, look.known()));
        look.set_threshold_px(self.threshold_px);
        while let Some(group) = self.stack.pop() {
            groups = groups.wrapping_add(1);
            if groups.is_multiple_of(CHECK_GROUPS) && interrupt.is_set() {
                return false;
            }
            if group.least_px <= self.threshold_px {
                continue;
            }
            visited += u64::from(group.count);
            // What contradicts itself is reported by the cut.
            if visited > root.nodes || self.visit(&look, table, frame, &group).is_err() {
                break;
            }
            if self.raise_if_too_many() {
                look.set_threshold_px(self.threshold_px);
            }
        }
        true
    }

    #[inline(always)]
    fn visit(&mut self, look: &Look, table: &PageTable<Page>, frame: u32, group: &Group) -> Result<(), Inconsistent> {
        let stored = Stored::read(table, group)?;
        let decided = look.decide(group.parent, group.known, &stored.words, group.count);
        let mut open = decided.coarse & stored.inner();
        if open != 0 {
            match stored.below(table, frame)? {
                Below::At(page, first) => stored.push_open((page, first), group, &decided, open, &mut self.stack),
                Below::Missing(_) => open = 0,
            }
        }
        self.drawn += ones(decided.seen & !open & !decided.hidden);
        self.add(group.least_px, ones(decided.seen) as i64 - 1);
        Ok(())
    }

    /// Goes up to the first step at which what was counted is not too much, if it is too much.
    pub(crate) fn raise_if_too_many(&mut self) -> bool {
        let most = i64::try_from(self.most_splats).unwrap_or(i64::MAX);
        let too_many = if self.raised.is_some() { self.counted > most } else { self.drawn > self.most_splats };
        if !too_many {
            return false;
        }
        let lowest = self.raised.map_or_else(|| step(coarser(self.threshold_px)), |raised| raised + 1);
        // From the coarsest down: the sums are those of ever finer cuts.
        let (mut sum, mut first) = (self.roots, STEPS);
        (self.counted, self.raised) = (sum, Some(STEPS));
        while first > lowest {
            first -= 1;
            sum += self.added[first];
            if sum > most {
                break;
            }
            (self.counted, self.raised) = (sum, Some(first));
        }
        self.threshold_px = px_of_step(self.raised.unwrap_or(STEPS));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_narrow_and_none_is_left_out() {
        let mut px = 0.0;
        for at in 0..STEPS {
            px = coarser(px);
            assert_eq!(step(px), at);
            assert!(at == 0 || px <= px_of_step(at - 1) * (1.0 + 1.0 / 16.0));
            assert_eq!(step(px.next_down()), at.saturating_sub(1));
        }
        assert_eq!(coarser(px), f32::INFINITY);
        assert_eq!(step(f32::INFINITY), STEPS - 1);
    }
}
