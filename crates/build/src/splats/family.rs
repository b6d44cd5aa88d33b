//! A family, as it is kept until it is written: the sizes of its groups, without their nodes.

use bytemuck::{Pod, Zeroable};

/// The groups that hang from the nodes of one group.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Family {
    /// Nodes of each of its up to four groups, four bits each, lowest first.
    sizes: u16,
    /// Distance from the model's root.
    pub(super) level: u16,
    /// How many of its groups have a family themselves.
    pub(super) links: u16,
}

impl Family {
    /// Without groups yet.
    pub(super) fn on_level(level: u16) -> Self {
        Self { level, ..Self::default() }
    }

    pub(super) fn push_group(&mut self, nodes: usize) {
        self.sizes |= (nodes as u16) << (4 * self.group_count());
    }

    pub(super) fn group_count(&self) -> usize {
        (16 - self.sizes.leading_zeros() as usize).div_ceil(4)
    }

    /// Nodes of each group.
    pub(super) fn groups(&self) -> impl Iterator<Item = u8> {
        let sizes = self.sizes;
        (0..self.group_count()).map(move |group| (sizes >> (4 * group) & 15) as u8)
    }

    pub(super) fn nodes(&self) -> usize {
        self.groups().map(usize::from).sum()
    }
}
