//! The binary tree: leaves are split at the midpoint of the longest axis of their bounding box, again and again, and each
//! node gets the smallest sphere around its two children's and the mean of their attributes (splats paper, section 2.2,
//! `BuildTree`).
//!
//! Nodes lie in preorder: the left child of node i is i + 1, the right one follows the left subtree, and a subtree of k
//! leaves takes 2k − 1 nodes. Subtrees are disjoint slices, so they build in parallel without locks.
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
    /// Leaves below; 1 for a leaf.
    pub(super) leaves: u32,
    /// Code of the normal as stored.
    pub(super) normal: u16,
    /// Code of the sphere relative to the decoded parent.
    pub(super) code: u16,
    /// Code of the cone.
    pub(super) cone: u8,
    /// How it and its descendants merge.
    pub(super) plan: Plan,
}

/// Below this many leaves a subtree is not worth a task of its own.
const TASK_LEAVES: usize = 4096;

/// Builds the tree; `leaves` are reordered.
pub(super) fn build(leaves: &mut [Leaf]) -> Vec<Binary> {
    let blank = Binary {
        sphere: Sphere { center: Vec3::ZERO, radius: 0.0 },
        mean_normal: Vec3::ZERO,
        mean_color: Vec3::ZERO,
        leaves: 0,
        normal: 0,
        code: 0,
        cone: 0,
        plan: Plan::default(),
    };
    let mut nodes = vec![blank; leaves.len() * 2 - 1];
    subtree(leaves, &mut nodes);
    nodes
}

fn subtree(leaves: &mut [Leaf], nodes: &mut [Binary]) -> Costs {
    let (node, below) = nodes.split_first_mut().expect("a subtree has at least one node");
    if let [leaf] = leaves {
        node.sphere = leaf.sphere;
        node.mean_normal = normal::decode(leaf.normal);
        node.mean_color = Vec3::from_array(leaf.color.map(|value| LINEAR_OF_SRGB8[usize::from(value)]));
        node.leaves = 1;
        node.normal = leaf.normal;
        node.cone = leaf.cone;
        return Costs::LEAF;
    }
    let middle = split(leaves);
    let parallel = leaves.len() > TASK_LEAVES;
    let (left_leaves, right_leaves) = leaves.split_at_mut(middle);
    let (left, right) = below.split_at_mut(2 * middle - 1);
    let (left_costs, right_costs) = if parallel {
        rayon::join(|| subtree(left_leaves, left), || subtree(right_leaves, right))
    } else {
        (subtree(left_leaves, left), subtree(right_leaves, right))
    };
    let (left, right) = (&left[0], &right[0]);
    let share = right.leaves as f32 / (left.leaves + right.leaves) as f32;
    node.sphere = Sphere::around(&left.sphere, &right.sphere);
    node.mean_normal = left.mean_normal.lerp(right.mean_normal, share);
    node.mean_color = left.mean_color.lerp(right.mean_color, share);
    node.leaves = left.leaves + right.leaves;
    let direction = [node.mean_normal, left.mean_normal, Vec3::Y].into_iter().find(|n| *n != Vec3::ZERO);
    node.normal = normal::encode(direction.unwrap_or(Vec3::Y));
    let (costs, plan) = Costs::merge(left_costs, right_costs);
    node.plan = plan;
    costs
}

/// Reorders the leaves into two halves, neither empty; returns where the second begins.
fn split(leaves: &mut [Leaf]) -> usize {
    let (min, max) = leaves.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), leaf| {
        (min.min(leaf.sphere.center), max.max(leaf.sphere.center))
    });
    let extent = max - min;
    let axis = if extent.x >= extent.y && extent.x >= extent.z {
        0
    } else if extent.y >= extent.z {
        1
    } else {
        2
    };
    if extent[axis] <= 0.0 {
        // All in one place: any order will do that does not depend on the one they came in.
        leaves.sort_unstable_by_key(|leaf| (leaf.sphere.radius.to_bits(), leaf.normal, leaf.cone, leaf.color));
        return leaves.len() / 2;
    }
    // Rounding may put the midpoint of two neighbouring numbers on the upper one: then that one alone goes right.
    let middle = min[axis] + extent[axis] * 0.5;
    let last_left = middle.min(max[axis].next_down());
    partition(leaves, |leaf| leaf.sphere.center[axis] <= last_left)
}

/// Moves the elements that `belongs_left` in front of the others; returns their number.
fn partition<T>(elements: &mut [T], belongs_left: impl Fn(&T) -> bool) -> usize {
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
