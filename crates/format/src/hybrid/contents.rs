//! What the page of a node holds, and its plain bytes.

use super::skeleton::{NodeId, Skeleton};
use crate::FormatError;
use crate::bytes::Fields;

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

    /// Its bytes on disk.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend(self.positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        out.extend(self.normals.iter().flat_map(|x| x.to_le_bytes()));
        out.extend(self.colors.as_flattened());
        out.extend(self.triangles.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        out.extend(self.borders.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        out
    }

    /// Decodes and checks what untrusted bytes say.
    ///
    /// # Errors
    /// [`FormatError::Invalid`].
    pub fn decode(bytes: &[u8], skeleton: &Skeleton, node: NodeId) -> Result<Self, FormatError> {
        let record = skeleton.record(node);
        let has_colors = skeleton.root().has_colors;
        let count = u64::from(record.vertices) + u64::from(record.points);
        let expected =
            count * if has_colors { 14 } else { 10 } + u64::from(record.triangles) * 12 + u64::from(record.borders) * 8;
        let invalid = |problem: String| FormatError::invalid(format!("page {node}"), problem);
        if bytes.len() as u64 != expected {
            return Err(invalid(format!("{} bytes, expected {expected}", bytes.len())));
        }
        let mut fields = Fields(bytes);
        let page = Self {
            positions: (0..count).map(|_| [fields.u16(), fields.u16(), fields.u16()]).collect(),
            normals: (0..count).map(|_| fields.u32()).collect(),
            colors: (0..if has_colors { count } else { 0 }).map(|_| [(); 4].map(|()| fields.u8())).collect(),
            triangles: (0..record.triangles).map(|_| [(); 3].map(|()| fields.u32())).collect(),
            borders: (0..record.borders).map(|_| [(); 2].map(|()| fields.u32())).collect(),
        };
        let used = page.triangles.as_flattened().iter().chain(page.borders.as_flattened());
        match used.max() {
            Some(most) if *most >= record.vertices => {
                Err(invalid(format!("vertex {most}, expected less than {}", record.vertices)))
            }
            _ => Ok(page),
        }
    }
}
