//! The binary tree: leaves are split at the midpoint of the longest axis of their bounding box, again and again, and each
//! node gets the smallest sphere around its two children's and the mean of their attributes (splats paper, section 2.2,
//! `BuildTree`).
//!
//! Nodes lie in preorder: the left child of node i is i + 1, the right one follows the left subtree, and a subtree of k
//! units takes 2k − 1 nodes. A unit is a leaf; in the tree on top of all chunks it is a chunk.
//!
//! Better than the paper: means are weighted by the number of leaves, so a lone vertex does not outweigh a hundred others;
//! colours are averaged in linear light; vertices in the same place, which no plane separates, are halved by number.

use super::contract::{Costs, Plan};
use super::leaves::Leaf;
use gigalod_geom::Sphere;
use gigalod_geom::color::LINEAR_OF_SRGB8;
use gigalod_geom::quantise::normal;
use glam::Vec3;

/// A node of the binary tree; some of them become nodes of the hierarchy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binary {
    /// True sphere; after quantisation the decoded one, for nodes that are kept.
    pub(super) sphere: Sphere,
    /// Mean of the leaves' unit normals; its length tells how much they agree.
    pub(super) mean_normal: Vec3,
    /// Mean of the leaves' colours, in linear light.
    pub(super) mean_color: Vec3,
    /// Units below, leaves or whole chunks; 1 for a unit. Preorder is counted in these.
    pub(super) units: u32,
    /// Leaves of the hierarchy below.
    pub(super) weight: u32,
    /// Code of the normal as stored.
    pub(super) normal: u16,
    /// Code of the sphere relative to the decoded parent.
    pub(super) code: u16,
    /// Code of the cone.
    pub(super) cone: u8,
    /// How it and its descendants merge.
    pub(super) plan: Plan,
}

impl Binary {
    const BLANK: Self = Self {
        sphere: Sphere { center: Vec3::ZERO, radius: 0.0 },
        mean_normal: Vec3::ZERO,
        mean_color: Vec3::ZERO,
        units: 0,
        weight: 0,
        normal: 0,
        code: 0,
        cone: 0,
        plan: Plan::NONE,
    };

    fn of_leaf(leaf: &Leaf) -> Self {
        Self {
            sphere: leaf.sphere(),
            mean_normal: normal::decode(leaf.normal),
            mean_color: Vec3::from_array(leaf.color.map(|value| LINEAR_OF_SRGB8[usize::from(value)])),
            units: 1,
            weight: 1,
            normal: leaf.normal,
            cone: leaf.cone,
            ..Self::BLANK
        }
    }

    /// The parent of two nodes; its cone is still to come.
    pub(super) fn around(left: &Self, right: &Self, plan: Plan) -> Self {
        let share = right.weight as f32 / (left.weight + right.weight) as f32;
        let mean_normal = left.mean_normal.lerp(right.mean_normal, share);
        let direction = [mean_normal, left.mean_normal, Vec3::Y].into_iter().find(|n| *n != Vec3::ZERO);
        Self {
            sphere: Sphere::around(&left.sphere, &right.sphere),
            mean_normal,
            mean_color: left.mean_color.lerp(right.mean_color, share),
            units: left.units + right.units,
            weight: left.weight + right.weight,
            normal: normal::encode(direction.unwrap_or(Vec3::Y)),
            plan,
            ..Self::BLANK
        }
    }
}

/// Builds the tree of at least one leaf into `nodes`, replacing what they were; `leaves` are reordered.
pub(super) fn build(leaves: &mut [Leaf], nodes: &mut Vec<Binary>) {
    nodes.clear();
    nodes.resize(leaves.len() * 2 - 1, Binary::BLANK);
    let extent = leaves.iter().fold(Extent::EMPTY, Extent::including);
    subtree(leaves, extent, nodes);
}

fn subtree(leaves: &mut [Leaf], extent: Extent, nodes: &mut [Binary]) -> Costs {
    let (node, below) = nodes.split_first_mut().expect("a subtree has at least one node");
    if let [leaf] = leaves {
        *node = Binary::of_leaf(leaf);
        return Costs::LEAF;
    }
    let (middle, [left_extent, right_extent]) = split(leaves, extent);
    let (left_leaves, right_leaves) = leaves.split_at_mut(middle);
    let (left, right) = below.split_at_mut(2 * middle - 1);
    let left_costs = subtree(left_leaves, left_extent, left);
    let (costs, plan) = Costs::merge(left_costs, subtree(right_leaves, right_extent, right));
    *node = Binary::around(&left[0], &right[0], plan);
    costs
}

/// The box around centres of leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) min: Vec3,
    pub(super) max: Vec3,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    pub(super) fn including(self, leaf: &Leaf) -> Self {
        let center = Vec3::from_array(leaf.center);
        Self { min: self.min.min(center), max: self.max.max(center) }
    }

    /// The plane at the midpoint of the longest axis; none where all is in one place. Neither side of it is empty.
    pub(super) fn plane(&self) -> Option<Plane> {
        let extent = self.max - self.min;
        let axis = if extent.x >= extent.y && extent.x >= extent.z {
            0
        } else if extent.y >= extent.z {
            1
        } else {
            2
        };
        // Rounding may put the midpoint of two neighbouring numbers on the upper one: then that one alone goes right.
        let middle = self.min[axis] + extent[axis] * 0.5;
        (extent[axis] > 0.0).then_some(Plane { axis, last_left: middle.min(self.max[axis].next_down()) })
    }
}

/// Separates leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    axis: usize,
    last_left: f32,
}

impl Plane {
    pub(super) fn is_left(&self, leaf: &Leaf) -> bool {
        leaf.center[self.axis] <= self.last_left
    }
}

/// Reorders the leaves, whose box is `extent`, into two halves, neither empty; returns where the second begins, and their boxes.
pub(super) fn split(leaves: &mut [Leaf], extent: Extent) -> (usize, [Extent; 2]) {
    let Some(plane) = extent.plane() else {
        // All in one place: any order will do that does not depend on the one they came in.
        leaves.sort_unstable_by_key(|leaf| (leaf.radius.to_bits(), leaf.normal, leaf.cone, leaf.color));
        return (leaves.len() / 2, [extent; 2]);
    };
    let mut halves = [Extent::EMPTY; 2];
    let middle = partition(leaves, |leaf| {
        let is_left = plane.is_left(leaf);
        let half = &mut halves[usize::from(!is_left)];
        *half = half.including(leaf);
        is_left
    });
    (middle, halves)
}

/// Moves the elements that `belongs_left` in front of the others; returns their number.
fn partition<T>(elements: &mut [T], mut belongs_left: impl FnMut(&T) -> bool) -> usize {
    let (mut low, mut high) = (0, elements.len());
    loop {
        while low < high && belongs_left(&elements[low]) {
            low += 1;
        }
        while low < high && !belongs_left(&elements[high - 1]) {
            high -= 1;
        }
        if low >= high {
            return low;
        }
        elements.swap(low, high - 1);
    }
}
