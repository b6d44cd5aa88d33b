//! Hybrid: the cut through an octree of simplified triangles and points.
//!
//! Source: the hybrid paper, section 4. Differs: the error is bounded where a node may be seen, rather than at its middle, and a node
//! is opened only when all its children in sight are resident.
//!
//! Start at [`HybridSelector`]; `look` says what a view knows of a node, `near` what of one around the eye, `family` how a cut goes down,
//! `fade` how one level gives way to the next.

mod area;
mod fade;
mod family;
mod list;
mod look;
mod near;
mod selector;

pub use fade::{CROSS_FADE, RANKS, Ranks};
pub use list::{HybridList, HybridNode};
pub use selector::{CHECK_NODES, HybridSelector};
