//! Hybrid: the cut through an octree of simplified triangles and points.

mod list;

pub use list::{HybridList, HybridNode};
