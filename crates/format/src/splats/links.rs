//! From groups to the families below them: links of a page, and the runs that they count from.
//!
//! A run is a cursor over families, in the order of the file; it begins at a place that the page names. A link takes a run's
//! cursor, skips some families, and leads to the next; the cursor then stands behind it. Families that hang from one page lie
//! in a few places, in each nearly one after the other, so links are small.
//!
//! In: the numbers of families as a writer orders them ([`Linker`]); or links, as a reader finds them (`Cursors`).
//! What always holds: links resolve to what the linker was given; hostile links resolve to a family of a later page, to one
//! later in the same page, or to nothing, after at most 16 · 65,536 steps a page.

use super::skeleton::{PageId, Skeleton};

/// Most runs of a page.
pub const MAX_RUNS: usize = 16;
/// Most families that a link skips.
pub const MAX_SKIP: u16 = 4095;
/// Skips below this stand for themselves in a coded page.
pub(super) const SKIP_ESCAPE: u16 = 15;
/// Contexts of skips in a coded page.
pub(super) const SKIP_CONTEXTS: u32 = 4;

/// A family by its place in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FamilyPlace {
    /// Its page.
    pub page: PageId,
    /// Its number among the families of the page, from 0; below 4096.
    pub family: u16,
}

/// From a group to the family below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Link {
    /// Number of the run, below 16.
    pub run: u8,
    /// Families between the run's cursor and the one that is meant; below 4096.
    pub skip: u16,
}

/// Rather than skip more than this a linker opens a new run.
const FAR: u64 = 64;
/// The last runs are kept for what no cursor reaches.
const EAGER_RUNS: usize = 12;

/// Turns the families below a page's groups into runs and links.
///
/// Families are named by their number in the order of the file, from 0 for the root's. A writer knows it before it knows
/// where pages end; when it does, it turns [`Linker::starts`] into [`FamilyPlace`]s.
#[derive(Clone, Debug, Default)]
pub struct Linker {
    starts: Vec<u64>,
    cursors: Vec<u64>,
}

impl Linker {
    /// For the next page; keeps the buffers.
    pub fn clear(&mut self) {
        self.starts.clear();
        self.cursors.clear();
    }

    /// The first family of each run.
    pub fn starts(&self) -> &[u64] {
        &self.starts
    }

    /// Links the groups of one more family of the page to `targets`, the families below those groups that have any, and
    /// appends the links. False, and nothing has changed, where that would need a 17th run: the family opens the next page.
    ///
    /// # Panics
    /// Never for the first family of a page: it has at most four groups.
    #[must_use]
    pub fn push(&mut self, targets: impl IntoIterator<Item = u64>, links: &mut Vec<Link>) -> bool {
        let (runs, first_link) = (self.starts.len(), links.len());
        let mut undo = [(0, 0); 4];
        for (at, target) in targets.into_iter().enumerate() {
            let Some(link) = self.link(target) else {
                for (run, cursor) in undo[..at].iter().rev() {
                    self.cursors[*run] = *cursor;
                }
                self.starts.truncate(runs);
                self.cursors.truncate(runs);
                links.truncate(first_link);
                return false;
            };
            let run = usize::from(link.run);
            undo[at] = (run, self.cursors[run]);
            self.cursors[run] = target + 1;
            links.push(link);
        }
        true
    }

    /// The nearest cursor at or before the target, or a new run; that run's cursor has yet to move.
    fn link(&mut self, target: u64) -> Option<Link> {
        let skips =
            self.cursors.iter().enumerate().filter_map(|(run, cursor)| Some((target.checked_sub(*cursor)?, run)));
        let nearest = skips.min().filter(|(skip, _)| *skip <= u64::from(MAX_SKIP));
        let enough = if nearest.is_some() { EAGER_RUNS } else { MAX_RUNS };
        if nearest.is_none_or(|(skip, _)| skip > FAR) && self.starts.len() < enough {
            self.starts.push(target);
            self.cursors.push(target);
            return Some(Link { run: self.starts.len() as u8 - 1, skip: 0 });
        }
        nearest.map(|(skip, run)| Link { run: run as u8, skip: skip as u16 })
    }
}

/// Where a run stands.
#[derive(Clone, Copy)]
struct Cursor {
    page: u32,
    family: u32,
    /// Families of that page.
    families: u32,
    first_page: u32,
}

/// Resolves the links of one page, in order.
pub(super) struct Cursors {
    cursors: [Cursor; MAX_RUNS],
}

impl Cursors {
    /// `None` where a run begins at a family that there is not, or there are too many.
    pub(super) fn new(runs: &[FamilyPlace], skeleton: &Skeleton) -> Option<Self> {
        // Runs that there are not stand behind the last page.
        let mut cursors = [Cursor { page: u32::MAX, family: 0, families: 0, first_page: u32::MAX }; MAX_RUNS];
        for (at, run) in runs.iter().enumerate() {
            let families = u32::from(skeleton.pages().get(run.page.0 as usize)?.families);
            let family = Some(u32::from(run.family)).filter(|family| *family < families)?;
            *cursors.get_mut(at)? = Cursor { page: run.page.0, family, families, first_page: run.page.0 };
        }
        Some(Self { cursors })
    }

    /// Where a link leads, and how many pages behind the first of its run; `None` where that is nowhere.
    #[inline]
    pub(super) fn next(&mut self, link: Link, skeleton: &Skeleton) -> Option<(FamilyPlace, u16)> {
        let cursor = self.cursors.get_mut(usize::from(link.run))?;
        cursor.family += u32::from(link.skip);
        while cursor.family >= cursor.families {
            cursor.family -= cursor.families;
            cursor.page = cursor.page.checked_add(1)?;
            cursor.families = u32::from(skeleton.pages().get(cursor.page as usize)?.families);
            u16::try_from(cursor.page - cursor.first_page).ok()?;
        }
        let place = FamilyPlace { page: PageId(cursor.page), family: cursor.family as u16 };
        cursor.family += 1;
        Some((place, (cursor.page - cursor.first_page) as u16))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn links_lead_to_their_targets_and_a_refused_family_leaves_no_trace(
            families in prop::collection::vec(prop::collection::vec((0usize..20, 0u64..200, 0u64..50), 1..5), 0..200),
        ) {
            // As many increasing sequences as there are sizes, interleaved; now and then one goes back or far ahead.
            let mut next: Vec<u64> = (0..20).map(|bucket| 100_000 * bucket).collect();
            let (mut linker, mut links, mut targets) = (Linker::default(), Vec::new(), Vec::new());
            for family in &families {
                let below: Vec<u64> = family.iter().map(|(bucket, step, odd)| {
                    next[*bucket] = if *odd == 0 { *step } else { next[*bucket] + if *odd < 5 { 50 * step } else { step % 3 } };
                    next[*bucket] += 1;
                    next[*bucket]
                }).collect();
                let before = (linker.starts.clone(), linker.cursors.clone(), links.clone());
                if linker.push(below.iter().copied(), &mut links) {
                    targets.extend(below);
                } else {
                    prop_assert!(!targets.is_empty() && before == (linker.starts.clone(), linker.cursors.clone(), links.clone()));
                }
            }
            prop_assert!(linker.starts().len() <= MAX_RUNS && links.iter().all(|link| link.skip <= MAX_SKIP));
            let mut cursors = linker.starts().to_vec();
            for (link, target) in std::iter::zip(&links, &targets) {
                let cursor = &mut cursors[usize::from(link.run)];
                *cursor += u64::from(link.skip);
                prop_assert_eq!(*cursor, *target);
                *cursor += 1;
            }
            prop_assert_eq!(links.len(), targets.len());
        }
    }
}
