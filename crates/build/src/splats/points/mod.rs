//! From a point cloud to leaves: for each point a sphere, a normal and a colour.
//!
//! The way of the data, a file for each step:
//!
//! ```text
//! points ──▶ cells ──▶ fit: neighbours, plane, spacing, patches ──▶ sides ──▶ leaves
//! stream     16,384    by cell: radius, normal, what hangs          inside    of the mesh's
//!            points    together                                     and out   kind
//! ```
//!
//! * **Radius** (`spacing.rs`): as far as the corners of the point's Voronoi cell in its tangent plane, so that balls of
//!   neighbours cover what is between them; corners that are far for the spacing there are borders, not gaps.
//! * **Normal**: the file's own where it has one; else of the plane through the nearest 16 points (`plane.rs`), its side by
//!   propagation along a spanning tree (`patches.rs`, `sides.rs`; Hoppe et al., *Surface reconstruction from unorganized points*,
//!   SIGGRAPH 1992, sections 3.2 and 3.3).
//!
//! A *site* is a place where points are, one or more; neighbours are sites. A *cell* is a box of at most [`cells::MOST_POINTS`]
//! points. What always holds: cells depend on the set of points alone, neighbours are the nearest of the whole cloud, and what
//! ties is ordered by cell, so nothing depends on the order of the input, on memory, or on threads.

mod cells;
mod fit;
mod leaves;
mod nearest;
mod neighbours;
mod patches;
mod plane;
mod sides;
mod spacing;

pub(super) use cells::{Cells, divide};
pub(super) use fit::{Fits, fit};
pub(super) use leaves::from_fits;
