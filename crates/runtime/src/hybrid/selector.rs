//! The cut: from the root to what is drawn no farther off than asked for.
//!
//! What always holds, whatever the file says: of each rank of pixels, each leaf lies below exactly one node that is drawn or culled; a cut looks at no more
//! nodes than there are; it never waits. A node that is too coarse is drawn nevertheless where a child in sight is not resident.
//!
//! A hierarchy has a node for some thousand triangles, so a cut looks at thousands of nodes where that of splats looks at millions:
//! one thread and no tricks.

use super::fade::Ranks;
use super::family::{Family, Inconsistent};
use super::look::{Look, Sight};
use super::{HybridList, HybridNode};
use crate::residency::{PageKey, PageRequest, PageTable};
use crate::selection::{DrawSource, Outcome, SelectInput, Selection, Selector, Target};
use crate::splats::{Cutting, ThresholdSearch, Tint};
use crate::{CutReport, Limit};
use gigalod_format::hybrid::{HybridFile, NodeId, NodeRecord, Page};
use std::sync::Arc;

/// How many nodes are looked at between two looks at the interrupt.
pub const CHECK_NODES: u64 = 256;

/// A node at the eye is not worth everything.
const MOST_BENEFIT_PX: f32 = 1e6;

/// Cuts hybrid hierarchies on the host.
#[derive(Debug, Default)]
pub struct HybridSelector {
    /// How to cut; the same picture comes out whatever is set here, slower or faster.
    pub cutting: Cutting,
    /// How to colour.
    pub tint: Tint,
    /// From where on a node fades into its children, as a share of the threshold; 0 for no fades. See [`super::CROSS_FADE`].
    pub cross_fade: f32,
    // Kept so that a warm cut allocates nothing.
    stack: Vec<(Sight, Ranks)>,
    counted: Vec<Counted>,
}

/// A node to be counted.
#[derive(Clone, Copy, Debug)]
struct Counted {
    sight: Sight,
    /// Smallest [`pressing_px`] of all that is above: with a raised threshold from there on, the node is not visited.
    least_px: f32,
}

/// One cut that is being made.
struct Walk<'a> {
    input: &'a SelectInput<'a>,
    file: &'a Arc<HybridFile>,
    table: (&'a PageTable<Page>, u32),
    look: Look<'a>,
    list: &'a mut HybridList,
    requests: &'a mut Vec<PageRequest>,
    report: CutReport,
    room_bytes: u64,
    /// Finest level of what is drawn.
    deepest: u32,
    cross_fade: f32,
}

impl Selector for HybridSelector {
    fn select(&mut self, _target: Target, input: &SelectInput<'_>, out: &mut Selection) -> Outcome {
        let mut list = match std::mem::take(&mut out.draw) {
            DrawSource::Hybrid(list) => list,
            DrawSource::Splats(_) | DrawSource::OnDevice(_) => HybridList::default(),
        };
        list.clear();
        out.requests.clear();
        out.report = CutReport { threshold_px: input.threshold_px, ..CutReport::default() };
        let mut outcome = Outcome::Complete;
        if let Some((file, table, frame)) = input.residency.hybrid(input.file) {
            (list.file, list.hybrid, list.tint) = (input.file, Some(file.clone()), self.tint);
            let mut walk = Walk {
                input,
                file,
                table: (table, frame),
                look: Look::new(&input.view, file.skeleton(), self.cutting),
                list: &mut list,
                requests: &mut out.requests,
                report: out.report,
                room_bytes: input.room_bytes,
                deepest: 0,
                cross_fade: self.cross_fade,
            };
            outcome = match walk.run(&mut self.stack) {
                Ok(()) => Outcome::Complete,
                Err(outcome) => outcome,
            };
            out.report = walk.report;
        }
        if outcome != Outcome::Complete {
            // What is of no use holds no pages.
            list.clear();
        }
        out.draw = DrawSource::Hybrid(list);
        outcome
    }

    fn forget(&mut self, _target: Target) {}
}

impl HybridSelector {
    /// Bytes that it keeps.
    pub fn bytes(&self) -> u64 {
        (self.stack.capacity() * size_of::<(Sight, Ranks)>() + self.counted.capacity() * size_of::<Counted>()) as u64
    }

    /// Counts triangles and points of a hierarchy for a budget. False where it was broken off.
    pub(crate) fn count_into(&mut self, input: &SelectInput<'_>, search: &mut ThresholdSearch) -> bool {
        let Some((file, table, frame)) = input.residency.hybrid(input.file) else { return true };
        let skeleton = file.skeleton();
        let look = Look::new(&input.view, skeleton, self.cutting);
        let Some(root) = look.root() else { return true };
        if table.used(NodeId(0), frame).is_none() {
            return true;
        }
        let drawn = |sight: Sight| {
            let record = look.record(sight);
            if look.is_hidden(record) { 0 } else { primitives(record) }
        };
        search.add_root(drawn(root));
        let fades = 1.0 / (1.0 - self.cross_fade);
        let mut visited = 0;
        self.counted.clear();
        self.counted.push(Counted { sight: root, least_px: f32::INFINITY });
        while let Some(Counted { sight, least_px }) = self.counted.pop() {
            visited += 1;
            if visited % CHECK_NODES == 0 && input.interrupt.is_set() {
                return false;
            }
            let is_raised = search.threshold_px() > input.wanted_px;
            if is_raised && least_px * fades <= search.threshold_px() {
                continue;
            }
            let record = look.record(sight);
            let pressing_px = pressing_px(sight, record, &look, (table, frame));
            // Its children are there as soon as it begins to fade into them.
            let opens_px = if is_raised { pressing_px } else { sight.error_px } * fades;
            let family = match record.children > 0 && opens_px > search.threshold_px() {
                true => Family::of(sight.node, record, &look, skeleton, (table, frame)).ok(),
                false => None,
            };
            let Some(family) = family.filter(|family| !family.is_missing && visited <= skeleton.nodes().len() as u64)
            else {
                search.add_drawn(drawn(sight));
                continue;
            };
            // While it fades it is drawn as well.
            if opens_px <= search.threshold_px() * fades {
                search.add_drawn(drawn(sight));
            }
            let least_above_px = least_px;
            let least_px = least_px.min(pressing_px);
            let below: u64 = family.seen().iter().map(|child| drawn(*child)).sum();
            search.add(least_px * fades, below as i64);
            search.add(pressing_px.min(least_above_px * fades), -(drawn(sight) as i64));
            self.counted.extend(family.seen().iter().map(|child| Counted { sight: *child, least_px }));
            search.raise_if_too_many();
        }
        search.raise_if_too_many();
        true
    }
}

/// How much there is to gain from what is below a node: its error on the screen, or about that where the eye is amid it.
fn pressing_px(sight: Sight, record: &NodeRecord, look: &Look<'_>, (table, _): (&PageTable<Page>, u32)) -> f32 {
    if !look.is_near(record) {
        return sight.error_px;
    }
    let page = table.get(NodeId(sight.node));
    page.map_or(sight.error_px, |page| sight.error_px.min(look.pressing_px(record, page)))
}

impl Walk<'_> {
    fn run(&mut self, stack: &mut Vec<(Sight, Ranks)>) -> Result<(), Outcome> {
        let key = |node| PageKey { file: self.input.file, page: NodeId(node).into() };
        self.report.visited = 1;
        let Some(root) = self.look.root() else {
            self.report.culled_frustum = u64::from(!self.file.skeleton().nodes().is_empty());
            return self.interrupted();
        };
        if self.table.0.used(NodeId(0), self.table.1).is_none() {
            // There is nothing to draw from.
            self.requests.push(PageRequest { key: key(0), benefit: root.error_px.min(MOST_BENEFIT_PX) });
            self.report.max_error_px = f32::INFINITY;
            self.report.limited_by = Some(Limit::Residency);
            return self.interrupted();
        }
        stack.clear();
        stack.push((root, Ranks::ALL));
        let mut next_check = CHECK_NODES;
        while let Some(item) = stack.pop() {
            if self.report.visited >= next_check {
                next_check = self.report.visited + CHECK_NODES;
                self.interrupted()?;
            }
            if self.visit(item, stack)?.is_err() {
                self.report.inconsistent = true;
                break;
            }
        }
        self.finish();
        self.interrupted()
    }

    fn interrupted(&self) -> Result<(), Outcome> {
        if self.input.interrupt.is_set() { Err(Outcome::Interrupted) } else { Ok(()) }
    }

    /// Opens a node, draws it or leaves it out, in pixels of some ranks; where it is nearly too coarse, it is opened in some of these.
    fn visit(
        &mut self,
        (sight, ranks): (Sight, Ranks),
        stack: &mut Vec<(Sight, Ranks)>,
    ) -> Result<Result<(), Inconsistent>, Outcome> {
        let record = self.look.record(sight);
        let SelectInput { threshold_px, wanted_px, .. } = *self.input;
        let is_coarse = sight.error_px > threshold_px;
        let mut limit = is_coarse.then_some(Limit::Data);
        let opens_px = match record.children > 0 && threshold_px > wanted_px {
            true => pressing_px(sight, record, &self.look, self.table),
            false => sight.error_px,
        };
        let [given, mut kept] = ranks.shared(opens_px, threshold_px, self.cross_fade);
        if is_coarse && opens_px <= threshold_px {
            limit = Some(Limit::Budget);
        }
        if record.children == 0 || given.is_empty() {
            kept = ranks;
        } else {
            match Family::of(sight.node, record, &self.look, self.file.skeleton(), self.table) {
                Ok(family) => {
                    self.report.visited += family.len();
                    if self.report.visited > self.file.skeleton().nodes().len() as u64 {
                        return Ok(Err(Inconsistent));
                    }
                    if !family.is_missing {
                        self.report.culled_frustum += family.outside;
                        // Backwards, so that the first is visited first.
                        stack.extend(family.seen().iter().rev().map(|child| (*child, given)));
                        if kept.is_empty() {
                            return Ok(Ok(()));
                        }
                    } else {
                        self.request(sight, &family);
                        (limit, kept) = (is_coarse.then_some(Limit::Residency), ranks);
                    }
                }
                // Without them it is as good as a leaf.
                Err(Inconsistent) => (self.report.inconsistent, kept) = (true, ranks),
            }
        }
        if self.look.is_hidden(record) {
            self.report.culled_backface += 1;
            return Ok(Ok(()));
        }
        self.draw((sight, kept), record, limit).map(Ok)
    }

    /// Asks for the children in sight that are not there.
    fn request(&mut self, parent: Sight, family: &Family) {
        let benefit = parent.error_px.min(MOST_BENEFIT_PX);
        let missing = family.seen().iter().filter(|child| self.table.0.get(NodeId(child.node)).is_none());
        self.requests.extend(missing.map(|child| PageRequest {
            key: PageKey { file: self.input.file, page: NodeId(child.node).into() },
            benefit,
        }));
    }

    fn draw(
        &mut self,
        (sight, ranks): (Sight, Ranks),
        record: &NodeRecord,
        limit: Option<Limit>,
    ) -> Result<(), Outcome> {
        let node = NodeId(sight.node);
        // What is drawn was found resident when its parent was opened.
        let Some(page) = self.table.0.used_shared(node, self.table.1).cloned() else { return Ok(()) };
        self.report.drawn += 1;
        self.report.triangles += u64::from(record.triangles);
        self.report.points += u64::from(record.points);
        // A box around the eye is as near as can be; what is in it need not be.
        let error_px = match limit {
            Some(Limit::Data) if self.look.is_near(record) => sight.error_px.min(self.look.error_px_of(record, &page)),
            _ => sight.error_px,
        };
        let limit = limit.filter(|_| error_px > self.input.threshold_px);
        self.report.max_error_px = self.report.max_error_px.max(error_px);
        self.report.limited_by = self.report.limited_by.max(limit);
        if self.report.primitives() > self.input.most_splats {
            return Err(Outcome::TooMany);
        }
        if self.list.nodes.len() == self.list.nodes.capacity() && !self.grow(self.list.nodes.len().max(64)) {
            return Err(Outcome::NoRoom);
        }
        self.deepest = self.deepest.max(record.level);
        self.list.nodes.push(HybridNode { node, page, draws_lines: record.borders > 0, ranks });
        Ok(())
    }

    /// Makes room for so many more nodes; false where that would be too much memory.
    fn grow(&mut self, by: usize) -> bool {
        let Some(left) = self.room_bytes.checked_sub((by * size_of::<HybridNode>()) as u64) else { return false };
        self.room_bytes = left;
        self.list.nodes.reserve_exact(by);
        true
    }

    fn finish(&mut self) {
        self.list.nodes.sort_unstable_by_key(|node| node.node);
        // Leaves of one level share what lies on their borders, and neighbours that are simplified cover gaps as wide as leaves of
        // their own level or a finer one are rounded. So a leaf only draws lines where something finer may lie beside it.
        let (skeleton, deepest) = (self.file.skeleton(), self.deepest);
        for node in &mut self.list.nodes {
            let record = skeleton.record(node.node);
            node.draws_lines &= record.children > 0 || record.level < deepest;
        }
        let with_lines = self.list.nodes.iter().filter(|node| node.draws_lines);
        self.report.lines = with_lines.map(|node| u64::from(skeleton.record(node.node).borders)).sum();
        // So that a list that grows a little needs no memory.
        let spare = self.list.nodes.len() / 16 + 16;
        if self.list.nodes.capacity() - self.list.nodes.len() < spare {
            self.grow(spare * 2);
        }
    }
}

/// What a node counts for.
fn primitives(record: &NodeRecord) -> u64 {
    u64::from(record.triangles) + u64::from(record.points)
}
