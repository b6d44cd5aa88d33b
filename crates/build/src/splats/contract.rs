//! Which binary nodes stay: the others give their children to their parent, so that each node has 2, 3 or 4.
//!
//! The paper combines nodes "to increase the average branching factor to approximately 4" and leaves open how. Here the
//! number of inner nodes is the least possible, by dynamic programming from the leaves up: `f(v, k)` is the number of inner
//! nodes needed below v when v itself is dissolved into k subtrees (k = 1: v stays, with 2–4 children). Equal costs go to the
//! more even split.

use super::tree::Binary;
use gigalod_geom::quantise::{cone, normal};

/// Least numbers of inner nodes of a subtree, as 1, 2 and 3 siblings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Costs([u32; 3]);

/// How to take a binary node apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Children when it stays: 2–4.
    children: u8,
    /// Of 3 subtrees: how many come from the left child (1 or 2).
    left_of_3: u8,
    /// Of 4 subtrees: how many come from the left child (1–3).
    left_of_4: u8,
}

impl Plan {
    /// Of a unit.
    pub(super) const NONE: Self = Self { children: 0, left_of_3: 0, left_of_4: 0 };

    pub(super) fn to_bytes(self) -> [u8; 3] {
        [self.children, self.left_of_3, self.left_of_4]
    }

    pub(super) fn of_bytes([children, left_of_3, left_of_4]: [u8; 3]) -> Self {
        Self { children, left_of_3, left_of_4 }
    }
}

/// No subtree of fewer leaves can be so many siblings. Small enough to add without overflow.
const IMPOSSIBLE: u32 = 1 << 30;

impl Costs {
    pub(super) const LEAF: Self = Self([0, IMPOSSIBLE, IMPOSSIBLE]);

    /// Costs and plan of the parent of two subtrees.
    pub(super) fn merge(left: Self, right: Self) -> (Self, Plan) {
        let cost = |from_left: usize, of: usize| left.0[from_left - 1].saturating_add(right.0[of - from_left - 1]);
        // `min_by_key` takes the first of equals.
        let best = |of: usize, choices: &[usize]| {
            choices
                .iter()
                .map(|from_left| (cost(*from_left, of), *from_left))
                .min_by_key(|(cost, _)| *cost)
                .expect("choices")
        };
        let two = cost(1, 2);
        let (three, left_of_3) = best(3, &[1, 2]);
        let (four, left_of_4) = best(4, &[2, 1, 3]);
        let (stays, children) =
            [(four, 4), (three, 3), (two, 2)].into_iter().min_by_key(|(cost, _)| *cost).expect("three choices");
        let plan = Plan { children, left_of_3: left_of_3 as u8, left_of_4: left_of_4 as u8 };
        (Self([(stays + 1).min(IMPOSSIBLE), two.min(IMPOSSIBLE), three.min(IMPOSSIBLE)]), plan)
    }
}

/// Indices of the children of a kept node, in tree order.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ChildList {
    indices: [u32; 4],
    count: u8,
}

impl ChildList {
    /// A group of one: the root's.
    pub(super) fn single(index: u32) -> Self {
        Self { indices: [index, 0, 0, 0], count: 1 }
    }

    /// The children of node `index`; none for a leaf.
    pub(super) fn of(nodes: &[Binary], index: usize) -> Self {
        let mut list = Self::default();
        let node = &nodes[index];
        if node.units > 1 {
            list.take_apart(nodes, index, node.plan.children);
        }
        list
    }

    fn take_apart(&mut self, nodes: &[Binary], index: usize, into: u8) {
        if into == 1 {
            self.indices[usize::from(self.count)] = index as u32;
            self.count += 1;
            return;
        }
        let plan = nodes[index].plan;
        let from_left = match into {
            2 => 1,
            3 => plan.left_of_3,
            _ => plan.left_of_4,
        };
        let left = index + 1;
        self.take_apart(nodes, left, from_left);
        self.take_apart(nodes, left + 2 * nodes[left].units as usize - 1, into - from_left);
    }

    pub(super) fn as_slice(&self) -> &[u32] {
        &self.indices[..usize::from(self.count)]
    }
}

/// Gives each kept inner node the narrowest cone that holds its children's cones as stored.
pub(super) fn set_cones(nodes: &mut [Binary]) {
    // Backwards through preorder: children before parents. Nodes that are not kept get a cone too; nobody reads it.
    for index in (0..nodes.len()).rev() {
        if nodes[index].units == 1 {
            continue;
        }
        let axis = normal::decode(nodes[index].normal);
        let mut cos_widest = 1.0_f32;
        for child in ChildList::of(nodes, index).as_slice() {
            let child = &nodes[*child as usize];
            cos_widest = cos_widest.min(cos_of_sum(axis.dot(normal::decode(child.normal)), cone::cosine(child.cone)));
        }
        nodes[index].cone = cone::encode(cos_widest);
    }
}

/// cos(α + β) from the cosines of α in [0°, 180°] and β in [0°, 90°) ∪ {180°}; −1 where the sum passes 180°.
fn cos_of_sum(cos_a: f32, cos_b: f32) -> f32 {
    // cos β ≥ −cos α ⇔ α + β ≤ 180°.
    if cos_b < 0.0 || cos_a < -cos_b {
        return -1.0;
    }
    let sin = |cos: f32| (1.0 - cos * cos).max(0.0).sqrt();
    cos_a * cos_b - sin(cos_a) * sin(cos_b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosines_of_sums_are_those_of_the_angles() {
        for a in 0..=180 {
            for b in (0..90).chain([180]) {
                let (a, b) = (f64::from(a).to_radians(), f64::from(b).to_radians());
                let expected = (a + b).min(std::f64::consts::PI).cos() as f32;
                let found = cos_of_sum(a.cos() as f32, b.cos() as f32);
                assert!((found - expected).abs() < 1e-3, "{a} {b}: {found} {expected}");
            }
        }
    }
}
