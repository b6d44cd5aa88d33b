//! Splats on the device: all lists of a frame one after the other, in as few textures as their size allows.
//!
//! Takes the draws of a frame; leaves balls, normals and colours in textures and says which part of which instance lies where.
//! What always holds: numbers run through the frame in the order of the lists, and through each chunk in the order of places.
//!
//! They are textures and not buffers because every device reads a texture fast: the software adapter takes five times as long
//! for four words of a buffer, one at a time.

use crate::memory::Pool;
use crate::splats::params::PartParams;
use crate::staging::Staging;
use crate::{Gpu, RenderError};
use gigalod_geom::Camera;
use gigalod_runtime::splats::NormalColor;
use gigalod_runtime::{Similarity, SplatBall, SplatList};
use std::ops::Range;

/// Splats in a row of a chunk's textures; `STORE_WIDTH_LOG2` of splat_store.wgsl.
pub(crate) const WIDTH: u64 = 4096;
/// Bytes of a row of both textures.
pub(crate) const ROW_BYTES: u64 = WIDTH * SplatList::SPLAT_BYTES;
/// Rows of a chunk: as many as the least of devices allows, so that what many splats need is done on all.
const MOST_ROWS: u32 = 2048;

/// Splats that a chunk may have.
pub(crate) fn most_in_chunk(gpu: &Gpu) -> u64 {
    WIDTH * u64::from(gpu.max_picture_edge().min(MOST_ROWS))
}

/// Balls, normals and colours; and which parts lie here.
#[derive(Debug)]
pub(crate) struct Chunk {
    pub(crate) balls: Pool,
    pub(crate) normal_colors: Pool,
    /// Indices into [`Plan::parts`].
    pub(crate) parts: Range<u32>,
    /// How many there are.
    pub(crate) splats: u64,
}

/// Where the splats of a frame lie.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    /// In order of their numbers.
    pub(crate) parts: Vec<PartParams>,
    /// For each chunk in use, its parts and splats.
    pub(crate) chunks: Vec<(Range<u32>, u64)>,
}

impl Plan {
    /// Lays out the lists of a frame in chunks of at most `most` splats.
    pub(crate) fn new(camera: &Camera, lists: &[(Similarity, &SplatList)], most: u64) -> Self {
        let mut plan = Self::default();
        let (mut number, mut in_chunk) = (0, most);
        for (placement, list) in lists {
            let params = PartParams::new(camera, placement);
            let mut left = list.len() as u64;
            while left > 0 {
                if in_chunk == most {
                    let first = plan.parts.len() as u32;
                    plan.chunks.push((first..first, 0));
                    in_chunk = 0;
                }
                let count = left.min(most - in_chunk);
                plan.parts.push(PartParams {
                    first_number: number as u32,
                    first_slot: in_chunk as u32,
                    count: count as u32,
                    ..params
                });
                (number, in_chunk, left) = (number + count, in_chunk + count, left - count);
                let (parts, splats) = plan.chunks.last_mut().expect("begun above");
                (parts.end, *splats) = (plan.parts.len() as u32, in_chunk);
            }
        }
        plan
    }
}

impl Plan {
    /// True where a chunk holds parts of several instances.
    pub(crate) fn has_many_parts(&self) -> bool {
        self.chunks.iter().any(|(parts, _)| parts.len() > 1)
    }
}

impl Chunk {
    pub(crate) fn new() -> Self {
        Self {
            balls: Pool::rows("balls", wgpu::TextureFormat::Rgba32Float, WIDTH),
            normal_colors: Pool::rows("normals and colours", wgpu::TextureFormat::R32Uint, WIDTH),
            parts: 0..0,
            splats: 0,
        }
    }

    /// Asks for room for so many splats.
    pub(crate) fn want(&mut self, splats: u64) {
        self.splats = splats;
        self.balls.wanted = splats * size_of::<SplatBall>() as u64;
        self.normal_colors.wanted = splats * size_of::<NormalColor>() as u64;
    }
}

/// Binding 2, balls, or 3, normals and colours, of splat_store.wgsl; or another of whole numbers.
pub(crate) fn layout_entry(binding: u32, visibility: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    let sample_type =
        if binding == 2 { wgpu::TextureSampleType::Float { filterable: false } } else { wgpu::TextureSampleType::Uint };
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    }
}

/// Uploads the lists of a frame into chunks of at most `most` splats.
///
/// # Errors
/// What the device says.
pub(crate) fn upload(
    gpu: &Gpu,
    staging: &mut Staging,
    chunks: &[Chunk],
    most: u64,
    lists: &[(Similarity, &SplatList)],
) -> Result<(), RenderError> {
    let mut number = 0;
    for piece in lists.iter().flat_map(|(_, list)| &list.pieces) {
        let mut from = 0;
        while from < piece.balls.len() {
            let (chunk, slot) = ((number / most) as usize, number % most);
            let end = piece.balls.len().min(from + (most - slot) as usize);
            let chunk = &chunks[chunk];
            let balls = bytemuck::cast_slice(&piece.balls[from..end]);
            staging.write_texels(gpu, chunk.balls.texture(), slot, balls)?;
            let normal_colors = bytemuck::cast_slice(&piece.normal_colors[from..end]);
            staging.write_texels(gpu, chunk.normal_colors.texture(), slot, normal_colors)?;
            number += (end - from) as u64;
            from = end;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;
    use gigalod_runtime::splats::SplatPiece;
    use glam::DVec3;

    #[test]
    fn parts_cover_all_splats_in_order_and_no_chunk_is_larger_than_it_may_be() {
        let size = ImageSize { width: 64, height: 64 };
        let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.7, size);
        let list = |count: usize| SplatList {
            pieces: vec![SplatPiece {
                balls: vec![SplatBall { center_in_eye: [0.0; 3], radius: 1.0 }; count],
                normal_colors: vec![0; count],
            }],
        };
        let lists = [list(5), list(0), list(14), list(1)];
        let draws: Vec<_> = lists.iter().map(|list| (Similarity::IDENTITY, list)).collect();
        let plan = Plan::new(&camera, &draws, 8);
        let parts: Vec<_> = plan.parts.iter().map(|part| (part.first_number, part.first_slot, part.count)).collect();
        assert_eq!(parts, [(0, 0, 5), (5, 5, 3), (8, 0, 8), (16, 0, 3), (19, 3, 1)]);
        assert_eq!(plan.chunks, [(0..2, 8), (2..3, 8), (3..5, 4)]);
        assert!(Plan::new(&camera, &draws[1..2], 8).chunks.is_empty());
    }
}
