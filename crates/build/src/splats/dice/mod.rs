//! Large triangles are diced: cut into cells no larger than a spacing, each of which becomes a leaf (splats paper, section 3.4;
//! Cook, Carpenter & Catmull, *The Reyes image rendering architecture*, SIGGRAPH 1987).
//!
//! A vertex' ball is as large as the triangles around it. That is right for a scan; of a building, it would make discs as large as
//! its walls.
//!
//! ```text
//! all triangles ──▶ sizes: spacing, threshold ──▶ grid of each large one ──▶ leaves, beside those of vertices
//! ```
//!
//! What always holds: a triangle lies within the union of its own cells' balls if it is diced (`grid.rs` says why), else within those
//! of its vertices, so what is next to it does not matter. What is diced, and how finely, depends on the set of triangles alone.

mod grid;
mod samples;
mod sizes;

pub(super) use samples::{Dice, count, dice};
pub(super) use sizes::{Dicing, Kind, Sizes};
