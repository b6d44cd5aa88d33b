//! Writes binary PLY in blocks: threads fill one block while the one before is written.
//!
//! Takes counts and a function that fills any range of records; gives the bytes of a file. Memory: two blocks.

use crate::{SynthError, Written};
use rayon::prelude::*;
use std::io::Write;

/// Bytes of one face: the count (3) and three indices.
pub(crate) const FACE_BYTES: usize = 13;
/// Records in a block. 2 × 64 Ki records keep two cores busy and cost under 2 MiB.
const BLOCK_RECORDS: u64 = 1 << 16;
/// Records one task fills.
const TASK_RECORDS: usize = 1 << 11;

/// What a PLY vertex carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VertexKind {
    /// `float x y z`.
    Position,
    /// `float x y z`, `uchar red green blue`.
    PositionColor,
}

impl VertexKind {
    /// Bytes of one vertex.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Position => 12,
            Self::PositionColor => 15,
        }
    }
}

/// A PLY being written.
pub(crate) struct PlyWriter<'a> {
    out: &'a mut dyn Write,
    progress: &'a mut dyn FnMut(u64, u64),
    done: u64,
    total: Written,
    kind: VertexKind,
}

impl<'a> PlyWriter<'a> {
    /// Writes the header. `comment` is one line of ASCII.
    pub(crate) fn start(
        out: &'a mut dyn Write,
        progress: &'a mut dyn FnMut(u64, u64),
        comment: &str,
        kind: VertexKind,
        vertices: u64,
        triangles: u64,
    ) -> Result<Self, SynthError> {
        let color = match kind {
            VertexKind::Position => "",
            VertexKind::PositionColor => "property uchar red\nproperty uchar green\nproperty uchar blue\n",
        };
        let header = format!(
            "ply\nformat binary_little_endian 1.0\ncomment {comment}\nelement vertex {vertices}\nproperty float x\n\
             property float y\nproperty float z\n{color}element face {triangles}\n\
             property list uchar int vertex_indices\nend_header\n"
        );
        out.write_all(header.as_bytes())?;
        let done = header.len() as u64;
        let bytes = done + vertices * kind.bytes() as u64 + triangles * FACE_BYTES as u64;
        progress(done, bytes);
        Ok(Self { out, progress, done, total: Written { vertices, triangles, bytes }, kind })
    }

    /// Writes all vertices; `fill(first, buffer)` fills whole records from number `first` on.
    pub(crate) fn vertices(&mut self, fill: impl Fn(u64, &mut [u8]) + Sync) -> Result<(), SynthError> {
        self.records(self.total.vertices, self.kind.bytes(), fill)
    }

    /// Writes all faces; `fill(first, buffer)` fills whole records from number `first` on.
    pub(crate) fn faces(&mut self, fill: impl Fn(u64, &mut [u8]) + Sync) -> Result<(), SynthError> {
        self.records(self.total.triangles, FACE_BYTES, fill)
    }

    /// Writes bytes made elsewhere.
    pub(crate) fn raw(&mut self, bytes: &[u8]) -> Result<(), SynthError> {
        self.out.write_all(bytes)?;
        self.done += bytes.len() as u64;
        (self.progress)(self.done, self.total.bytes);
        Ok(())
    }

    /// Flushes, and checks that the header told the truth.
    pub(crate) fn finish(self) -> Result<Written, SynthError> {
        assert_eq!(self.done, self.total.bytes, "the PLY body differs from its header");
        self.out.flush()?;
        Ok(self.total)
    }

    fn records(
        &mut self,
        count: u64,
        record_bytes: usize,
        fill: impl Fn(u64, &mut [u8]) + Sync,
    ) -> Result<(), SynthError> {
        let block_len = |first: u64| (count - first).min(BLOCK_RECORDS) as usize * record_bytes;
        let fill_block = |first: u64, block: &mut Vec<u8>| {
            block.resize(block_len(first), 0);
            block
                .par_chunks_mut(TASK_RECORDS * record_bytes)
                .enumerate()
                .for_each(|(task, chunk)| fill(first + (task * TASK_RECORDS) as u64, chunk));
        };
        let (mut ready, mut next) = (Vec::new(), Vec::new());
        if count > 0 {
            fill_block(0, &mut ready);
        }
        let mut first = 0;
        while first < count {
            let following = first + BLOCK_RECORDS;
            rayon::in_place_scope(|scope| {
                if following < count {
                    let (fill_block, next) = (&fill_block, &mut next);
                    scope.spawn(move |_| fill_block(following, next));
                }
                self.raw(&ready)
            })?;
            std::mem::swap(&mut ready, &mut next);
            first = following;
        }
        Ok(())
    }
}

/// Puts one vertex into its record.
pub(crate) fn put_vertex(record: &mut [u8], position: [f32; 3], color: [u8; 3]) {
    for (bytes, value) in record.chunks_exact_mut(4).zip(position) {
        bytes.copy_from_slice(&value.to_le_bytes());
    }
    if let Some(bytes) = record.get_mut(12..15) {
        bytes.copy_from_slice(&color);
    }
}

/// Puts one triangle into its record.
pub(crate) fn put_face(record: &mut [u8], corners: [u32; 3]) {
    record[0] = 3;
    for (bytes, corner) in record[1..].chunks_exact_mut(4).zip(corners) {
        bytes.copy_from_slice(&corner.to_le_bytes());
    }
}
