//! The octree of what fits into memory, from the bottom up.
//!
//! In: triangles of one cell. Out: all nodes of that cell and below, and the cell's patch, for the node above.
//!
//! The paper gathers what was simplified two levels below. Here a node gathers its children's patches, whose faces carry their own proven
//! errors, and goes on from there: half the work, and no error is counted that there is not.

use super::cell::Cell;
use super::cut::cut;
use super::patch::{Face, Patch, Vertex};
use super::round::{self, Made};
use super::simplify::{Limit, simplify};
use super::{Shape, points, weld, zip};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// A triangle with all that belongs to it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Piece {
    /// Of its corners; local space.
    pub(super) at: [[f32; 3]; 3],
    /// Octahedral, 16 bits for each coordinate.
    pub(super) normals: [[u16; 2]; 3],
    /// Red, green, blue; 0 where there are none.
    pub(super) colors: [[u8; 3]; 3],
    /// How often it was cut: each time moves its corners by as much as reading did.
    pub(super) cuts: u8,
    pub(super) unused: [u8; 2],
}

impl Piece {
    /// Where it lies: the middle of its corners.
    pub(super) fn middle(&self) -> DVec3 {
        self.at.iter().map(|at| Vec3::from_array(*at).as_dvec3()).sum::<DVec3>() / 3.0
    }
}

/// A cell that is done.
pub(super) struct Raised {
    pub(super) patch: Patch,
    /// Of the cell and all below.
    pub(super) nodes: Vec<Made>,
}

/// Is told how many pieces are in leaves.
pub(super) struct Told<'a> {
    done: AtomicU64,
    tell: &'a (dyn Fn(u64) + Sync),
}

impl<'a> Told<'a> {
    pub(super) fn new(tell: &'a (dyn Fn(u64) + Sync)) -> Self {
        Self { done: AtomicU64::new(0), tell }
    }

    fn add(&self, pieces: usize) {
        let pieces = pieces as u64;
        (self.tell)(self.done.fetch_add(pieces, Ordering::Relaxed) + pieces);
    }
}

/// Raises a cell.
pub(super) fn raise(pieces: Vec<Piece>, cell: Cell, shape: &Shape, told: &Told<'_>) -> Raised {
    let may_split = |pieces: &[Piece]| {
        let large = pieces.iter().filter(|piece| is_large(piece, cell, shape)).count();
        cell.level < shape.deepest() && may_cut(large, pieces.len())
    };
    if pieces.len() <= shape.most_triangles || !may_split(&pieces) {
        told.add(pieces.len());
        return leaf(&pieces, cell, shape);
    }
    let sets = split(&pieces, cell, shape);
    drop(pieces);
    let children: Vec<Raised> = sets
        .into_par_iter()
        .enumerate()
        .filter(|(_, pieces)| !pieces.is_empty())
        .map(|(octant, pieces)| raise(pieces, cell.child(octant as u8), shape, told))
        .collect();
    join(children, cell, shape)
}

/// True for a triangle that is too large for an eighth of the cell, whose places are counted from there in a few bits.
pub(super) fn is_large(piece: &Piece, cell: Cell, shape: &Shape) -> bool {
    const MOST_EDGES: f64 = 8.0;
    /// A node's places fit into 16 bits where its triangles are at most so many steps long.
    const MOST_STEPS: f64 = 16_384.0;
    let edges = MOST_EDGES.min(MOST_STEPS / f64::from(1u32 << shape.cell_bits));
    let most = (edges * cell.child(0).edge(shape.edge)) as f32;
    let [a, b, c] = piece.at.map(Vec3::from_array);
    (a.max(b).max(c) - a.min(b).min(c)).max_element() > most
}

/// False where too many of the pieces would be cut: cutting makes more of them, and splitting is to leave fewer in each cell.
pub(super) fn may_cut(large: usize, all: usize) -> bool {
    const LEAST_OTHERS: usize = 15;
    large * (LEAST_OTHERS + 1) <= all
}

/// Pieces of each eighth, in their order; those that are too large are cut.
pub(super) fn split(pieces: &[Piece], cell: Cell, shape: &Shape) -> [Vec<Piece>; 8] {
    let middle = cell.middle(shape.edge);
    let mut sets: [Vec<Piece>; 8] = Default::default();
    for piece in pieces {
        if is_large(piece, cell, shape) {
            cut(piece, middle, |octant, part| sets[usize::from(octant)].push(part));
        } else {
            sets[usize::from(Cell::octant(middle, piece.middle()))].push(*piece);
        }
    }
    sets
}

/// The leaf of a cell. Where triangles are large, the grid of the cell's level is coarse beside what is finer elsewhere, and so is the
/// root's for anything: then the leaf lies deeper, as far as its places fit into a node, below nodes with one child each.
fn leaf(pieces: &[Piece], cell: Cell, shape: &Shape) -> Raised {
    let mut path = vec![cell];
    for _ in 0..levels_deeper(pieces, cell, shape) {
        let above = path[path.len() - 1];
        path.push(above.child(Cell::octant(above.middle(shape.edge), pieces[0].middle())));
    }
    let patch = weld::patch_of(pieces, shape.rounding());
    let made = round::round(&patch, path[path.len() - 1], shape, round::Place::Leaf);
    let deepest = Raised { patch, nodes: vec![made] };
    path.iter().rev().skip(1).fold(deepest, |raised, above| join(vec![raised], *above, shape))
}

fn levels_deeper(pieces: &[Piece], cell: Cell, shape: &Shape) -> u32 {
    /// Parts of the edge of a cell.
    const LARGE: f64 = 0.5;
    /// A node has room for 2^16 steps; some are for what rounding puts aside.
    const MOST_STEPS: f64 = 65_000.0;
    let box_of = |corners: &[[f32; 3]]| {
        let at = || corners.iter().map(|at| Vec3::from_array(*at));
        (at().fold(Vec3::INFINITY, Vec3::min), at().fold(Vec3::NEG_INFINITY, Vec3::max))
    };
    let extent = |(low, high): (Vec3, Vec3)| f64::from((high - low).max_element());
    let largest = pieces.iter().map(|piece| extent(box_of(&piece.at))).fold(0.0, f64::max);
    if largest <= LARGE * cell.edge(shape.edge) && cell != Cell::ROOT {
        return 0;
    }
    let boxes = pieces.iter().map(|piece| box_of(&piece.at));
    let all = boxes.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |all, one| (all.0.min(one.0), all.1.max(one.1)));
    let deeper = (MOST_STEPS * shape.step(cell.level) / extent(all)).log2().floor().max(0.0) as u32;
    deeper.min(shape.deepest().saturating_sub(cell.level))
}

/// The node of a cell whose children are done.
pub(super) fn join(children: Vec<Raised>, cell: Cell, shape: &Shape) -> Raised {
    let mut nodes = Vec::with_capacity(children.iter().map(|child| child.nodes.len()).sum::<usize>() + 1);
    let mut patches = Vec::with_capacity(children.len());
    for mut child in children {
        nodes.append(&mut child.nodes);
        patches.push(child.patch);
    }
    let limit = shape.limit(cell.level);
    let mut patch = weld::gather(patches);
    zip::zip(&mut patch, limit);
    smooth(&mut patch, limit);
    let mut patch = simplify(patch, Limit { error: limit, keeps_looks: shape.keeps_looks });
    points::shrink(&mut patch, limit);
    nodes.push(round::round(&patch, cell, shape, round::Place::Above));
    Raised { patch, nodes }
}

/// Normals of vertices of which all triangles are smaller than the error become those of their surroundings: what is too small to be
/// seen would flicker (hybrid paper, section 3.1).
fn smooth(patch: &mut Patch, limit: f64) {
    let Patch { vertices, faces, .. } = patch;
    let mut is_small = vec![true; vertices.len()];
    let mut sums = vec![Vec3::ZERO; vertices.len()];
    let length = |a: &Vertex, b: &Vertex| (a.at - b.at).length();
    for Face { corners, .. } in faces.iter() {
        let [a, b, c] = corners.map(|corner| &vertices[corner as usize]);
        let is_large = length(a, b).max(length(b, c)).max(length(c, a)) >= limit;
        let doubled = (b.at - a.at).cross(c.at - a.at).length() as f32;
        let sum = (a.normal + b.normal + c.normal) * doubled;
        for corner in corners {
            is_small[*corner as usize] &= !is_large;
            sums[*corner as usize] += sum;
        }
    }
    for ((vertex, is_small), sum) in vertices.iter_mut().zip(is_small).zip(sums) {
        if is_small {
            vertex.normal = sum.try_normalize().unwrap_or(vertex.normal);
        }
    }
}
