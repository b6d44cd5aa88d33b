//! From all leaves to chunks, and the tree on top of them.
//!
//! Sets of leaves are split at the midpoint of the longest axis, on disk as long as they do not fit into memory, until they are
//! chunks. What the splits leave is a binary tree whose units are the chunks.

use super::chunk::{self, Head, MAX_LEAVES, Raised};
use super::contract::Costs;
use super::kept::{self, Kept, KeptTree, UnitSource};
use super::leaves::Leaf;
use super::measure::{Sums, Units};
use super::plan::MemoryPlan;
use super::tree::{self, Binary, Extent, Point, Points};
use crate::BuildError;
use crate::progress::Phases;
use crate::spool::Spool;
use gigalod_geom::quantise::normal;
use std::cell::Cell;
use std::io;

/// All chunks on the way up.
pub(super) struct Chunks {
    /// Nodes of all chunks, one chunk after the other in the order of the tree, each family by family.
    pub(super) kept: Spool<Kept>,
    /// 5-6-5, for each kept node, or empty.
    pub(super) colors: Spool<u16>,
    /// Number of kept nodes of each chunk.
    pub(super) sizes: Vec<u32>,
    /// The tree on top of them; lists the chunks' roots and the roots' children too.
    pub(super) top: KeptTree,
    /// Of all leaves.
    pub(super) mean_radius: f32,
}

/// Chunks that are raised, and leaves that are still to be: a place in the work that one can go on from.
pub(super) struct Division {
    /// What is raised. Its top is still to come.
    pub(super) chunks: Chunks,
    /// Preorder of the tree on top: true for a chunk.
    pub(super) shape: Vec<bool>,
    /// One for each chunk.
    pub(super) roots: Vec<Head>,
    /// Sets of leaves to come, the next one last.
    pub(super) pending: Vec<(Spool<Leaf>, Extent)>,
    /// Leaves of finished chunks.
    pub(super) done: u64,
    /// Sets that were ever split off; they are named by their number.
    pub(super) sets: u64,
}

/// All of these leaves that are read and written between two places to go on from: a quarter of the model.
const SAVE_EVERY: u64 = 4;

impl Division {
    /// Nothing is done yet.
    pub(super) fn new(leaves: Spool<Leaf>, plan: &MemoryPlan<'_>) -> io::Result<Self> {
        let mut extent = Extent::EMPTY;
        leaves.for_each_piece(MemoryPlan::PIECE, |_, piece| {
            extent = piece.iter().fold(extent, |extent, leaf| extent.including(leaf.center));
            Ok(())
        })?;
        let chunks = Chunks {
            kept: Spool::named(&plan.place(), "kept")?,
            colors: Spool::named(&plan.place(), "kept_colors")?,
            sizes: vec![],
            top: KeptTree::default(),
            mean_radius: 0.0,
        };
        let pending = vec![(leaves, extent)];
        Ok(Self { chunks, shape: vec![], roots: vec![], pending, done: 0, sets: 0 })
    }
}

/// Splits what is pending into chunks and raises them all. `save` is told now and then how far that has come.
pub(super) fn divide(
    division: Division,
    has_colors: bool,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
    mut save: impl FnMut(&Division) -> io::Result<()>,
) -> Result<Chunks, BuildError> {
    let total = division.done + division.pending.iter().map(|(leaves, _)| leaves.len()).sum::<u64>();
    phases.begin("tree", total);
    let mut divider = Divider { division, has_colors, plan, phases };
    let mut unsaved = 0;
    while let Some((leaves, extent)) = divider.division.pending.pop() {
        unsaved += leaves.len();
        divider.set(leaves, extent)?;
        if unsaved >= total / SAVE_EVERY && !divider.division.pending.is_empty() {
            save(&divider.division).map_err(BuildError::Scratch)?;
            unsaved = 0;
        }
    }
    let Division { mut chunks, shape, roots, .. } = divider.division;
    chunks.mean_radius = top_of(&shape, &roots, has_colors, &mut chunks.top).mean_radius();
    Ok(chunks)
}

struct Divider<'a> {
    division: Division,
    has_colors: bool,
    plan: &'a MemoryPlan<'a>,
    phases: &'a Phases<'a>,
}

impl Divider<'_> {
    /// Raises a set of leaves, or splits it in two.
    fn set(&mut self, leaves: Spool<Leaf>, extent: Extent) -> Result<(), BuildError> {
        let at_once = self.plan.leaves_at_once() as u64;
        let leaves = match leaves {
            Spool::Memory(mut all) => return self.block(&mut all).map_err(BuildError::Scratch),
            file => file,
        };
        if leaves.len() <= at_once {
            let mut all = Vec::new();
            leaves.read_vec(0, leaves.len() as usize, &mut all).map_err(BuildError::Scratch)?;
            drop(leaves);
            return self.block(&mut all).map_err(BuildError::Scratch);
        }
        let Some(plane) = extent.plane() else {
            return Err(BuildError::Crowd { vertices: leaves.len(), most: at_once });
        };
        let mut halves = [self.half()?, self.half()?];
        let sort = |_: u64, piece: &[Leaf]| {
            for leaf in piece {
                let half = &mut halves[usize::from(!plane.is_left(leaf.center))];
                half.extent = half.extent.including(leaf.center);
                half.waiting.push(*leaf);
            }
            halves.iter_mut().try_for_each(Half::flush)
        };
        leaves.for_each_piece(MemoryPlan::PIECE, sort).map_err(BuildError::Scratch)?;
        drop(leaves);
        self.division.shape.push(false);
        let [left, right] = halves.map(|half| (half.leaves, half.extent));
        self.division.pending.extend([right, left]);
        Ok(())
    }

    fn half(&mut self) -> Result<Half, BuildError> {
        self.division.sets += 1;
        let name = format!("set{}", self.division.sets);
        let leaves = Spool::named(&self.plan.place(), &name).map_err(BuildError::Scratch)?;
        Ok(Half { leaves, extent: Extent::EMPTY, waiting: vec![] })
    }

    /// A set of leaves in memory; so much of it at a time that finished chunks do not pile up before they are put away.
    fn block(&mut self, leaves: &mut [Leaf]) -> io::Result<()> {
        let count = leaves.len() as u64;
        if leaves.len() > self.plan.leaves_at_once() {
            self.division.shape.push(false);
            let middle = tree::split(leaves);
            let (left, right) = leaves.split_at_mut(middle);
            self.block(left)?;
            return self.block(right);
        }
        let part = raise_all(leaves, self.has_colors);
        let Division { chunks, shape, roots, done, .. } = &mut self.division;
        shape.extend(part.shape);
        for raised in part.raised {
            chunks.kept.push(&raised.nodes)?;
            chunks.colors.push(&raised.colors)?;
            chunks.sizes.push(raised.nodes.len() as u32);
            roots.push(raised.head);
        }
        *done += count;
        self.phases.at(*done);
        Ok(())
    }
}

struct Half {
    leaves: Spool<Leaf>,
    extent: Extent,
    waiting: Vec<Leaf>,
}

impl Half {
    fn flush(&mut self) -> io::Result<()> {
        self.leaves.push(&self.waiting)?;
        self.waiting.clear();
        Ok(())
    }
}

/// Chunks of a set of leaves, in order, and the preorder of the tree on top of them.
struct Part {
    raised: Vec<Raised>,
    shape: Vec<bool>,
}

/// Leaves that are split by their points; more than that where they lie, so that points need little room.
const MOST_POINTS: usize = MAX_LEAVES * 8;

thread_local! {
    /// Kept, because the system would clear them for each set of leaves anew.
    static POINTS: Cell<[Vec<Point>; 2]> = const { Cell::new([Vec::new(), Vec::new()]) };
}

fn raise_all(leaves: &mut [Leaf], has_colors: bool) -> Part {
    if leaves.len() > MOST_POINTS {
        let middle = tree::split(leaves);
        let (left, right) = leaves.split_at_mut(middle);
        return Part::both(|| raise_all(left, has_colors), || raise_all(right, has_colors));
    }
    let mut buffers = POINTS.take();
    let part = raise_points(Points::of(leaves, &mut buffers), leaves, has_colors);
    POINTS.set(buffers);
    part
}

fn raise_points(points: Points<'_>, leaves: &[Leaf], has_colors: bool) -> Part {
    if points.len() <= MAX_LEAVES {
        return Part { raised: vec![chunk::raise(points, leaves, has_colors)], shape: vec![true] };
    }
    let [left, right] = points.split(leaves);
    Part::both(|| raise_points(left, leaves, has_colors), || raise_points(right, leaves, has_colors))
}

impl Part {
    fn both(left: impl FnOnce() -> Self + Send, right: impl FnOnce() -> Self + Send) -> Self {
        let (mut left, mut right) = rayon::join(left, right);
        left.raised.append(&mut right.raised);
        let shape = [false].into_iter().chain(left.shape).chain(right.shape).collect();
        Self { raised: left.raised, shape }
    }
}

/// The tree on top of the chunks; returns the sums over all leaves.
fn top_of(shape: &[bool], roots: &[Head], has_colors: bool, out: &mut KeptTree) -> Sums {
    // Backwards through preorder, a stack of subtrees, each with its costs; the left one is on top.
    let mut binaries = Vec::with_capacity(shape.len());
    let mut stack: Vec<(u32, Costs)> = Vec::new();
    for is_chunk in shape.iter().rev() {
        let (node, costs) = if *is_chunk {
            (Binary::UNIT, Costs::LEAF)
        } else {
            let (left, left_costs) = stack.pop().expect("an inner node has a left child");
            let (right, right_costs) = stack.pop().expect("an inner node has a right child");
            let (costs, plan) = Costs::merge(left_costs, right_costs);
            (Binary { units: left + right, plan }, costs)
        };
        binaries.push(node);
        stack.push((node.units, costs));
    }
    binaries.reverse();
    let mut units = Units::default();
    for head in roots {
        units.push(&head.sphere(), normal::decode(head.normal), head.cos_spread);
    }
    kept::keep(&binaries, &units, &Roots(roots), has_colors, out).sums
}

struct Roots<'a>(&'a [Head]);

impl UnitSource for Roots<'_> {
    fn unit(&self, at: usize) -> (Kept, Sums) {
        let head = &self.0[at];
        (head.root, head.sums)
    }

    fn group_below(&self, at: usize) -> (&[Kept], &[u16]) {
        self.0[at].group()
    }
}
