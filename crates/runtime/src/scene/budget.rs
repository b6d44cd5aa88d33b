//! Cuts within budgets: of splats, triangles and points, of memory.
//!
//! In: what is asked for. Out: the cut at the threshold asked for, or at the first one above it that fits.
//! What always holds: a view's instances are cut at one threshold; the last complete cut stays until the next one is, where that is
//! asked for; the threshold depends on the camera, the budgets and what is resident, not on the frames before.

use super::{Instance, Lists, Scene};
use crate::residency::{ModelFile, PageRequest};
use crate::selection::{Outcome, SelectInput, Selector, Target};
use crate::splats::{SplatList, coarser, finer_by};
use crate::{CutReport, Fineness, Interrupt, Limit, ModelView, ViewId};
use gigalod_geom::Camera;

/// Lists grow by at least so much at a time.
const LEAST_GROWTH_BYTES: u64 = 64 << 10;

/// A coarse count is made at so many times the threshold asked for, or a pixel.
const COARSE: f32 = 16.0;

/// A cut that has less than one part of so many of what there may be tells nothing about a full one.
const LITTLE: u64 = 4;

/// So many times what there may be is expected, where a cut is not even tried.
const SURELY_TOO_MANY: f64 = 1.15;

/// So many times what there may be is expected, where a cut is tried without a count.
const SURELY_FITS: f64 = 1.0;

/// After so many counts, the next one is from the threshold asked for.
const MOST_COUNTS: u32 = 4;

/// What a view's last cut came to.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastCut {
    came_to: Guess,
    /// What a coarse count said of it.
    counted: Guess,
}

/// So many primitives at a threshold.
#[derive(Clone, Copy, Debug)]
struct Guess {
    threshold_px: f32,
    primitives: u64,
}

impl Guess {
    /// Primitives at another threshold: on a surface, they grow with its minus second power.
    fn at(&self, threshold_px: f32) -> f64 {
        self.primitives as f64 * (f64::from(self.threshold_px) / f64::from(threshold_px)).powi(2)
    }

    /// Primitives at another threshold, if they go on to grow as they have grown from a coarser one.
    fn as_grown_from(&self, coarser: &Self, threshold_px: f32) -> f64 {
        let grown = (self.primitives.max(1) as f64 / coarser.primitives.max(1) as f64).ln();
        let finer = |from_px: f32, to_px: f32| f64::from(from_px / to_px).ln();
        let growth = grown / finer(coarser.threshold_px, self.threshold_px).max(1e-6);
        self.primitives as f64 * (growth.max(0.0) * finer(self.threshold_px, threshold_px)).exp()
    }

    /// A threshold that is probably a little too fine for so many primitives.
    fn px(&self, most_splats: u64) -> f32 {
        self.threshold_px * finer_by(self.primitives, most_splats)
    }
}

impl LastCut {
    /// What a cut of another view would come to at the same threshold, if a coarse count of it is as far off as the last one was.
    fn of(&self, counted: &Guess) -> Guess {
        let part = counted.at(self.came_to.threshold_px) / self.counted.at(self.came_to.threshold_px).max(1.0);
        Guess { primitives: (self.came_to.primitives as f64 * part) as u64, ..self.came_to }
    }
}

impl Scene {
    /// A cut of all instances. With `beside`, the last one stays where it is until this one is complete.
    pub(super) fn cut(
        &mut self,
        view: ViewId,
        camera: &Camera,
        fineness: &Fineness,
        interrupt: &Interrupt,
        beside: bool,
    ) -> Option<CutReport> {
        for instance in self.instances.keys() {
            self.lists.entry(Target { instance: *instance, view }).or_default();
        }
        let most_splats = fineness.most_splats.min(self.most_splats_in_memory());
        let asked = Fineness { most_splats, ..*fineness };
        let asked_px = asked.threshold_px;
        let mut threshold_px = asked_px;
        // A cut in vain takes as long as another, so the search comes first where it will probably be.
        let counted = match most_splats {
            u64::MAX => None,
            _ => Some(self.coarse_count(&asked, camera, interrupt)?),
        };
        let expected = counted.map(|counted| self.expected(view, most_splats, counted));
        let mut searched = false;
        if expected.is_some_and(|cut| cut.at(asked_px) > most_splats as f64 * SURELY_TOO_MANY) {
            (threshold_px, searched) = self.threshold_within(expected, camera, &asked, interrupt)?;
        }
        let mut report = loop {
            match self.cut_at(view, camera, &Fineness { threshold_px, ..asked }, interrupt, beside) {
                Ok(report) => break report,
                Err(Outcome::TooMany) if !searched => {
                    (threshold_px, searched) = self.threshold_within(None, camera, &asked, interrupt)?;
                }
                Err(Outcome::NoRoom) if self.make_room_for_lists() => {}
                Err(Outcome::TooMany | Outcome::NoRoom) => threshold_px = coarser(threshold_px),
                Err(_) => return None,
            }
        };
        if let Some(counted) = counted {
            let came_to = Guess { threshold_px, primitives: report.primitives() };
            self.last.insert(view, LastCut { came_to, counted });
        }
        let limit = |report: &mut CutReport| {
            if threshold_px > asked_px && report.max_error_px > asked_px {
                report.limited_by = Some(Limit::Budget);
            }
        };
        limit(&mut report);
        let mut used = 0;
        for (_, lists) in self.lists.iter_mut().filter(|(target, _)| target.view == view) {
            if beside {
                std::mem::swap(&mut lists.shown, &mut lists.next);
                lists.next.release(&mut self.splats);
            }
            limit(&mut lists.shown.report);
            self.requests.extend_from_slice(&lists.shown.requests);
            used += lists.shown.pieces();
        }
        if self.cpu_budget == u64::MAX {
            self.splats.give_away(used, beside);
        }
        self.splats.keep_spare(used, most_splats, self.room_bytes());
        self.leave_the_rest_to_pages();
        Some(report)
    }

    /// One try.
    fn cut_at(
        &mut self,
        view: ViewId,
        camera: &Camera,
        at: &Fineness,
        interrupt: &Interrupt,
        beside: bool,
    ) -> Result<CutReport, Outcome> {
        let Fineness { threshold_px, most_splats, wanted_px } = *at;
        let mut report = CutReport { threshold_px, ..CutReport::default() };
        let coarsest = threshold_px == f32::INFINITY;
        let mut splats_left = if coarsest { u64::MAX } else { most_splats };
        // The memory of all of them is there for each of them.
        for (_, lists) in self.lists.iter_mut().filter(|(target, _)| target.view == view) {
            let replaced = if beside { &mut lists.next } else { &mut lists.shown };
            replaced.release(&mut self.splats);
        }
        for (instance, Instance { file, placement }) in &self.instances {
            let target = Target { instance: *instance, view };
            let room_bytes = if coarsest { u64::MAX } else { self.room_bytes() };
            let Some(Lists { shown, next }) = self.lists.get_mut(&target) else {
                continue;
            };
            let input = SelectInput {
                file: *file,
                view: ModelView::new(camera, placement),
                threshold_px,
                wanted_px,
                most_splats: splats_left,
                room_bytes,
                interrupt,
                residency: &self.residency,
            };
            let selection = if beside { next } else { shown };
            let selector: &mut dyn Selector = match self.residency.file(*file) {
                ModelFile::Splats(_) => &mut self.splats,
                ModelFile::Hybrid(_) => &mut self.hybrid,
            };
            match selector.select(target, &input, selection) {
                Outcome::Complete => {}
                other => return Err(other),
            }
            splats_left -= selection.report.primitives();
            report = report.merge(selection.report);
        }
        Ok(report)
    }

    /// A count that takes no time beside a cut, and tells of what has just turned into view.
    fn coarse_count(&mut self, asked: &Fineness, camera: &Camera, interrupt: &Interrupt) -> Option<Guess> {
        let threshold_px = COARSE * asked.threshold_px.max(1.0);
        self.count_at(&Fineness { threshold_px, ..*asked }, camera, interrupt)?;
        Some(Guess { threshold_px, primitives: self.search.drawn() })
    }

    /// What a cut is expected to come to: as the last one did, unless that was of so little that it tells nothing about this one.
    fn expected(&self, view: ViewId, most_splats: u64, counted: Guess) -> Guess {
        let tells =
            |last: &&LastCut| last.came_to.threshold_px.is_finite() && last.came_to.primitives >= most_splats / LITTLE;
        self.last.get(&view).filter(tells).map_or(counted, |last| last.of(&counted))
    }

    /// The threshold at which a camera sees no more than is asked for. `None` where the search was broken off.
    ///
    /// A count from a threshold upwards takes as long as a cut there. So the first one is made from where the cut is expected to be, and
    /// tells about where to go on; the answer is that of a count from the threshold asked for. False beside it where that was not
    /// counted, since hardly more are to be expected there than were counted before.
    fn threshold_within(
        &mut self,
        expected: Option<Guess>,
        camera: &Camera,
        asked: &Fineness,
        interrupt: &Interrupt,
    ) -> Option<(f32, bool)> {
        let Fineness { threshold_px: asked_px, most_splats, .. } = *asked;
        let mut from_px = expected.map_or(asked_px, |cut| cut.px(most_splats)).max(asked_px);
        let mut before: Option<Guess> = None;
        for count in 1.. {
            self.count_at(&Fineness { threshold_px: from_px, ..*asked }, camera, interrupt)?;
            let Some(finer_px) = self.search.finer_px().filter(|_| from_px > asked_px) else { break };
            let now = Guess { threshold_px: from_px, primitives: self.search.drawn() };
            // Where the data end, there are hardly more at any threshold.
            if before.is_some_and(|before| now.as_grown_from(&before, asked_px) < most_splats as f64 * SURELY_FITS) {
                return Some((asked_px, false));
            }
            before = Some(now);
            from_px = if count < MOST_COUNTS { finer_px.max(asked_px) } else { asked_px };
        }
        Some((self.search.threshold_px(), true))
    }

    /// Counts what this threshold and those above it draw. `None` where it was broken off.
    fn count_at(&mut self, at: &Fineness, camera: &Camera, interrupt: &Interrupt) -> Option<()> {
        let Fineness { threshold_px, most_splats, wanted_px } = *at;
        self.search.begin(threshold_px, most_splats);
        for Instance { file, placement } in self.instances.values() {
            let input = SelectInput {
                file: *file,
                view: ModelView::new(camera, placement),
                threshold_px,
                wanted_px,
                most_splats,
                room_bytes: 0,
                interrupt,
                residency: &self.residency,
            };
            let is_counted = match self.residency.file(*file) {
                ModelFile::Splats(_) => self.splats.count_into(&input, &mut self.search),
                ModelFile::Hybrid(_) => self.hybrid.count_into(&input, &mut self.search),
            };
            if !is_counted {
                return None;
            }
        }
        Some(())
    }

    /// Bytes of lists, and of what makes them.
    fn list_bytes(&self) -> u64 {
        let lists = self.lists.values().map(|lists| lists.shown.bytes() + lists.next.bytes()).sum::<u64>();
        lists + self.splats.bytes() + self.hybrid.bytes()
    }

    pub(super) fn bytes_besides_pages(&self) -> u64 {
        let requests = (self.requests.capacity() * size_of::<PageRequest>()) as u64;
        self.list_bytes() + self.search.bytes() + requests + self.residency.directory_bytes()
    }

    /// A budget with which every model is drawn, as coarsely as can be.
    pub fn least_bytes(&self) -> u64 {
        self.residency.first_pages_bytes() + self.bytes_besides_pages() + LEAST_GROWTH_BYTES
    }

    /// What lists may take together.
    fn most_list_bytes(&self) -> u64 {
        self.cpu_budget / 2
    }

    /// Splats of a view that the memory has room for, with a list beside it that is shown meanwhile, and pieces not quite full.
    fn most_splats_in_memory(&self) -> u64 {
        // Lists of nodes are short, whatever these hold.
        let is_splats = |instance: &Instance| self.residency.file(instance.file).splats().is_some();
        if self.cpu_budget == u64::MAX || !self.instances.values().any(is_splats) {
            return u64::MAX;
        }
        // Keys come by instance: those of the first one are all views.
        let first = self.lists.first_key_value().map(|(target, _)| target.instance);
        let views = self.lists.keys().take_while(|target| Some(target.instance) == first).count() as u64;
        self.most_list_bytes() / 16 * 7 / SplatList::SPLAT_BYTES / views.max(1)
    }

    /// Bytes that lists may grow by, as pages are.
    fn room_bytes(&self) -> u64 {
        let left = self.cpu_budget.saturating_sub(self.cpu_bytes());
        left.min(self.most_list_bytes().saturating_sub(self.list_bytes()))
    }

    /// Takes memory from pages, for lists; false where lists have all that they may have.
    fn make_room_for_lists(&mut self) -> bool {
        let bytes = self.list_bytes();
        let wanted = self.most_list_bytes().saturating_sub(bytes).min(bytes.max(LEAST_GROWTH_BYTES));
        let room_before = self.room_bytes();
        if wanted <= room_before {
            return false;
        }
        self.residency.set_budget(self.cpu_budget.saturating_sub(self.bytes_besides_pages() + wanted));
        self.room_bytes() > room_before
    }

    pub(super) fn leave_the_rest_to_pages(&mut self) {
        if self.cpu_budget < u64::MAX {
            self.residency.set_budget(self.cpu_budget.saturating_sub(self.bytes_besides_pages()));
        }
    }
}
