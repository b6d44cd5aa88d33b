//! From all leaves to chunks, and the tree on top of them.
//!
//! Sets of leaves are split at the midpoint of the longest axis, on disk as long as they do not fit into memory, until they are
//! chunks. What the splits leave is a binary tree whose units are the chunks.

use super::chunk::{self, Kept, MAX_LEAVES, Raised};
use super::contract::{self, Costs};
use super::leaves::Leaf;
use super::plan::MemoryPlan;
use super::tree::{self, Binary, Extent};
use crate::BuildError;
use crate::progress::Phases;
use crate::spool::Spool;
use std::io;

/// All chunks on the way up.
pub(super) struct Chunks {
    /// Kept nodes of all chunks, one after the other, in the order of the tree.
    pub(super) kept: Spool<Kept>,
    /// 5-6-5, for each kept node, or empty.
    pub(super) colors: Spool<u16>,
    /// Number of kept nodes of each chunk.
    pub(super) sizes: Vec<u32>,
    /// The tree on top: preorder; its units are the chunks.
    pub(super) top: Vec<Binary>,
}

/// Splits `leaves` into chunks and raises them all.
pub(super) fn divide(
    leaves: Spool<Leaf>,
    has_colors: bool,
    plan: &MemoryPlan<'_>,
    phases: &Phases<'_>,
) -> Result<Chunks, BuildError> {
    phases.begin("tree", leaves.len());
    let chunks = Chunks {
        kept: Spool::named(&plan.place(), "kept").map_err(BuildError::Scratch)?,
        colors: Spool::named(&plan.place(), "kept_colors").map_err(BuildError::Scratch)?,
        sizes: vec![],
        top: vec![],
    };
    let mut division = Division { chunks, shape: Vec::new(), roots: Vec::new(), has_colors, plan, phases, done: 0 };
    let mut extent = Extent::EMPTY;
    leaves
        .for_each_piece(MemoryPlan::PIECE, |_, piece| {
            extent = piece.iter().fold(extent, Extent::including);
            Ok(())
        })
        .map_err(BuildError::Scratch)?;
    match leaves {
        Spool::Memory(mut all) => division.block(&mut all, extent).map_err(BuildError::Scratch)?,
        file => division.set(file, extent)?,
    }
    let Division { mut chunks, shape, roots, .. } = division;
    chunks.top = top_of(&shape, roots);
    Ok(chunks)
}

struct Division<'a> {
    chunks: Chunks,
    /// Preorder of the tree on top: true for a chunk.
    shape: Vec<bool>,
    roots: Vec<Binary>,
    has_colors: bool,
    plan: &'a MemoryPlan<'a>,
    phases: &'a Phases<'a>,
    done: u64,
}

impl Division<'_> {
    /// A set of leaves in a file.
    fn set(&mut self, leaves: Spool<Leaf>, extent: Extent) -> Result<(), BuildError> {
        let at_once = self.plan.leaves_at_once() as u64;
        if leaves.len() <= at_once {
            let mut all = Vec::new();
            leaves.read_vec(0, leaves.len() as usize, &mut all).map_err(BuildError::Scratch)?;
            drop(leaves);
            return self.block(&mut all, extent).map_err(BuildError::Scratch);
        }
        let Some(plane) = extent.plane() else {
            return Err(BuildError::Crowd { vertices: leaves.len(), most: at_once });
        };
        let mut halves =
            [(); 2].map(|()| Half { leaves: Spool::new(&self.plan.place()), extent: Extent::EMPTY, waiting: vec![] });
        let sort = |_: u64, piece: &[Leaf]| {
            for leaf in piece {
                let half = &mut halves[usize::from(!plane.is_left(leaf))];
                half.extent = half.extent.including(leaf);
                half.waiting.push(*leaf);
            }
            halves.iter_mut().try_for_each(Half::flush)
        };
        leaves.for_each_piece(MemoryPlan::PIECE, sort).map_err(BuildError::Scratch)?;
        drop(leaves);
        self.shape.push(false);
        for half in halves {
            self.set(half.leaves.map_err(BuildError::Scratch)?, half.extent)?;
        }
        Ok(())
    }

    /// A set of leaves in memory.
    fn block(&mut self, leaves: &mut [Leaf], extent: Extent) -> io::Result<()> {
        let count = leaves.len() as u64;
        // So much at a time that finished chunks do not pile up before they are put away.
        if leaves.len() > self.plan.leaves_at_once() {
            self.shape.push(false);
            let (middle, [left_extent, right_extent]) = tree::split(leaves, extent);
            let (left, right) = leaves.split_at_mut(middle);
            self.block(left, left_extent)?;
            return self.block(right, right_extent);
        }
        let part = raise_all(leaves, extent, self.has_colors);
        self.shape.extend(part.shape);
        for raised in part.raised {
            self.chunks.kept.push(&raised.kept)?;
            self.chunks.colors.push(&raised.colors)?;
            self.chunks.sizes.push(raised.kept.len() as u32);
            self.roots.push(raised.root);
        }
        self.done += count;
        self.phases.at(self.done);
        Ok(())
    }
}

struct Half {
    leaves: io::Result<Spool<Leaf>>,
    extent: Extent,
    waiting: Vec<Leaf>,
}

impl Half {
    fn flush(&mut self) -> io::Result<()> {
        if let Ok(leaves) = &mut self.leaves {
            leaves.push(&self.waiting)?;
        }
        self.waiting.clear();
        Ok(())
    }
}

/// Chunks of a set of leaves, in order, and the preorder of the tree on top of them.
struct Part {
    raised: Vec<Raised>,
    shape: Vec<bool>,
}

fn raise_all(leaves: &mut [Leaf], extent: Extent, has_colors: bool) -> Part {
    if leaves.len() <= MAX_LEAVES {
        return Part { raised: vec![chunk::raise(leaves, has_colors)], shape: vec![true] };
    }
    let (middle, [left_extent, right_extent]) = tree::split(leaves, extent);
    let (left, right) = leaves.split_at_mut(middle);
    let (left, right) =
        rayon::join(|| raise_all(left, left_extent, has_colors), || raise_all(right, right_extent, has_colors));
    Part {
        raised: left.raised.into_iter().chain(right.raised).collect(),
        shape: [false].into_iter().chain(left.shape).chain(right.shape).collect(),
    }
}

/// The nodes of the tree on top, in preorder, merged and with their cones.
fn top_of(shape: &[bool], roots: Vec<Binary>) -> Vec<Binary> {
    // Backwards through preorder, a stack of subtrees, each with its costs; the left one is on top.
    let mut nodes = Vec::with_capacity(shape.len());
    let mut stack: Vec<(Binary, Costs)> = Vec::new();
    let mut roots = roots.into_iter().rev();
    for is_chunk in shape.iter().rev() {
        let (node, costs) = if *is_chunk {
            (roots.next().expect("a root for each chunk"), Costs::LEAF)
        } else {
            let (left, left_costs) = stack.pop().expect("an inner node has a left child");
            let (right, right_costs) = stack.pop().expect("an inner node has a right child");
            let (costs, plan) = Costs::merge(left_costs, right_costs);
            (Binary::around(&left, &right, plan), costs)
        };
        nodes.push(node);
        stack.push((node, costs));
    }
    nodes.reverse();
    contract::set_cones(&mut nodes);
    nodes
}
