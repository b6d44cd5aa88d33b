//! One node in 32 bits.
//!
//! ```text
//! bit 31          19 18          5 4    3 2      1 0
//!     │ sphere (13) │ normal (14) │ cone │ children │ all children are leaves │
//! ```
//! The paper's figure 2c; the order of the fields is ours.

/// A node as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(transparent)]
pub struct Node(pub u32);

/// The tree structure at a node: 3 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Children {
    /// 0, 2, 3 or 4: there are no single children.
    pub count: u8,
    /// True when none of them has children; false for a leaf.
    pub all_leaves: bool,
}

impl Children {
    /// A leaf's.
    pub const NONE: Self = Self { count: 0, all_leaves: false };

    /// Words that the group of children takes in a decoded page: nodes, and a pointer unless all are leaves.
    pub fn words(self) -> u32 {
        match self.count {
            0 => 0,
            count => u32::from(count) + u32::from(!self.all_leaves),
        }
    }
}

impl Node {
    /// Packs the fields: `sphere` < 7621, `normal` < 16224, `cone` < 4.
    pub fn pack(sphere: u16, normal: u16, cone: u8, children: Children) -> Self {
        debug_assert!(sphere < 1 << 13 && normal < 1 << 14 && cone < 4 && children.count != 1 && children.count <= 4);
        let count = u32::from(children.count.saturating_sub(1));
        Self(
            u32::from(sphere) << 19
                | u32::from(normal) << 5
                | u32::from(cone) << 3
                | count << 1
                | u32::from(children.all_leaves),
        )
    }

    /// The same where not all children are leaves.
    pub fn with_inner_children(self) -> Self {
        Self(self.0 & !1)
    }

    /// Code of [`gigalod_geom::quantise::sphere`].
    pub fn sphere(self) -> u16 {
        (self.0 >> 19) as u16
    }

    /// Code of [`gigalod_geom::quantise::normal`].
    pub fn normal(self) -> u16 {
        (self.0 >> 5 & 0x3fff) as u16
    }

    /// Code of [`gigalod_geom::quantise::cone`].
    pub fn cone(self) -> u8 {
        (self.0 >> 3 & 3) as u8
    }

    /// Number and nature of the children.
    pub fn children(self) -> Children {
        let code = (self.0 >> 1 & 3) as u8;
        if code == 0 { Children::NONE } else { Children { count: code + 1, all_leaves: self.0 & 1 != 0 } }
    }

    /// True when there are no children.
    pub fn is_leaf(self) -> bool {
        self.0 & 6 == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_come_back_and_use_all_bits() {
        for children in
            [Children::NONE, Children { count: 2, all_leaves: true }, Children { count: 4, all_leaves: false }]
        {
            let node = Node::pack(7620, 16_223, 3, children);
            assert_eq!((node.sphere(), node.normal(), node.cone(), node.children()), (7620, 16_223, 3, children));
            assert_eq!(node.is_leaf(), children.count == 0);
        }
        assert_eq!(Node::pack(1, 0, 0, Children::NONE).0, 1 << 19);
        assert_eq!(Node::pack(0, 1, 2, Children { count: 3, all_leaves: true }).0, 0b11_0101 | 1 << 4);
    }
}
