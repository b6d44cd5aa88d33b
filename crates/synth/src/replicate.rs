//! A heap of displaced, cut and re-sampled copies of one real scan: as large as wanted, and as uneven as scans are.
//!
//! Takes a scan held in memory and a number of triangles; writes a binary PLY of exactly that many. Copies lie in a
//! jittered heap; each is turned, scaled (0.5–2), warped, cut by one or two planes (open borders), and some are
//! subdivided or decimated, so that density varies by a hundred and more.
//!
//! Start at [`write_replicas`]; one copy is made by `copy`, re-sampled by `resample`.
//!
//! Always holds: copy number `i` is a pure function of scan, seed and `i`. So a first pass counts, a second writes
//! vertices, a third faces, and no more than [`COPIES_AT_ONCE`] copies are in memory.

mod copy;
mod mesh;
mod resample;

use crate::ply::{FACE_BYTES, PlyWriter, VertexKind, put_face, put_vertex};
use crate::{Order, SynthError, Written};
use copy::CopyMaker;
use mesh::Mesh;
use rayon::prelude::*;
use std::io::Write;

/// Copies made at the same time, whatever the number of threads.
pub const COPIES_AT_ONCE: u64 = 4;
/// Most triangles and most vertices of the output: PLY indices are 31 bits.
pub const MAX_COUNT: u64 = i32::MAX as u64;

/// A triangle mesh in memory: what is copied.
#[derive(Clone, Debug, Default)]
pub struct Scan {
    /// Any units; finite.
    pub positions: Vec<[f32; 3]>,
    /// Indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// 8-bit sRGB, one per position.
    pub colors: Option<Vec<[u8; 3]>>,
}

/// How many triangles, and which heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplicaOptions {
    /// Number of triangles, 1 to [`MAX_COUNT`]; met exactly.
    pub triangles: u64,
    /// Places, cuts, warps, densities.
    pub seed: u64,
    /// [`Order::Shuffled`] shuffles vertices and triangles within each copy (all at once would need all in memory).
    pub order: Order,
}

/// Writes a heap of copies of `scan` as binary little-endian PLY, in the scan's units, y up, resting near y = 0;
/// colours where the scan has them.
///
/// `progress` is told the bytes done and the bytes in all; `(0, 0)` during the first, counting third of the time.
/// Memory: the scan, and [`COPIES_AT_ONCE`] copies of at most sixteen times its triangles.
///
/// # Errors
/// [`SynthError::EmptyScan`], [`SynthError::BadIndex`], [`SynthError::NotFinite`] and [`SynthError::ColorCount`] for an
/// unusable scan; [`SynthError::TriangleCount`] outside the limits; [`SynthError::VertexCount`] where a scan without
/// shared vertices would need more vertices than PLY can number; [`SynthError::Io`] when `out` refuses bytes.
pub fn write_replicas(
    scan: &Scan,
    options: ReplicaOptions,
    out: &mut dyn Write,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Written, SynthError> {
    if !(1..=MAX_COUNT).contains(&options.triangles) {
        return Err(SynthError::TriangleCount { asked: options.triangles, least: 1, most: MAX_COUNT });
    }
    let maker = CopyMaker::new(scan, options)?;
    let mut vertices = 0;
    each_copy(&maker, |copy| {
        vertices += copy.positions.len() as u64;
        progress(0, 0);
        Ok(())
    })?;
    if vertices > MAX_COUNT {
        return Err(SynthError::VertexCount { found: vertices, most: MAX_COUNT });
    }
    let kind = if scan.colors.is_some() { VertexKind::PositionColor } else { VertexKind::Position };
    let comment = format!("gigalod synth replicas, seed {}", options.seed);
    let mut ply = PlyWriter::start(out, progress, &comment, kind, vertices, options.triangles)?;
    let mut bytes = Vec::new();
    each_copy(&maker, |copy| {
        bytes.resize(copy.positions.len() * kind.bytes(), 0);
        for (vertex, record) in bytes.chunks_exact_mut(kind.bytes()).enumerate() {
            put_vertex(record, copy.positions[vertex].to_array(), copy.colors.get(vertex).copied().unwrap_or_default());
        }
        ply.raw(&bytes)
    })?;
    let mut first_vertex = 0;
    each_copy(&maker, |copy| {
        bytes.resize(copy.triangles.len() * FACE_BYTES, 0);
        for (corners, record) in copy.triangles.iter().zip(bytes.chunks_exact_mut(FACE_BYTES)) {
            put_face(record, corners.map(|corner| first_vertex + corner));
        }
        first_vertex += copy.positions.len() as u32;
        ply.raw(&bytes)
    })?;
    ply.finish()
}

/// Makes copy after copy until there are enough triangles; hands them over in order, the last one cut to fit.
fn each_copy(maker: &CopyMaker, mut take: impl FnMut(&Mesh) -> Result<(), SynthError>) -> Result<(), SynthError> {
    let (mut next, mut missing) = (0, maker.triangles());
    while missing > 0 {
        let batch: Vec<Mesh> = (next..next + COPIES_AT_ONCE).into_par_iter().map(|index| maker.copy(index)).collect();
        for (index, mut copy) in (next..).zip(batch) {
            if copy.triangles.len() as u64 > missing {
                copy = maker.cut_to(copy, index, missing as usize);
            }
            missing -= copy.triangles.len() as u64;
            take(&maker.ordered(copy, index))?;
            if missing == 0 {
                break;
            }
        }
        next += COPIES_AT_ONCE;
    }
    Ok(())
}
