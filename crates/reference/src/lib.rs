//! Slow and right: ray-traced pictures, exact distances and image metrics. The judge in tests and benches.
//!
//! Takes a whole mesh in memory and everything in `f64`; knows no level of detail, no page and no GPU, so that it can
//! share no mistake with what it judges. Deterministic: the same input gives the same answer, whatever the number of
//! threads.
//!
//! Start at [`Truth::trace`] for what a camera sees, [`judge::judge`] for whether a drawn frame has holes,
//! [`metrics::compare`] and [`delta_e`] for how far two pictures are apart, and [`distance::two_sided`] for how far two surfaces are.
//!
//! ```text
//! Mesh ─▶ Bvh ─┬▶ Truth ─┬▶ shade ─▶ Picture ─▶ metrics, temporal (shimmer)
//!              │         └▶ judge (holes, fat)
//!              └▶ distance, screen_error
//! ```
#![forbid(unsafe_code)]

pub mod bvh;
pub mod delta_e;
pub mod discontinuity;
pub mod distance;
pub mod distance_transform;
pub mod judge;
pub mod mesh;
pub mod metrics;
pub mod picture;
pub mod poses;
pub mod raytrace;
pub mod screen_error;
pub mod shade;
pub mod skin;
pub mod ssim;
pub mod temporal;
pub mod triangle;

#[cfg(test)]
mod fixtures;

pub use bvh::Bvh;
pub use mesh::Mesh;
pub use picture::{Mask, Picture};
pub use raytrace::Truth;
pub use shade::Shading;
pub use skin::Skin;
