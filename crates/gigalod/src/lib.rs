//! Gigalod shows models too big for memory at a guaranteed error on screen.
//!
//! Each stage of the way is a crate of its own; this one gathers them under short names. The command line of the same name
//! is built on nothing else.
//!
//! ```text
//! import ──▶ build ──▶ format ──▶ runtime ──▶ render
//! ```
#![forbid(unsafe_code)]

pub use gigalod_build as build;
pub use gigalod_format as format;
pub use gigalod_geom as geom;
pub use gigalod_import as import;
pub use gigalod_render as render;
pub use gigalod_runtime as runtime;
pub use gigalod_synth as synth;

pub mod export;
pub mod verify;
