//! What a person chooses.

use gigalod_geom::ImageSize;
use gigalod_render::{Kernel, Lighting, Look};
use gigalod_runtime::splats::Tint;
use glam::DVec3;
use std::path::PathBuf;

/// Usual places at which each pixel is looked at: a square lattice.
pub const SAMPLES: u32 = 17;

/// How things are drawn, and with what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Shape of splats.
    pub kernel: Kernel,
    /// Places at which each pixel is looked at, once the picture is as fine as it gets.
    pub samples: u32,
    /// World space; `None` for a lamp at the viewer's shoulder.
    pub towards_light: Option<DVec3>,
    /// 8-bit sRGB.
    pub background: [u8; 3],
    /// Colours of the model, or one for each level of detail.
    pub tint: Tint,
    /// Levels of hybrid models fade into each other.
    pub cross_fade: bool,
    /// Error at rest, in pixels; `None` for what suits the models.
    pub finest_px: Option<f32>,
    /// Milliseconds of a frame while the camera moves.
    pub target_ms: f64,
    /// Bytes for pages and lists.
    pub cpu_budget: u64,
    /// Bytes on the graphics device; `None` for all there is.
    pub gpu_budget: Option<u64>,
}

impl Settings {
    pub(crate) fn look(&self) -> Look {
        let lighting = Lighting { towards_light: self.towards_light, background: self.background };
        Look { kernel: self.kernel, lighting, samples: self.samples }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            kernel: Kernel::Round,
            samples: SAMPLES,
            towards_light: None,
            background: [32, 32, 36],
            tint: Tint::Model,
            cross_fade: false,
            finest_px: None,
            target_ms: 50.0,
            cpu_budget: 1 << 30,
            gpu_budget: None,
        }
    }
}

/// Where the first look is from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstLook {
    /// As `render` looks at it by default.
    Whole,
    /// Azimuth and elevation in degrees, and how many times nearer than a view of the whole.
    Orbit([f64; 3]),
    /// World space.
    From {
        /// Where the eye is.
        eye: DVec3,
        /// What it looks at.
        target: DVec3,
    },
}

/// How the viewer begins.
#[derive(Clone, Debug)]
pub struct Options {
    /// Models, scenes, folders or camera paths.
    pub files: Vec<PathBuf>,
    /// How things are drawn.
    pub settings: Settings,
    /// Vertical field of view, in degrees.
    pub fov_deg: f64,
    /// Where the first look is from.
    pub first_look: FirstLook,
    /// Of the window's content, in physical pixels.
    pub size: ImageSize,
}
