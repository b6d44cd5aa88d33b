//! Generators of test models and camera paths at any size.
//!
//! Takes a handful of options and a seed; gives bytes ([`statue`], [`replicate`]) or poses ([`paths`]). Models are
//! binary little-endian PLY, written front to back, so the output may be a file, a pipe or a counter.
//!
//! What always holds:
//! * *the same bytes everywhere*: no platform `libm`, no hash map, no clock; threads only ever fill disjoint ranges;
//! * *memory that does not grow* with the number of triangles: a fixed table and two blocks;
//! * *counts known first*: the PLY header is exact before the first vertex is made.
//!
//! Start at [`write_statue`], [`write_replicas`] and [`camera_path`].
#![forbid(unsafe_code)]

mod error;
mod math;
mod noise;
pub mod paths;
mod permute;
mod ply;
pub mod replicate;
pub mod statue;

pub use error::SynthError;
pub use paths::{PathKind, PathOptions, camera_path};
pub use replicate::{ReplicaOptions, Scan, write_replicas};
pub use statue::{StatueOptions, write_statue};

/// In which order vertices and triangles are written. The mesh is the same, up to renumbering.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Order {
    /// Neighbours on the surface are neighbours in the file, as most scanners and tools write it.
    #[default]
    Coherent,
    /// A pseudo-random permutation, vertices and triangles apart: the worst case for a reader.
    Shuffled,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Vertices in the file.
    pub vertices: u64,
    /// Triangles in the file.
    pub triangles: u64,
    /// All bytes, header included.
    pub bytes: u64,
}
