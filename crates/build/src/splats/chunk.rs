//! Chunks: the pieces a model is built in.
//!
//! A chunk is a subtree of at most [`MAX_LEAVES`] leaves whose parent has more. Its root always stays when nodes are merged, so
//! what a chunk becomes depends on nothing outside it but its root's decoded sphere; and as the limit is a constant, chunks are
//! the same whatever the memory, the threads, and the order of the input.
//!
//! Up: leaves go in, [`Kept`] nodes come out, breadth first, with their true spheres. Down: the same nodes go in, with the root's
//! decoded sphere, and their 32-bit forms come out in the same order.

use super::contract::{self, ChildList};
use super::leaves::Leaf;
use super::tree::{self, Binary};
use bytemuck::{Pod, Zeroable};
use gigalod_format::splats::{Children, Node};
use gigalod_geom::Sphere;
use gigalod_geom::color::{rgb565_of_srgb8, srgb8_of_linear};
use gigalod_geom::quantise::sphere;
use glam::Vec3;
use std::cell::RefCell;
use std::collections::VecDeque;

/// Leaves of a chunk at most: 7 MB of binary tree while it is built, and pages of its lower levels are well filled.
pub(super) const MAX_LEAVES: usize = 1 << 16;

/// A node of the hierarchy whose sphere is not quantised yet.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Kept {
    center: [f32; 3],
    radius: f32,
    normal: u16,
    cone: u8,
    /// Number of children, plus 128 where all are leaves.
    children: u8,
}

/// A chunk on the way up.
pub(super) struct Raised {
    /// As the tree above sees it: one unit.
    pub(super) root: Binary,
    /// Breadth first, the root first.
    pub(super) kept: Vec<Kept>,
    /// 5-6-5, one for each kept node, or empty.
    pub(super) colors: Vec<u16>,
}

/// A chunk on the way down.
pub(super) struct Lowered {
    /// The root's is not final: its code depends on its own parent.
    pub(super) nodes: Vec<Node>,
    /// Number of nodes on each level, the root's first.
    pub(super) levels: Vec<u32>,
    /// Largest decoded radius on each level.
    pub(super) radii: Vec<f32>,
    /// How far decoded spheres reach from the root's centre.
    pub(super) reach: f64,
    /// Largest reach of all its nodes, in units of their radius.
    pub(super) overhang: f64,
}

impl Kept {
    pub(super) fn of(nodes: &[Binary], index: usize) -> Self {
        let node = &nodes[index];
        let below = ChildList::of(nodes, index);
        let below = below.as_slice();
        let all_leaves = !below.is_empty() && below.iter().all(|child| nodes[*child as usize].weight == 1);
        Self {
            center: node.sphere.center.to_array(),
            radius: node.sphere.radius,
            normal: node.normal,
            cone: node.cone,
            children: below.len() as u8 | if all_leaves { 128 } else { 0 },
        }
    }

    fn sphere(&self) -> Sphere {
        Sphere { center: Vec3::from_array(self.center), radius: self.radius }
    }

    pub(super) fn children(&self) -> Children {
        Children { count: self.children & 7, all_leaves: self.children & 128 != 0 }
    }

    pub(super) fn pack(&self, code: u16) -> Node {
        Node::pack(code, self.normal, self.cone, self.children())
    }
}

/// The 5-6-5 colour of a mean in linear light.
pub(super) fn packed_color(linear: Vec3) -> u16 {
    rgb565_of_srgb8(linear.to_array().map(srgb8_of_linear))
}

thread_local! {
    /// The binary tree of the chunk in work: 7 MB that the system would clear for each chunk anew.
    static TREE: RefCell<Vec<Binary>> = const { RefCell::new(Vec::new()) };
}

/// Builds the tree of a chunk's leaves, and merges its nodes.
pub(super) fn raise(leaves: &mut [Leaf], has_colors: bool) -> Raised {
    TREE.with_borrow_mut(|nodes| {
        tree::build(leaves, nodes);
        contract::set_cones(nodes);
        keep(nodes, leaves.len(), has_colors)
    })
}

/// The nodes of a merged tree that stay.
fn keep(nodes: &[Binary], leaf_count: usize, has_colors: bool) -> Raised {
    let mut kept = Vec::with_capacity(leaf_count * 3 / 2);
    let mut colors = Vec::with_capacity(if has_colors { leaf_count * 3 / 2 } else { 0 });
    let mut queue = VecDeque::from([0u32]);
    while let Some(index) = queue.pop_front() {
        kept.push(Kept::of(nodes, index as usize));
        if has_colors {
            colors.push(packed_color(nodes[index as usize].mean_color));
        }
        queue.extend(ChildList::of(nodes, index as usize).as_slice());
    }
    Raised { root: Binary { units: 1, ..nodes[0] }, kept, colors }
}

/// Quantises a chunk's spheres, each relative to its decoded parent's.
pub(super) fn lower(kept: &[Kept], root: &Sphere) -> Lowered {
    let mut decoded = Vec::with_capacity(kept.len());
    decoded.push(*root);
    let mut nodes = Vec::with_capacity(kept.len());
    nodes.push(kept[0].pack(sphere::SELF));
    let (mut levels, mut radii) = (vec![1], vec![root.radius]);
    // Children follow in the order of their parents.
    let mut first_children = Vec::with_capacity(kept.len());
    let mut level_end = 1;
    for (index, parent) in kept.iter().enumerate() {
        if index == level_end {
            level_end = nodes.len();
        }
        let first = nodes.len();
        first_children.push(first as u32);
        for child in &kept[first..first + usize::from(parent.children().count)] {
            if nodes.len() == level_end {
                levels.push(0);
                radii.push(0.0);
            }
            let (code, ball) = sphere::encode(&decoded[index], &child.sphere());
            *levels.last_mut().expect("the root has a level") += 1;
            let widest = radii.last_mut().expect("the root has a level");
            *widest = widest.max(ball.radius);
            nodes.push(child.pack(code));
            decoded.push(ball);
        }
    }
    // Backwards: children before parents.
    let mut reach: Vec<f64> = decoded.iter().map(|ball| f64::from(ball.radius)).collect();
    let mut overhang = 1.0_f64;
    for index in (0..kept.len()).rev() {
        let first = first_children[index] as usize;
        for child in first..first + usize::from(kept[index].children().count) {
            let apart = f64::from(decoded[child].center.distance(decoded[index].center));
            reach[index] = reach[index].max(apart + reach[child]);
        }
        if decoded[index].radius > 0.0 {
            overhang = overhang.max(reach[index] / f64::from(decoded[index].radius));
        }
    }
    Lowered { nodes, levels, radii, reach: reach[0], overhang }
}
