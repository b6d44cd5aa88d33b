//! Which binary nodes stay: the others give their children to their parent, so that each node has 2, 3 or 4.
//!
//! The paper combines nodes "to increase the average branching factor to approximately 4" and leaves open how. Here the
//! number of inner nodes is the least possible, by dynamic programming from the leaves up: `f(v, k)` is the number of inner
//! nodes needed below v when v itself is dissolved into k subtrees (k = 1: v stays, with 2–4 children). Equal costs go to the
//! more even split.

use super::tree::Binary;

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
