//! What a frame draws, from where, and what of it each pass draws.
//!
//! Goes in: a [`Frame`]. Comes out: its lists by kind, checked.

use crate::splats::Kernel;
use crate::{Gpu, GpuLevel, Lighting, RenderError, smooth};
use gigalod_geom::Camera;
use gigalod_runtime::hybrid::HybridList;
use gigalod_runtime::{DrawSource, ModelView, Similarity, SplatList};

/// How things are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Shape of splats.
    pub kernel: Kernel,
    /// Light and background.
    pub lighting: Lighting,
    /// At how many places each pixel is looked at, 1 to [`crate::MOST_SAMPLES`]: a frame takes as many times as long, and its edges are as
    /// much smoother. Depths are those of the pixels' middles.
    pub samples: u32,
}

impl Default for Look {
    fn default() -> Self {
        Self { kernel: Kernel::default(), lighting: Lighting::default(), samples: 1 }
    }
}

/// What a frame draws, from where.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// World space.
    pub camera: Camera,
    /// How it looks.
    pub look: Look,
    /// What each instance draws, and where it stands.
    pub draws: Vec<(Similarity, &'a DrawSource)>,
}

/// The lists of a frame, by kind.
#[derive(Debug, Default)]
pub(crate) struct Lists<'a> {
    pub(crate) splats: Vec<(Similarity, &'a SplatList)>,
    pub(crate) hybrid: Vec<(Similarity, &'a HybridList)>,
}

impl<'a> Lists<'a> {
    /// Checks that a device can draw a frame.
    ///
    /// # Errors
    /// [`RenderError::Size`], [`RenderError::ForeignDrawSource`], [`RenderError::CannotBlend`], [`RenderError::NeedsStorage`],
    /// [`RenderError::TooMany`], [`RenderError::Samples`], [`RenderError::CannotSmooth`].
    pub(crate) fn of(gpu: &Gpu, frame: &Frame<'a>) -> Result<Self, RenderError> {
        let (size, limit) = (frame.camera.size, gpu.max_picture_edge());
        if size.width.min(size.height) == 0 || size.width.max(size.height) > limit {
            return Err(RenderError::Size { width: size.width, height: size.height, limit });
        }
        if gpu.level() == GpuLevel::WebGl && frame.look.kernel.is_gauss() {
            return Err(RenderError::CannotBlend);
        }
        smooth::check(gpu, frame.look.samples)?;
        let mut lists = Self::default();
        for (placement, source) in &frame.draws {
            match source {
                DrawSource::Splats(list) => lists.splats.push((*placement, list)),
                // One that was never filled names no file.
                DrawSource::Hybrid(list) if list.hybrid.is_some() && !list.nodes.is_empty() => {
                    lists.hybrid.push((*placement, list));
                }
                DrawSource::Hybrid(_) => {}
                _ => return Err(RenderError::ForeignDrawSource),
            }
        }
        if gpu.level() == GpuLevel::WebGl && !lists.hybrid.is_empty() {
            return Err(RenderError::NeedsStorage);
        }
        match lists.splat_count() {
            count if count >= u64::from(u32::MAX) => Err(RenderError::TooMany(count)),
            _ => Ok(lists),
        }
    }

    /// Splats.
    pub(crate) fn splat_count(&self) -> u64 {
        self.splats.iter().map(|(_, list)| list.len() as u64).sum()
    }

    /// Pixels that all splats cover, each counted by itself.
    pub(crate) fn splat_area_px(&self, camera: &Camera) -> f64 {
        self.splats.iter().map(|(placement, list)| list.area_px(&ModelView::new(camera, placement))).sum()
    }
}
