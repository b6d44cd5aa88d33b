//! Boxes, spheres, cones, frusta, cameras, quantisers, projected error and units: the vocabulary of every other crate.
//!
//! No I/O, no GPU, no unsafe, no platform `libm`: the same input gives the same bits on every machine.
//!
//! Spaces, used in names throughout the project:
//! * *model*: as in the input file, `f64`;
//! * *local*: model minus the centre of the hierarchy's root sphere, `f32`;
//! * *eye*: translated so that the eye is the origin; axes as in *world*;
//! * *view*: *eye* rotated; x right, y up, **z forward** (so that a depth is positive);
//! * *pixel*: (0, 0) is the outer corner of the top left pixel, whose centre is (0.5, 0.5).
#![forbid(unsafe_code)]

pub mod aabb;
pub mod camera;
pub mod color;
pub mod cone;
pub mod frustum;
pub mod path;
pub mod projected;
pub mod quantise;
pub mod sphere;
pub mod unit;

pub use aabb::Aabb;
pub use camera::{Camera, ImageSize};
pub use cone::NormalCone;
pub use frustum::Frustum;
pub use path::{CameraPath, Pose};
pub use sphere::Sphere;
pub use unit::LengthUnit;
