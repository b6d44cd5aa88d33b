//! The binary tree: leaves are split at the midpoint of the longest axis of their bounding box, again and again (splats paper,
//! section 2.2, `BuildTree`).
//!
//! Nodes lie in preorder: the left child of node i is i + 1, the right one follows the left subtree, and a subtree of k
//! units takes 2k − 1 nodes. A unit is a leaf; in the tree on top of all chunks it is a chunk. The tree is a shape and nothing
//! else: what its nodes are like is measured once it is known which of them stay (`measure.rs`).
//!
//! Better than the paper: vertices in the same place, which no plane separates, are halved by number.

use super::contract::{Costs, Plan};
use super::leaves::Leaf;
use glam::Vec3A;

/// A node of the binary tree; some of them become nodes of the hierarchy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binary {
    /// Units below, leaves or whole chunks; 1 for a unit. Preorder is counted in these.
    pub(super) units: u32,
    /// How it and its descendants merge.
    pub(super) plan: Plan,
}

impl Binary {
    pub(super) const UNIT: Self = Self { units: 1, plan: Plan::NONE };
}

/// A leaf on its way to its place in the tree: 16 bytes, because it moves twenty times.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Point {
    center: [f32; 3],
    /// Which leaf.
    pub(super) leaf: u32,
}

/// Points of a set of leaves, and as much room again to sort them into.
#[derive(Debug)]
pub(super) struct Points<'a> {
    points: &'a mut [Point],
    room: &'a mut [Point],
    extent: Extent,
}

impl<'a> Points<'a> {
    fn new(points: &'a mut [Point], room: &'a mut [Point]) -> Self {
        let extent = Extent::of(points);
        Self { points, room, extent }
    }

    /// Of all leaves, in buffers that are kept for it.
    pub(super) fn of(leaves: &[Leaf], [points, room]: &'a mut [Vec<Point>; 2]) -> Self {
        let point = |(number, leaf): (usize, &Leaf)| Point { center: leaf.center, leaf: number as u32 };
        points.clear();
        points.extend(leaves.iter().enumerate().map(point));
        room.resize(leaves.len().max(room.len()), Point::default());
        Self::new(points, &mut room[..leaves.len()])
    }

    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// Copies their leaves to `out`, where they find them from now on.
    pub(super) fn take_leaves(&mut self, leaves: &[Leaf], out: &mut Vec<Leaf>) {
        out.clear();
        out.extend(self.points.iter().map(|point| leaves[point.leaf as usize]));
        for (number, point) in self.points.iter_mut().enumerate() {
            point.leaf = number as u32;
        }
    }

    /// Two halves, neither empty, of at least two points.
    pub(super) fn split(self, leaves: &[Leaf]) -> [Self; 2] {
        let Self { points, room, extent } = self;
        let Some(plane) = extent.plane() else {
            // All in one place: any order will do that does not depend on the one they came in.
            points.sort_unstable_by_key(|point| in_one_place(&leaves[point.leaf as usize]));
            let middle = points.len() / 2;
            let ((left, right), (left_room, right_room)) = (points.split_at_mut(middle), room.split_at_mut(middle));
            return [Self { points: left, room: left_room, extent }, Self { points: right, room: right_room, extent }];
        };
        // From the front to the front and to the back of the room, without a branch to mispredict.
        let (mut left, mut right) = (0, points.len());
        for point in &*points {
            let is_left = plane.is_left(point.center);
            room[left] = *point;
            room[right - 1] = *point;
            left += usize::from(is_left);
            right -= usize::from(!is_left);
        }
        let ((left, right), (left_room, right_room)) = (room.split_at_mut(left), points.split_at_mut(left));
        [Self::new(left, left_room), Self::new(right, right_room)]
    }
}

/// The order of leaves that no plane separates.
fn in_one_place(leaf: &Leaf) -> (u32, u16, u16, [u8; 3]) {
    (leaf.radius.to_bits(), leaf.normal, leaf.spread, leaf.color)
}

/// Puts leaves into the two halves that [`Points::split`] makes of them, where they lie; returns where the second one begins.
pub(super) fn split(leaves: &mut [Leaf]) -> usize {
    let extent = leaves.iter().fold(Extent::EMPTY, |extent, leaf| extent.including(leaf.center));
    let Some(plane) = extent.plane() else {
        leaves.sort_unstable_by_key(in_one_place);
        return leaves.len() / 2;
    };
    partition(leaves, |leaf| plane.is_left(leaf.center))
}

/// Puts those on the left before all others; returns how many they are.
pub(super) fn partition<T>(records: &mut [T], is_left: impl Fn(&T) -> bool) -> usize {
    let (mut low, mut high) = (0, records.len());
    loop {
        while low < high && is_left(&records[low]) {
            low += 1;
        }
        while low < high && !is_left(&records[high - 1]) {
            high -= 1;
        }
        if low >= high {
            return low;
        }
        records.swap(low, high - 1);
    }
}

/// Builds the tree of at least one leaf into `nodes`, replacing what they were, and puts the leaves' numbers into the order of the
/// tree.
pub(super) fn build(points: Points<'_>, leaves: &[Leaf], nodes: &mut Vec<Binary>, order: &mut Vec<u32>) {
    nodes.clear();
    order.clear();
    subtree(points, leaves, nodes, order);
}

fn subtree(points: Points<'_>, leaves: &[Leaf], nodes: &mut Vec<Binary>, order: &mut Vec<u32>) -> Costs {
    let at = nodes.len();
    nodes.push(Binary { units: points.points.len() as u32, plan: Plan::NONE });
    if let [point] = points.points {
        order.push(point.leaf);
        return Costs::LEAF;
    }
    if let [a, b] = points.points
        && let Some(plane) = points.extent.plane()
    {
        // Half of all splits.
        let [left, right] = if plane.is_left(a.center) { [a.leaf, b.leaf] } else { [b.leaf, a.leaf] };
        order.extend([left, right]);
        let (costs, plan) = Costs::merge(Costs::LEAF, Costs::LEAF);
        nodes[at].plan = plan;
        nodes.extend([Binary::UNIT; 2]);
        return costs;
    }
    let [left, right] = points.split(leaves);
    let left_costs = subtree(left, leaves, nodes, order);
    let (costs, plan) = Costs::merge(left_costs, subtree(right, leaves, nodes, order));
    nodes[at].plan = plan;
    costs
}

/// The box around centres of leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    fn of(points: &[Point]) -> Self {
        points.iter().fold(Self::EMPTY, |extent, point| extent.including(point.center))
    }

    #[inline(always)]
    pub(super) fn including(self, center: [f32; 3]) -> Self {
        let center = Vec3A::from_array(center);
        Self { min: self.min.min(center), max: self.max.max(center) }
    }

    /// The plane at the midpoint of the longest axis; none where all is in one place. Neither side of it is empty.
    pub(super) fn plane(&self) -> Option<Plane> {
        let (min, max) = (self.min.to_array(), self.max.to_array());
        let extent = (self.max - self.min).to_array();
        let axis = if extent[0] >= extent[1] && extent[0] >= extent[2] {
            0
        } else if extent[1] >= extent[2] {
            1
        } else {
            2
        };
        // Rounding may put the midpoint of two neighbouring numbers on the upper one: then that one alone goes right.
        let middle = min[axis] + extent[axis] * 0.5;
        (extent[axis] > 0.0).then_some(Plane { axis, last_left: middle.min(max[axis].next_down()) })
    }
}

/// Separates leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    axis: usize,
    last_left: f32,
}

impl Plane {
    #[inline(always)]
    pub(super) fn is_left(&self, center: [f32; 3]) -> bool {
        center[self.axis] <= self.last_left
    }
}
