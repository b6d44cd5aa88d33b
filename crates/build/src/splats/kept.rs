//! The nodes of the hierarchy: those of the binary tree that stay, measured.
//!
//! A binary tree and its units go in; [`Kept`] nodes come out, with their true balls, *family by family*: the root; its children, a
//! group; then for each group its family, which is the groups of its nodes' children; and behind it all that hangs
//! from the first of these groups, then from the second, and so on. So whoever reads nodes in this order needs no pointer.

use super::contract::ChildList;
use super::measure::{Measured, Sums, Units};
use super::tree::Binary;
use bytemuck::{Pod, Zeroable};
use gigalod_format::splats::{Children, Node};
use gigalod_geom::Sphere;
use gigalod_geom::color::{rgb565_of_srgb8, srgb8_of_linear};
use gigalod_geom::quantise::cone;
use glam::Vec3;

/// A node of the hierarchy whose sphere is not quantised yet.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Kept {
    center: [f32; 3],
    radius: f32,
    normal: u16,
    cone: u8,
    /// Number of children, plus 128 where all are leaves.
    children: u8,
}

impl Kept {
    pub(super) fn new(sphere: &Sphere, normal: u16, cone: u8, children: Children) -> Self {
        let all_leaves = if children.all_leaves { 128 } else { 0 };
        let (center, radius) = (sphere.center.to_array(), sphere.radius);
        Self { center, radius, normal, cone, children: children.count | all_leaves }
    }

    pub(super) fn sphere(&self) -> Sphere {
        Sphere { center: Vec3::from_array(self.center), radius: self.radius }
    }

    pub(super) fn children(&self) -> Children {
        Children { count: self.children & 7, all_leaves: self.children & 128 != 0 }
    }

    /// Of a leaf.
    pub(super) fn become_parent_of_two_leaves(&mut self) {
        self.children = 2 | 128;
    }

    /// One of the children is no leaf any more.
    pub(super) fn not_all_leaves(&mut self) {
        self.children &= 127;
    }

    pub(super) fn pack(&self, code: u16) -> Node {
        Node::pack(code, self.normal, self.cone, self.children())
    }
}

/// What a tree's units are.
pub(super) trait UnitSource {
    /// The unit at a place in the order of the tree, as a node, and its sums.
    fn unit(&self, at: usize) -> (Kept, Sums);

    /// Its children and their colours, where they are to be listed with the tree.
    fn group_below(&self, _at: usize) -> (&[Kept], &[u16]) {
        (&[], &[])
    }
}

/// Nodes of a tree, family by family.
#[derive(Debug, Default)]
pub(super) struct KeptTree {
    pub(super) nodes: Vec<Kept>,
    /// 5-6-5, one for each node, or empty.
    pub(super) colors: Vec<u16>,
    /// For each unit the index of its node.
    pub(super) unit_nodes: Vec<u32>,
}

impl KeptTree {
    /// For each node the number of its first child, 0 for none, where the tree lists all that hangs from it.
    pub(super) fn first_children(&self) -> Vec<u32> {
        let mut first_children = vec![0; self.nodes.len()];
        // Groups whose families are still to come, the next one last.
        let mut stack = vec![(0, 1)];
        let mut next = 1;
        while let Some((first, count)) = stack.pop() {
            let from = stack.len();
            let group = first..first + count;
            for (node, first_child) in self.nodes[group.clone()].iter().zip(&mut first_children[group]) {
                let children = usize::from(node.children().count);
                if children > 0 {
                    *first_child = next as u32;
                    stack.push((next, children));
                    next += children;
                }
            }
            stack[from..].reverse();
        }
        first_children
    }
}

/// Lists and measures the nodes of a tree. `out` is overwritten; returns the root.
pub(super) fn keep(
    binaries: &[Binary],
    units: &Units,
    source: &impl UnitSource,
    has_colors: bool,
    out: &mut KeptTree,
) -> Measured {
    let count = binaries[0].units as usize;
    out.nodes.clear();
    out.colors.clear();
    out.unit_nodes.clear();
    out.unit_nodes.resize(count, 0);
    let mut keeper = Keeper { binaries, units, source, has_colors, out };
    let root = keeper.blanks(1);
    let sums = keeper.group(&Group { nodes: ChildList::single(0), first_unit: 0, first_node: root });
    units.node(0..count, sums)
}

struct Keeper<'a, S> {
    binaries: &'a [Binary],
    units: &'a Units,
    source: &'a S,
    has_colors: bool,
    out: &'a mut KeptTree,
}

/// Siblings.
#[derive(Clone, Copy)]
struct Group {
    nodes: ChildList,
    first_unit: usize,
    /// Where they are listed.
    first_node: usize,
}

impl<S: UnitSource> Keeper<'_, S> {
    fn blanks(&mut self, count: usize) -> usize {
        let first = self.out.nodes.len();
        self.out.nodes.resize(first + count, Kept::default());
        if self.has_colors {
            self.out.colors.resize(first + count, 0);
        }
        first
    }

    fn put(&mut self, at: usize, kept: Kept, sums: &Sums) {
        self.out.nodes[at] = kept;
        if self.has_colors {
            let srgb = sums.mean_color().to_array().map(srgb8_of_linear);
            self.out.colors[at] = rgb565_of_srgb8(srgb);
        }
    }

    /// Lists the family that hangs from a group, and what hangs from that; fills in the group's nodes. Returns their sums.
    fn group(&mut self, group: &Group) -> Sums {
        let mut below = [None; 4];
        let mut first_unit = group.first_unit;
        for (index, below) in group.nodes.as_slice().iter().zip(&mut below) {
            let index = *index as usize;
            let units = self.binaries[index].units as usize;
            if units > 1 {
                let nodes = ChildList::of(self.binaries, index);
                let first_node = self.blanks(nodes.as_slice().len());
                *below = Some(Group { nodes, first_unit, first_node });
            } else {
                let source = self.source;
                let (nodes, colors) = source.group_below(first_unit);
                self.out.nodes.extend_from_slice(nodes);
                if self.has_colors {
                    self.out.colors.extend_from_slice(colors);
                }
            }
            first_unit += units;
        }
        let mut all = Sums::NOTHING;
        let mut first_unit = group.first_unit;
        for (place, index) in group.nodes.as_slice().iter().enumerate() {
            let units = self.binaries[*index as usize].units as usize;
            let at = group.first_node + place;
            let sums = if let Some(below) = &below[place] {
                let sums = self.group(below);
                let node = self.units.node(first_unit..first_unit + units, sums);
                let children = below.first_node..below.first_node + below.nodes.as_slice().len();
                let all_leaves = self.out.nodes[children.clone()].iter().all(|child| child.children().count == 0);
                let children = Children { count: children.len() as u8, all_leaves };
                self.put(at, Kept::new(&node.sphere, node.normal, cone::encode(node.cos_spread), children), &sums);
                sums
            } else {
                let (kept, sums) = self.source.unit(first_unit);
                self.out.unit_nodes[first_unit] = at as u32;
                self.put(at, kept, &sums);
                sums
            };
            all = all.and(&sums);
            first_unit += units;
        }
        all
    }
}
