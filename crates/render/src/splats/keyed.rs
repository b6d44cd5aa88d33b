//! Splats through keys: what is nearest in each pixel is found by atomic maxima in a storage buffer, then written to the
//! G-buffer. Shaders: `shader/splat_compute.wgsl`, `splat_quads.wgsl`, `splat_resolve.wgsl`, `splat_blend.wgsl`.
//!
//! A splat of a few pixels costs a pipeline far more than its pixels are worth, so a compute pass draws it; one of many pixels
//! would keep a single invocation busy, so it is listed and drawn as a quad. Both deliver the same bits to the same place, and
//! maxima and sums of whole numbers do not depend on the order: which way a splat takes is never to be seen.
//!
//! A picture whose keys do not fit into one binding is drawn in bands of rows; splats are drawn in slices, between which a frame
//! can be broken off.

use crate::commands::Commands;
use crate::gbuffer::{self, GBuffer};
use crate::memory::Pool;
use crate::shader::Target;
use crate::splats::Kernel;
use crate::splats::params::{PartParams, PassParams, STRIDE};
use crate::splats::pipelines::{Pipelines, Resolving, Round, target};
use crate::splats::store::{self, Chunk, Plan, PlannedChunk};
use crate::{Gpu, RenderError};
use gigalod_geom::{Camera, ImageSize};
use std::collections::BTreeMap;
use std::ops::Range;

/// Splats whose window is at most this many pixels wide and high are drawn by the compute pass, unless
/// [`crate::Renderer::set_compute_extent`] says otherwise. Measured on the software adapter, for which a fragment costs more than
/// an idle lane; where thousands of invocations run at once, a long one keeps its neighbours waiting.
pub(crate) fn compute_extent_px(gpu: &Gpu) -> u32 {
    if gpu.is_software() { MOST_COMPUTE_EXTENT_PX } else { 16 }
}

/// Beyond this an invocation of the compute pass would take too many turns: the software adapter ends all loops of an invocation
/// after 65,535 turns in all, and draws 16 splats in one.
pub(crate) const MOST_COMPUTE_EXTENT_PX: u32 = 60;

/// Bytes of a key, and of a pixel's sums.
const KEY_BYTES: u64 = 8;
const SUMS_BYTES: u64 = 40;

/// Bytes of a row of the texture that keys are copied to: processors read textures faster than buffers.
const KEYS_ROW_BYTES: u64 = store::WIDTH * KEY_BYTES;

/// Bytes of a large splat in the list, which has room for all of a slice.
pub(crate) const LISTED_BYTES: u64 = 4;

/// Splats of a slice.
pub(crate) const MOST_IN_SLICE: u64 = 1 << 17;
pub(crate) const LEAST_IN_SLICE: u64 = 1 << 13;
/// Pixels that the splats of a slice cover, each counted by itself.
const SLICE_PX: f64 = 1e6;

/// How many splats to draw in one go: the software adapter takes some 5 ms for them. `area_px` is the area of all splats together.
pub(crate) fn most_in_slice(splats: u64, area_px: f64) -> u64 {
    let with_that_area = (splats as f64 * (SLICE_PX / area_px.max(1.0))) as u64;
    with_that_area.clamp(LEAST_IN_SLICE, MOST_IN_SLICE).next_multiple_of(u64::from(SPLATS_IN_GROUP))
}

/// Splats that a workgroup draws: `GROUP` times `EACH` of splat_compute.wgsl.
const SPLATS_IN_GROUP: u32 = 64 * 16;

/// How a frame is cut up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bands {
    rows: u32,
    count: u32,
    height: u32,
    width: u32,
}

impl Bands {
    /// As few as bindings of `most_bytes` allow.
    pub(crate) fn new(size: ImageSize, kernel: Kernel, most_bytes: u64) -> Self {
        let row_bytes = u64::from(size.width) * if kernel.is_gauss() { SUMS_BYTES } else { KEY_BYTES };
        let rows = (most_bytes.saturating_sub(KEYS_ROW_BYTES) / row_bytes).clamp(1, u64::from(size.height)) as u32;
        Self { rows, count: size.height.div_ceil(rows), height: size.height, width: size.width }
    }

    /// Bytes of keys and of sums.
    pub(crate) fn bytes(&self, kernel: Kernel) -> [u64; 2] {
        let pixels = u64::from(self.width) * u64::from(self.rows);
        let keys = (pixels * KEY_BYTES).next_multiple_of(KEYS_ROW_BYTES);
        [keys, if kernel.is_gauss() { pixels * SUMS_BYTES } else { 0 }]
    }

    /// Width, and most rows in one.
    pub(crate) fn size(&self) -> [u32; 2] {
        [self.width, self.rows]
    }

    /// How many.
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    pub(crate) fn rows_of(&self, band: u32) -> Range<u32> {
        band * self.rows..((band + 1) * self.rows).min(self.height)
    }
}

/// Buffers besides the splats.
#[derive(Debug)]
pub(crate) struct KeyedBuffers {
    pub(crate) keys: Pool,
    /// What they have become, to be read.
    pub(crate) found: Pool,
    pub(crate) sums: Pool,
    pub(crate) list: Pool,
    pub(crate) draw: Pool,
}

impl KeyedBuffers {
    pub(crate) fn new() -> Self {
        use wgpu::BufferUsages as Usage;
        Self {
            keys: Pool::new("keys", Usage::STORAGE | Usage::COPY_SRC),
            found: Pool::rows("found keys", wgpu::TextureFormat::Rg32Uint, store::WIDTH),
            sums: Pool::new("sums", Usage::STORAGE),
            list: Pool::new("large splats", Usage::STORAGE),
            draw: Pool::new("draw of large splats", Usage::STORAGE | Usage::INDIRECT),
        }
    }

    /// Asks for room.
    pub(crate) fn want(&mut self, bands: &Bands, kernel: Kernel, largest_chunk: u64) {
        [self.keys.wanted, self.sums.wanted] = bands.bytes(kernel);
        self.found.wanted = if kernel.is_gauss() { 0 } else { self.keys.wanted };
        // All of a slice may be large.
        self.list.wanted = largest_chunk.clamp(1, MOST_IN_SLICE) * LISTED_BYTES;
        self.draw.wanted = 16;
    }

    /// Copies the keys of a band, whole rows of the texture, to where they are read.
    pub(crate) fn find(&self, encoder: &mut wgpu::CommandEncoder, keys_bytes: u64) {
        let rows = (keys_bytes / KEYS_ROW_BYTES) as u32;
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(KEYS_ROW_BYTES as u32), rows_per_image: None };
        encoder.copy_buffer_to_texture(
            wgpu::TexelCopyBufferInfo { buffer: self.keys.buffer(), layout },
            self.found.texture().as_image_copy(),
            wgpu::Extent3d { width: store::WIDTH as u32, height: rows, depth_or_array_layers: 1 },
        );
    }
}

/// Draws splats through keys.
#[derive(Debug, Default)]
pub(crate) struct KeyedPass {
    pipelines: BTreeMap<Kernel, Pipelines>,
}

/// What a frame draws with.
pub(crate) struct KeyedFrame<'a> {
    pub(crate) kernel: Kernel,
    pub(crate) rounds: &'a [Round],
    pub(crate) resolving: Resolving,
    pub(crate) bands: Bands,
    pub(crate) plan: &'a Plan,
    pub(crate) chunks: &'a [Chunk],
    pub(crate) passes: &'a Pool,
    pub(crate) parts: &'a Pool,
    pub(crate) buffers: &'a KeyedBuffers,
}

/// Blending needs the nearest depth first; keys of 32 bits find depth and number one after the other.
fn phases(gpu: &Gpu, kernel: Kernel) -> u32 {
    if target(gpu, kernel) == Target::Keys64 { 1 } else { 2 }
}

/// Splats over each pixel, in the mean over the picture, from which on it pays to draw a few first. Measured on the software adapter.
const DEEP: f64 = 4.0;

/// In which rounds small splats are drawn; `area_px` is the area of all splats together. An atomic maximum costs the software
/// adapter ten times what a look at a texture does. So where many splats lie over each other, a few of them are drawn first, and
/// then most of the others are seen to be hidden. What is shown is the same: a key that is smaller than one already there changes
/// nothing.
pub(crate) fn rounds(gpu: &Gpu, size: ImageSize, kernel: Kernel, area_px: f64) -> &'static [Round] {
    let deep = area_px > DEEP * size.pixels() as f64;
    if deep && has_rounds(gpu, kernel) { &ALL_ROUNDS[1..] } else { &ALL_ROUNDS[..1] }
}

const ALL_ROUNDS: [Round; 3] = [Round::Whole, Round::First, Round::Rest];

fn has_rounds(gpu: &Gpu, kernel: Kernel) -> bool {
    gpu.is_software() && target(gpu, kernel) == Target::Keys64
}

/// The contents of the buffer of passes: all parameters, and last what a draw of large splats begins with.
pub(crate) fn pass_bytes(
    gpu: &Gpu,
    (camera, middle_px): (&Camera, [f32; 2]),
    kernel: Kernel,
    bands: &Bands,
    plan: &Plan,
    compute_extent_px: u32,
    wants_footprint: bool,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    for band in 0..bands.count {
        let rows = bands.rows_of(band);
        for phase in 0..phases(gpu, kernel) {
            for PlannedChunk { parts, splats, .. } in &plan.chunks {
                let params = PassParams {
                    first_row: rows.start,
                    end_row: rows.end,
                    phase,
                    compute_extent_px,
                    first_part: parts.start,
                    part_count: parts.end - parts.start,
                    chunk_count: *splats as u32,
                    wants_footprint: u32::from(wants_footprint),
                    ..PassParams::new(camera, middle_px)
                };
                bytes.extend_from_slice(bytemuck::bytes_of(&params));
                bytes.resize(bytes.len().next_multiple_of(STRIDE as usize), 0);
            }
        }
    }
    bytes.extend_from_slice(bytemuck::cast_slice(&[4u32, 0, 0, 0]));
    bytes
}

impl KeyedPass {
    /// Compiles what a frame needs, once.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, kernel: Kernel, resolving: Resolving) {
        let pipelines = self.pipelines.entry(kernel).or_insert_with(|| Pipelines::new(gpu, kernel));
        // All at once: a frame in the midst of a movement is no time for it.
        let rounds = if has_rounds(gpu, kernel) { &ALL_ROUNDS[..] } else { &ALL_ROUNDS[..1] };
        pipelines.prepare(gpu, rounds, resolving);
    }

    /// Draws all splats of a frame into a G-buffer, which it clears. The kernel has been prepared, and there is a splat. False where it
    /// was broken off; then the G-buffer is as it was, or partly so.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn encode(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        gbuffer: &GBuffer,
        frame: &KeyedFrame<'_>,
    ) -> Result<bool, RenderError> {
        let pipelines = &self.pipelines[&frame.kernel];
        let bound: Vec<[wgpu::BindGroup; 3]> =
            frame.chunks.iter().map(|chunk| bind(gpu, pipelines, frame, chunk)).collect();
        let chunks = frame.chunks.len() as u32;
        let phases = phases(gpu, frame.kernel);
        let pass_at = |band: u32, phase: u32, chunk: u32| (band * phases + phase) * chunks + chunk;
        let draw_template = u64::from(pass_at(frame.bands.count, 0, 0)) * STRIDE;
        let offset = |index: u32| index * STRIDE as u32;
        for band in 0..frame.bands.count {
            let rows = frame.bands.rows_of(band);
            let [keys, sums] = frame.bands.bytes(frame.kernel);
            commands.encoder().clear_buffer(frame.buffers.keys.buffer(), 0, Some(keys));
            if sums > 0 {
                commands.encoder().clear_buffer(frame.buffers.sums.buffer(), 0, Some(sums));
            }
            for (phase, chunk) in (0..phases).flat_map(|phase| (0..chunks).map(move |chunk| (phase, chunk))) {
                let pass_offset = offset(pass_at(band, phase, chunk));
                for round in frame.rounds {
                    if *round == Round::Rest {
                        frame.buffers.find(commands.encoder(), keys);
                    }
                    for slice in &frame.plan.chunks[chunk as usize].slices {
                        let (bound, parts) = (&bound[chunk as usize], slice.clone());
                        let slice = Slice { round: *round, parts, pass_offset, draw_template, bound };
                        slice.encode(commands.encoder(), pipelines, gbuffer, frame);
                        if !commands.goes_on()? {
                            return Ok(false);
                        }
                    }
                }
            }
            if !frame.kernel.is_gauss() {
                frame.buffers.find(commands.encoder(), keys);
            }
            let mut pass = gbuffer.begin(commands.encoder(), band == 0);
            pass.set_pipeline(pipelines.resolve(frame.resolving));
            pass.set_scissor_rect(0, rows.start, frame.bands.width, rows.end - rows.start);
            // Sums are of all chunks.
            let resolved = if frame.kernel.is_gauss() { 1 } else { chunks };
            for chunk in 0..resolved {
                let offsets = [offset(pass_at(band, 0, chunk)), offset(frame.plan.chunks[chunk as usize].parts.start)];
                let offsets = if frame.kernel.is_gauss() { &offsets[..1] } else { &offsets[..] };
                pass.set_bind_group(0, &bound[chunk as usize][2], offsets);
                pass.draw(0..3, 0..1);
            }
        }
        Ok(true)
    }
}

/// What is drawn in one go: small splats, and then the large ones among them.
struct Slice<'a> {
    round: Round,
    parts: Range<u32>,
    /// Of its [`PassParams`].
    pass_offset: u32,
    /// What the draw of large splats begins with, in the buffer of passes.
    draw_template: u64,
    bound: &'a [wgpu::BindGroup; 3],
}

impl Slice<'_> {
    fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &Pipelines,
        gbuffer: &GBuffer,
        frame: &KeyedFrame<'_>,
    ) {
        let [for_compute, for_quads, _] = self.bound;
        let draw = frame.buffers.draw.buffer();
        encoder.copy_buffer_to_buffer(frame.passes.buffer(), self.draw_template, draw, 0, 16);
        {
            let mut pass = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("small splats"), ..Default::default() });
            pass.set_pipeline(pipelines.compute(self.round));
            for part in self.parts.clone() {
                let groups = frame.plan.parts[part as usize].count.div_ceil(SPLATS_IN_GROUP);
                pass.set_bind_group(0, for_compute, &[self.pass_offset, part * STRIDE as u32]);
                pass.dispatch_workgroups(groups, 1, 1);
            }
        }
        // A pass must have an attachment; this one is not touched.
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("large splats"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &gbuffer::view(&gbuffer.depth_test),
                depth_ops: None,
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&pipelines.quads);
        pass.set_bind_group(0, for_quads, &[self.pass_offset]);
        pass.draw_indirect(draw, 0);
    }
}

/// Bind groups of the three passes for a chunk.
fn bind(gpu: &Gpu, pipelines: &Pipelines, frame: &KeyedFrame<'_>, chunk: &Chunk) -> [wgpu::BindGroup; 3] {
    let KeyedFrame { passes, parts, buffers, .. } = frame;
    let gauss = frame.kernel.is_gauss();
    let sums = gauss.then(|| buffers.sums.entry(5));
    let group = |at: usize, entries: Vec<wgpu::BindGroupEntry<'_>>| {
        let entries: Vec<_> = entries.into_iter().chain(sums.clone()).collect();
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipelines.layouts[at],
            entries: &entries,
        })
    };
    let (pass, part) = (passes.entry_of::<PassParams>(0), parts.entry_of::<PartParams>(1));
    let (keys, list, draw) = (buffers.keys.entry(4), buffers.list.entry(6), buffers.draw.entry(7));
    let store = [pass.clone(), chunk.balls.entry(2), chunk.normal_colors.entry(3)];
    let drawn = [&store[..], std::slice::from_ref(&keys)].concat();
    let mut computed = [&drawn[..], &[part.clone(), list.clone(), draw]].concat();
    if pipelines.target == Target::Keys64 {
        computed.push(buffers.found.entry(9));
    }
    let all_parts = parts.entry(8);
    let resolved = if gauss {
        vec![pass, keys]
    } else {
        [&store[..], &[part, all_parts.clone(), buffers.found.entry(9)]].concat()
    };
    [group(0, computed), group(1, [&drawn[..], &[all_parts, list]].concat()), group(2, resolved)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_all_rows_and_fit_into_a_binding() {
        for (width, height) in [(1, 1), (640, 360), (16384, 16384), (3, 7)] {
            let size = ImageSize { width, height };
            for kernel in [Kernel::Round, Kernel::Gauss] {
                let bands = Bands::new(size, kernel, 1 << 20);
                let mut next = 0;
                for band in 0..bands.count {
                    let rows = bands.rows_of(band);
                    assert!(rows.start == next && rows.end > next);
                    next = rows.end;
                }
                assert_eq!(next, height);
                assert!(bands.bytes(kernel).into_iter().all(|bytes| bytes <= 1 << 20));
            }
        }
    }
}
