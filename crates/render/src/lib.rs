//! Drawing with wgpu, one code path for every adapter.
//!
//! Draw sources go in, a picture comes out: draw sources → G-buffer (albedo, normal, depth) → lighting → picture. One WGSL
//! file for each pass, in `shader/`; its host side is in the module of its name, and tests compare their layouts.
//!
//! What always holds: wgpu does not show through this crate's interface; a validation error is an error of the call that
//! made it, never a black picture; only the baseline of WebGPU is needed.
#![forbid(unsafe_code)]

mod buffers;
mod commands;
mod cover;
mod error;
mod frame;
mod gbuffer;
mod gpu;
mod hybrid;
mod light;
mod memory;
mod readback;
mod renderer;
#[cfg(test)]
mod renderer_tests;
mod shader;
mod smooth;
mod splats;
mod staging;
mod targets;
#[cfg(feature = "window")]
pub mod window;

pub use error::RenderError;
pub use frame::{Frame, Look};
pub use gpu::{Gpu, GpuLevel};
pub use light::Lighting;
pub use renderer::Renderer;
pub use smooth::MOST_SAMPLES;
pub use splats::Kernel;
pub use targets::Picture;
