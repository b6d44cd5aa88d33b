//! Splats on the device: all lists of a frame one after the other, in as few textures as their size allows.
//!
//! Takes the draws of a frame; leaves balls, normals and colours in textures and says which part of which instance lies where, and
//! what of it is drawn in one go.
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
use gigalod_runtime::{Interrupt, Similarity, SplatBall, SplatList};
use std::ops::Range;

/// Splats in a row of a chunk's textures; `STORE_WIDTH_LOG2` of splat_store.wgsl.
pub(crate) const WIDTH: u64 = 4096;
/// Bytes of a row of both textures.
pub(crate) const ROW_BYTES: u64 = WIDTH * SplatList::SPLAT_BYTES;
/// Rows of a chunk: as many as the least of devices allows, so that what many splats need is done on all.
const MOST_ROWS: u32 = 2048;

/// Splats that are uploaded between two looks at what breaks it off.
const AT_ONCE: u64 = 16 * WIDTH;

/// Splats that a chunk may have.
pub(crate) fn most_in_chunk(gpu: &Gpu) -> u64 {
    WIDTH * u64::from(gpu.max_picture_edge().min(MOST_ROWS))
}

/// Balls, normals and colours.
#[derive(Debug)]
pub(crate) struct Chunk {
    pub(crate) balls: Pool,
    pub(crate) normal_colors: Pool,
}

/// Where the splats of a frame lie.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    /// In order of their numbers.
    pub(crate) parts: Vec<PartParams>,
    /// Those in use.
    pub(crate) chunks: Vec<PlannedChunk>,
}

/// What lies in a chunk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PlannedChunk {
    /// Indices into [`Plan::parts`].
    pub(crate) parts: Range<u32>,
    pub(crate) splats: u64,
    /// Its splats belong to several instances.
    pub(crate) is_shared: bool,
    /// Consecutive parts that are drawn in one go.
    pub(crate) slices: Vec<Range<u32>>,
}

impl Plan {
    /// Lays out the lists of a frame in chunks of at most `most` splats, to be drawn in slices of at most `most_in_slice`.
    pub(crate) fn new(camera: &Camera, lists: &[(Similarity, &SplatList)], most: u64, most_in_slice: u64) -> Self {
        let mut plan = Self::default();
        let (mut number, mut in_chunk, mut in_slice) = (0, most, 0);
        for (placement, list) in lists {
            let params = PartParams::new(camera, placement);
            let mut left = list.len() as u64;
            while left > 0 {
                let first = plan.parts.len() as u32;
                let begins = left == list.len() as u64;
                if in_chunk == most {
                    plan.chunks.push(PlannedChunk { parts: first..first, splats: 0, is_shared: false, slices: vec![] });
                    (in_chunk, in_slice) = (0, most_in_slice);
                }
                let chunk = plan.chunks.last_mut().expect("begun above");
                if in_slice == most_in_slice {
                    chunk.slices.push(first..first);
                    in_slice = 0;
                }
                let count = left.min(most - in_chunk).min(most_in_slice - in_slice);
                plan.parts.push(PartParams {
                    first_number: number as u32,
                    first_slot: in_chunk as u32,
                    count: count as u32,
                    ..params
                });
                chunk.is_shared |= begins && in_chunk > 0;
                (number, in_chunk, left) = (number + count, in_chunk + count, left - count);
                in_slice += count;
                let end = plan.parts.len() as u32;
                (chunk.parts.end, chunk.splats) = (end, in_chunk);
                chunk.slices.last_mut().expect("begun above").end = end;
            }
        }
        plan
    }

    /// True where a chunk holds splats of several instances.
    pub(crate) fn is_shared(&self) -> bool {
        self.chunks.iter().any(|chunk| chunk.is_shared)
    }

    /// Splats of the largest chunk.
    pub(crate) fn largest_chunk(&self) -> u64 {
        self.chunks.iter().map(|chunk| chunk.splats).max().unwrap_or(0)
    }
}

impl Chunk {
    pub(crate) fn new() -> Self {
        Self {
            balls: Pool::rows("balls", wgpu::TextureFormat::Rgba32Float, WIDTH),
            normal_colors: Pool::rows("normals and colours", wgpu::TextureFormat::R32Uint, WIDTH),
        }
    }

    /// Asks for room for so many splats.
    pub(crate) fn want(&mut self, splats: u64) {
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

/// Uploads the lists of a frame into chunks of at most `most` splats. False where that was broken off.
///
/// # Errors
/// What the device says.
pub(crate) fn upload(
    gpu: &Gpu,
    staging: &mut Staging,
    chunks: &[Chunk],
    most: u64,
    lists: &[(Similarity, &SplatList)],
    interrupt: Option<&Interrupt>,
) -> Result<bool, RenderError> {
    let mut number = 0;
    for piece in lists.iter().flat_map(|(_, list)| &list.pieces) {
        let mut from = 0;
        while from < piece.balls.len() {
            if interrupt.is_some_and(Interrupt::is_set) {
                staging.finish(gpu)?;
                return Ok(false);
            }
            let (chunk, slot) = ((number / most) as usize, number % most);
            let end = piece.balls.len().min(from + (most - slot).min(AT_ONCE) as usize);
            let chunk = &chunks[chunk];
            let balls = bytemuck::cast_slice(&piece.balls[from..end]);
            staging.write_texels(gpu, chunk.balls.texture(), slot, balls)?;
            let normal_colors = bytemuck::cast_slice(&piece.normal_colors[from..end]);
            staging.write_texels(gpu, chunk.normal_colors.texture(), slot, normal_colors)?;
            number += (end - from) as u64;
            from = end;
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gigalod_geom::ImageSize;
    use gigalod_runtime::splats::SplatPiece;
    use glam::DVec3;

    #[test]
    fn parts_cover_all_splats_in_order_and_neither_chunk_nor_slice_is_larger_than_it_may_be() {
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
        let parts = |plan: &Plan| -> Vec<_> {
            plan.parts.iter().map(|part| (part.first_number, part.first_slot, part.count)).collect()
        };
        let chunk = |parts: Range<u32>, splats, is_shared, slices: &[Range<u32>]| PlannedChunk {
            parts,
            splats,
            is_shared,
            slices: slices.to_vec(),
        };
        let plan = Plan::new(&camera, &draws, 8, 8);
        assert_eq!(parts(&plan), [(0, 0, 5), (5, 5, 3), (8, 0, 8), (16, 0, 3), (19, 3, 1)]);
        let one = std::slice::from_ref;
        assert_eq!(
            plan.chunks,
            [
                chunk(0..2, 8, true, one(&(0..2))),
                chunk(2..3, 8, false, one(&(2..3))),
                chunk(3..5, 4, true, one(&(3..5)))
            ]
        );
        let plan = Plan::new(&camera, &draws, 8, 3);
        assert_eq!(
            parts(&plan),
            [(0, 0, 3), (3, 3, 2), (5, 5, 1), (6, 6, 2), (8, 0, 3), (11, 3, 3), (14, 6, 2), (16, 0, 3), (19, 3, 1)]
        );
        assert_eq!(
            plan.chunks,
            [
                chunk(0..4, 8, true, &[0..1, 1..3, 3..4]),
                chunk(4..7, 8, false, &[4..5, 5..6, 6..7]),
                chunk(7..9, 4, true, &[7..8, 8..9])
            ]
        );
        assert!(Plan::new(&camera, &draws[1..2], 8, 8).chunks.is_empty());
    }
}
