//! The unit that streams: a bounded number of vertices and triangles, its buffers reused from one batch to the next.

use crate::{ImportError, ModelStream};
use glam::{DVec3, Vec3};

/// What the vertices of a stream carry besides positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Attributes {
    /// A direction for each vertex.
    pub normals: bool,
    /// A colour for each vertex.
    pub colors: bool,
}

/// Vertices, structure of arrays. Attribute arrays are as long as `positions`, or empty where the stream has none.
#[derive(Clone, Debug, Default)]
pub struct VertexBatch {
    /// Model space; finite.
    pub positions: Vec<DVec3>,
    /// As in the file: not normalised, perhaps zero, but finite.
    pub normals: Vec<Vec3>,
    /// 8-bit sRGB.
    pub colors: Vec<[u8; 3]>,
}

/// Vertices and triangles that follow each other in the file; either may be empty.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// The next vertices.
    pub vertices: VertexBatch,
    /// Corners by vertex number, in the file's winding.
    pub triangles: Vec<[u32; 3]>,
}

impl Batch {
    /// A batch ends at the first element that reaches this many vertices or triangles.
    pub const TARGET: usize = 1 << 16;

    /// Empties it, keeping its buffers.
    pub fn clear(&mut self) {
        self.vertices.positions.clear();
        self.vertices.normals.clear();
        self.vertices.colors.clear();
        self.triangles.clear();
    }

    /// True when it holds as much as a batch should.
    pub fn is_full(&self) -> bool {
        self.vertices.positions.len() >= Self::TARGET || self.triangles.len() >= Self::TARGET
    }
}

/// A whole model in one batch, for those that need all of it at once: the judge, and copies of a scan. `progress` is told
/// [`ModelStream::bytes_consumed`]. Memory grows with the model.
///
/// # Errors
/// The first thing that is wrong with the file.
pub fn read_all(stream: &mut dyn ModelStream, progress: &mut dyn FnMut(u64, u64)) -> Result<Batch, ImportError> {
    let (mut all, mut batch) = (Batch::default(), Batch::default());
    while stream.next(&mut batch)? {
        all.vertices.positions.append(&mut batch.vertices.positions);
        all.vertices.normals.append(&mut batch.vertices.normals);
        all.vertices.colors.append(&mut batch.vertices.colors);
        all.triangles.append(&mut batch.triangles);
        let (done, total) = stream.bytes_consumed();
        progress(done, total);
    }
    Ok(all)
}
