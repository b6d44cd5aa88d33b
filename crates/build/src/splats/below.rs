//! Codes of inner nodes, against the leaves below them.
//!
//! Kept nodes go in, and which are whose children; for one of them at a time, and its decoded parent, the code comes out.
//!
//! Better than the paper, which encodes a node's ball: what a code must enclose are the leaves, and a ball around them is in most
//! directions larger than they are. Of the smallest size that has a place for them the place nearest to their middle is taken.
//!
//! What always holds: the decoded ball encloses all leaves below the node if the decoded parent does.

use super::kept::Kept;
use gigalod_geom::Sphere;
use gigalod_geom::quantise::around::Around;
use gigalod_geom::quantise::sphere;
use glam::Vec3;
use std::ops::Range;

/// Nodes of a tree.
pub(super) struct Below<'a> {
    nodes: &'a [Kept],
    /// Where the children of each begin, 0 for none.
    first_children: &'a [u32],
}

/// Nodes that are still to be looked at.
#[derive(Default)]
pub(super) struct Stack(Vec<u32>);

impl<'a> Below<'a> {
    pub(super) fn new(nodes: &'a [Kept], first_children: &'a [u32]) -> Self {
        Self { nodes, first_children }
    }

    fn sphere(&self, at: u32) -> Sphere {
        self.nodes[at as usize].sphere()
    }

    fn children(&self, at: u32) -> Range<u32> {
        let first = self.first_children[at as usize];
        first..first + u32::from(self.nodes[at as usize].children().count)
    }

    /// The code of inner node `at` under its decoded parent, and its decoded ball.
    pub(super) fn encode(&self, at: u32, parent: &Sphere, stack: &mut Stack) -> (u16, Sphere) {
        let node = &self.nodes[at as usize];
        let mut around = Around::new(parent, node.sphere().center);
        let is_low = |at: u32| self.first_children[at as usize] == 0 || self.nodes[at as usize].children().all_leaves;
        if node.children().all_leaves {
            self.include_children(at, &mut around);
        } else if self.children(at).all(is_low) {
            self.include_children(at, &mut around);
            self.children(at).for_each(|child| self.include_children(child, &mut around));
        } else {
            self.include_farthest(at, &mut around);
        }
        while let Some((code, ball)) = around.best() {
            let Some(leaf) = self.outside(at, &ball, stack) else { return (code, ball) };
            around.include(&self.sphere(leaf));
            around.reject();
        }
        (sphere::SELF, *parent)
    }

    /// Those of a node's children that are leaves.
    #[inline(always)]
    fn include_children(&self, at: u32, around: &mut Around) {
        for child in self.children(at) {
            if self.first_children[child as usize] == 0 {
                around.include(&self.sphere(child));
            }
        }
    }

    /// Leaves that are far out, one for each octant.
    fn include_farthest(&self, at: u32, around: &mut Around) {
        for direction in 0..8 {
            let sign = |bit: u32| if direction >> bit & 1 == 0 { -0.577_350_26 } else { 0.577_350_26 };
            let direction = Vec3::new(sign(0), sign(1), sign(2));
            let mut farthest = at;
            while self.first_children[farthest as usize] > 0 {
                let reach = |child: u32| {
                    let ball = self.sphere(child);
                    (ball.center.dot(direction) + ball.radius, child)
                };
                let farther = |a: (f32, u32), b: (f32, u32)| if b.0 > a.0 { b } else { a };
                let children = self.children(farthest).map(reach);
                farthest = children.reduce(farther).map_or(farthest, |(_, child)| child);
            }
            around.include(&self.sphere(farthest));
        }
    }

    /// A leaf below a node that `ball` does not enclose.
    fn outside(&self, at: u32, ball: &Sphere, Stack(stack): &mut Stack) -> Option<u32> {
        stack.clear();
        stack.extend(self.children(at));
        while let Some(at) = stack.pop() {
            // What encloses a node's true ball encloses all leaves below.
            if ball.encloses(&self.sphere(at)) {
                continue;
            }
            if self.first_children[at as usize] == 0 {
                return Some(at);
            }
            stack.extend(self.children(at));
        }
        None
    }
}
