//! Chunks: the pieces a model is built in.
//!
//! A chunk is a subtree of at most [`MAX_LEAVES`] leaves whose parent has more. Its root always stays when nodes are merged, so
//! what a chunk becomes depends on nothing outside it but its root's decoded sphere; and as the limit is a constant, chunks are
//! the same whatever the memory, the threads, and the order of the input.
//!
//! Leaves go in; [`Kept`] nodes come out, family by family, with their true spheres.

use super::kept::{self, Kept, KeptTree, UnitSource};
use super::leaves::Leaf;
use super::measure::{Measured, Sums, Units};
use super::tree::{self, Binary, Points};
use bytemuck::{Pod, Zeroable};
use gigalod_format::splats::Children;
use gigalod_geom::Sphere;
use gigalod_geom::color::LINEAR_OF_SRGB8;
use gigalod_geom::quantise::{cone, normal};
use glam::Vec3;
use std::cell::RefCell;

/// Leaves of a chunk at most: 7 MB of work while it is built, and pages of its lower levels are well filled.
pub(super) const MAX_LEAVES: usize = 1 << 16;

/// A chunk, built.
pub(super) struct Raised {
    pub(super) nodes: Vec<Kept>,
    /// 5-6-5, one for each node, or empty.
    pub(super) colors: Vec<u16>,
    pub(super) head: Head,
}

/// What the tree on top knows of a chunk: its root, which is a unit there, and the root's children, which it lists.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Head {
    pub(super) root: Kept,
    group: [Kept; 4],
    /// Of the group.
    colors: [u16; 4],
    /// Of the root.
    pub(super) cos_spread: f32,
    pub(super) sums: Sums,
    pub(super) normal: u16,
    group_size: u16,
}

impl Head {
    fn of(root: &Measured, nodes: &[Kept], colors: &[u16]) -> Self {
        let group_size = usize::from(nodes[0].children().count);
        let mut head = Self {
            root: nodes[0],
            group: Default::default(),
            colors: Default::default(),
            cos_spread: root.cos_spread,
            sums: root.sums,
            normal: root.normal,
            group_size: group_size as u16,
        };
        head.group[..group_size].copy_from_slice(&nodes[1..=group_size]);
        if !colors.is_empty() {
            head.colors[..group_size].copy_from_slice(&colors[1..=group_size]);
        }
        head
    }

    pub(super) fn sphere(&self) -> Sphere {
        self.root.sphere()
    }

    /// The root's children and their colours.
    pub(super) fn group(&self) -> (&[Kept], &[u16]) {
        let size = usize::from(self.group_size);
        (&self.group[..size], &self.colors[..size])
    }
}

#[derive(Default)]
struct Work {
    leaves: Vec<Leaf>,
    binaries: Vec<Binary>,
    order: Vec<u32>,
    units: Units,
    tree: KeptTree,
}

thread_local! {
    /// Megabytes that the system would clear for each chunk anew.
    static WORK: RefCell<Work> = RefCell::default();
}

/// All leaves, and the order of the tree.
struct Leaves<'a> {
    leaves: &'a [Leaf],
    order: &'a [u32],
    has_colors: bool,
}

impl UnitSource for Leaves<'_> {
    fn unit(&self, at: usize) -> (Kept, Sums) {
        let leaf = &self.leaves[self.order[at] as usize];
        let sphere = leaf.sphere();
        let linear = || Vec3::from_array(leaf.color.map(|value| LINEAR_OF_SRGB8[usize::from(value)]));
        let color = if self.has_colors { linear() } else { Vec3::ZERO };
        let kept = Kept::new(&sphere, leaf.normal, cone::encode(leaf.cos_spread()), Children::NONE);
        (kept, Sums::of_leaf(&sphere, normal::decode(leaf.normal), color))
    }
}

/// Builds a chunk from its points, at least one; `all_leaves` are what they are numbers of.
pub(super) fn raise(mut points: Points<'_>, all_leaves: &[Leaf], has_colors: bool) -> Raised {
    WORK.with_borrow_mut(|Work { leaves, binaries, order, units, tree }| {
        points.take_leaves(all_leaves, leaves);
        tree::build(points, leaves, binaries, order);
        units.clear();
        for leaf in &*order {
            let leaf = &leaves[*leaf as usize];
            units.push(&leaf.sphere(), normal::decode(leaf.normal), leaf.cos_spread());
        }
        let root = kept::keep(binaries, units, &Leaves { leaves, order, has_colors }, has_colors, tree);
        let (nodes, colors) = (tree.nodes.clone(), tree.colors.clone());
        let head = Head::of(&root, &nodes, &colors);
        Raised { nodes, colors, head }
    })
}
