//! Cells of the octree: cubes, each an eighth of the one above.

use glam::DVec3;

/// Deepest level that there is: what then still lies together stays together.
pub(super) const MOST_LEVEL: u32 = 18;

/// A cube of the octree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Cell {
    /// 0 is the root.
    pub(super) level: u32,
    /// Three bits for each level, z y x, the root's children first: cells of a level in this order are in the order of the file.
    pub(super) code: u64,
}

impl Cell {
    pub(super) const ROOT: Self = Self { level: 0, code: 0 };

    /// One of eight.
    pub(super) fn child(self, octant: u8) -> Self {
        Self { level: self.level + 1, code: self.code << 3 | u64::from(octant) }
    }

    /// The cell that it is an eighth of; the root's is itself.
    pub(super) fn parent(self) -> Self {
        Self { level: self.level.saturating_sub(1), code: self.code >> 3 }
    }

    /// Smallest corner, in edges of a cell of this level.
    fn corner(self) -> [u32; 3] {
        let mut corner = [0; 3];
        for level in 0..self.level {
            let octant = self.code >> (3 * level) & 7;
            for (axis, value) in corner.iter_mut().enumerate() {
                *value |= ((octant >> axis & 1) as u32) << level;
            }
        }
        corner
    }

    /// Length of its edge, where the root's is `root_edge`.
    pub(super) fn edge(self, root_edge: f64) -> f64 {
        root_edge / (1u64 << self.level) as f64
    }

    /// Where its eighths meet; local space.
    pub(super) fn middle(self, root_edge: f64) -> DVec3 {
        let edge = self.edge(root_edge);
        DVec3::from_array(self.corner().map(|corner| (f64::from(corner) + 0.5) * edge))
    }

    /// The eighth of a cell with this middle that a point lies in.
    pub(super) fn octant(middle: DVec3, at: DVec3) -> u8 {
        u8::from(at.x >= middle.x) | u8::from(at.y >= middle.y) << 1 | u8::from(at.z >= middle.z) << 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_lie_in_their_parents() {
        let cell = Cell::ROOT.child(5).child(2).child(7);
        assert_eq!(cell.parent().parent(), Cell::ROOT.child(5));
        let middle = cell.middle(8.0);
        // 5: x and z; 2: y; 7: all.
        assert_eq!(middle, DVec3::new(4.0 + 1.0 + 0.5, 2.0 + 1.0 + 0.5, 4.0 + 1.0 + 0.5));
        let mut at = Cell::ROOT;
        for _ in 0..3 {
            at = at.child(Cell::octant(at.middle(8.0), middle));
        }
        assert_eq!(at, cell);
    }
}
