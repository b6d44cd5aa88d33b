//! What the page of a node holds.

use super::codec::{self, Model, Prepared};
use super::skeleton::{NodeId, Skeleton};
use crate::FormatError;

/// Triangles, points and lines of one node, decoded.
///
/// What always holds: indices are below the number of vertices; vertices come first in `positions`, `normals` and `colors`, points
/// after them; counts are those of the node's record.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Page {
    /// Of vertices, then of points: steps of the node's level, from its record's `min_steps`.
    pub positions: Vec<[u16; 3]>,
    /// Codes of unit normals on the octahedron, `normal_bits` for each coordinate: u | v << 16; one for each position.
    pub normals: Vec<u32>,
    /// Red, green, blue, 255; one for each position, or empty.
    pub colors: Vec<[u8; 4]>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Edges of just one triangle.
    pub borders: Vec<[u32; 2]>,
}

impl Page {
    /// Bytes that it keeps.
    pub fn resident_bytes(&self) -> usize {
        size_of::<Self>()
            + self.positions.len() * 6
            + self.normals.len() * 4
            + self.colors.len() * 4
            + self.triangles.len() * 12
            + self.borders.len() * 8
    }

    /// Edges of just one of these triangles, each as in its triangle, in their order. Sides whose ends are one vertex do not count.
    pub fn borders_of(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
        codec::borders_of(triangles)
    }

    /// Its bytes on disk under a model, and the page as [`Self::decode`] will give it: order and numbering change. The first so
    /// many positions are of vertices. Borders are found anew.
    ///
    /// # Panics
    /// As [`Prepared::new`].
    pub fn encode(&self, vertices: u32, normal_bits: u32, model: &Model) -> (Vec<u8>, Self) {
        let prepared = Prepared::new(self, vertices, normal_bits);
        (prepared.encode(model), prepared.into_page())
    }

    /// Decodes and checks what untrusted bytes say.
    ///
    /// # Errors
    /// [`FormatError::Invalid`].
    pub fn decode(bytes: &[u8], skeleton: &Skeleton, node: NodeId) -> Result<Self, FormatError> {
        codec::decode(bytes, skeleton.model(), skeleton.record(node), skeleton.root())
            .ok_or_else(|| FormatError::invalid(format!("page {node}"), "its code makes no sense"))
    }
}
