//! Hybrid nodes through keys: what is nearest in each pixel is found by atomic maxima in a storage buffer, then written to the
//! G-buffer. Shaders: `shader/hybrid_small.wgsl`, `hybrid_large.wgsl`, `hybrid_resolve.wgsl`.
//!
//! As for splats, a picture is drawn in bands of rows and primitives in slices, between which a frame can be broken off. Lines come last, in
//! bands of their own: they look at what is there in the whole picture (`shader/hybrid_gaps.wgsl`).

use crate::commands::Commands;
use crate::gbuffer::{self, GBuffer};
use crate::hybrid::params::{HybridParams, NODE_TEXELS, NodeParams, RUN_LOG2};
use crate::hybrid::pipelines::{Pipelines, Resolving};
use crate::hybrid::plan::{Kind, Plan, RunParams, Slice, most_runs};
use crate::memory::Pool;
use crate::splats::Kernel;
use crate::splats::keyed::{Bands, KeyedBuffers, LISTED_BYTES, MOST_COMPUTE_EXTENT_PX};
use crate::splats::params::STRIDE;
use crate::splats::store::WIDTH;
use crate::staging::Staging;
use crate::{Gpu, RenderError};
use gigalod_geom::Camera;

/// What is at most so many pixels wide and high is drawn by single invocations, unless
/// [`crate::Renderer::set_compute_extent`] says otherwise. Measured on the software adapter (`examples/hybrid_drawing.rs`): beginning a
/// workgroup for a triangle takes it as long as an invocation takes for thousands of pixels.
pub(crate) fn compute_extent_px(gpu: &Gpu) -> u32 {
    if gpu.is_software() { MOST_COMPUTE_EXTENT_PX } else { 16 }
}

/// Bytes of what a draw of large primitives begins with: workgroups in three directions, and how many primitives.
const DISPATCH_BYTES: u64 = 16;

/// Workgroups that share a large primitive: at least so many, and so many that none takes too many turns.
fn shares(bands: &Bands) -> u32 {
    const LEAST: u64 = 4;
    const MOST_TURNS: u64 = 1 << 15;
    let [width, rows] = bands.size().map(u64::from);
    (width.div_ceil(8) * (rows.div_ceil(8) + 1)).div_ceil(MOST_TURNS).max(LEAST) as u32
}

/// Buffers besides those of splats, whose keys and list serve here too.
#[derive(Debug)]
pub(crate) struct HybridBuffers {
    pub(crate) pages: Pool,
    pub(crate) nodes: Pool,
    pub(crate) runs: Pool,
    pub(crate) passes: Pool,
}

impl HybridBuffers {
    pub(crate) fn new() -> Self {
        use wgpu::BufferUsages as Usage;
        Self {
            pages: Pool::rows("pages of nodes", wgpu::TextureFormat::Rg32Uint, WIDTH),
            nodes: Pool::rows("nodes", wgpu::TextureFormat::Rgba32Uint, WIDTH),
            runs: Pool::rows("runs", wgpu::TextureFormat::Rg32Uint, WIDTH),
            passes: Pool::new("passes over nodes", Usage::UNIFORM | Usage::COPY_SRC),
        }
    }

    /// Asks for room for tables and keys of a frame; pages are another matter.
    ///
    /// # Errors
    /// [`RenderError::TooMany`] where the tables are too large for the device.
    pub(crate) fn want(
        &mut self,
        shared: &mut KeyedBuffers,
        gpu: &Gpu,
        bands: &Bands,
        plan: &Plan,
        pass_bytes: u64,
    ) -> Result<(), RenderError> {
        let in_texture = u64::from(gpu.max_picture_edge()) * WIDTH;
        let too_many = u64::from(plan.nodes) > in_texture / NODE_TEXELS || plan.runs.len() as u64 > in_texture;
        if too_many || pass_bytes > gpu.most_buffer_bytes() {
            return Err(RenderError::TooMany((plan.runs.len() as u64) << RUN_LOG2));
        }
        self.nodes.wanted = u64::from(plan.nodes.max(1)) * size_of::<NodeParams>() as u64;
        self.runs.wanted = plan.runs.len().max(1) as u64 * size_of::<RunParams>() as u64;
        self.passes.wanted = pass_bytes;
        let [keys, _] = bands.bytes(Kernel::Round);
        let most = |pool: &mut Pool, bytes: u64| pool.wanted = pool.wanted.max(bytes);
        most(&mut shared.keys, keys);
        most(&mut shared.found, keys);
        let in_slice = (plan.runs.len() as u64).clamp(1, u64::from(most_runs(gpu))) << RUN_LOG2;
        most(&mut shared.list, in_slice * LISTED_BYTES);
        most(&mut shared.draw, DISPATCH_BYTES);
        Ok(())
    }

    /// Bytes of tables of a usual frame, and of its list.
    pub(crate) fn usual_bytes(gpu: &Gpu) -> u64 {
        const NODES: u64 = 1 << 13;
        let tables = NODES * size_of::<NodeParams>() as u64 + 4 * NODES * size_of::<RunParams>() as u64;
        tables + (u64::from(most_runs(gpu)) << RUN_LOG2) * LISTED_BYTES + 4 * NODES * STRIDE / u64::from(most_runs(gpu))
    }

    /// Sends the tables of a frame.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn send(
        &self,
        gpu: &Gpu,
        staging: &mut Staging,
        nodes: &[NodeParams],
        runs: &[RunParams],
    ) -> Result<(), RenderError> {
        staging.write_texels(gpu, self.nodes.texture(), 0, bytemuck::cast_slice(nodes))?;
        staging.write_texels(gpu, self.runs.texture(), 0, bytemuck::cast_slice(runs))
    }
}

/// The contents of the buffer of passes: all parameters, and last what a draw of large primitives begins with.
pub(crate) fn pass_bytes(
    gpu: &Gpu,
    (camera, middle_px, turn): (&Camera, [f32; 2], u32),
    bands: &Bands,
    plan: &Plan,
    compute_extent_px: u32,
) -> Vec<u8> {
    let phases = if gpu.has_wide_keys() { 1 } else { 2 };
    let mut bytes = Vec::new();
    for band in 0..bands.count() {
        let rows = bands.rows_of(band);
        for phase in 0..phases {
            for slice in &plan.slices {
                let params = HybridParams {
                    first_row: rows.start,
                    end_row: rows.end,
                    phase,
                    compute_extent_px,
                    first_run: slice.runs.start,
                    first_point_run: plan.first_runs[0],
                    first_line_run: plan.first_runs[1],
                    turn,
                    ..HybridParams::new(camera, middle_px)
                };
                bytes.extend_from_slice(bytemuck::bytes_of(&params));
                bytes.resize(bytes.len().next_multiple_of(STRIDE as usize), 0);
            }
        }
    }
    bytes.extend_from_slice(bytemuck::cast_slice(&[0, shares(bands), 1, 0]));
    bytes
}

/// What a frame draws with.
pub(crate) struct HybridFrame<'a> {
    pub(crate) bands: Bands,
    pub(crate) plan: &'a Plan,
    pub(crate) buffers: &'a HybridBuffers,
    pub(crate) shared: &'a KeyedBuffers,
}

/// Draws nodes through keys.
#[derive(Debug, Default)]
pub(crate) struct HybridPass {
    pipelines: Option<Pipelines>,
}

fn resolving(plan: &Plan) -> Resolving {
    Resolving { has_spots: plan.has_spots(), has_colors: plan.has_colors }
}

impl HybridPass {
    /// Compiles what a frame needs, once.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, plan: &Plan) {
        let pipelines = self.pipelines.get_or_insert_with(|| Pipelines::new(gpu));
        pipelines.prepare(gpu, plan.slices.iter().map(|slice| slice.kind), resolving(plan));
    }

    /// Draws all nodes of a frame over what is in a G-buffer; prepared. False where it was broken off.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn encode(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        gbuffer: &GBuffer,
        frame: &HybridFrame<'_>,
    ) -> Result<bool, RenderError> {
        let pipelines = self.pipelines.as_ref().expect("prepared");
        let bound = bind(gpu, pipelines, gbuffer, frame);
        let slices = frame.plan.slices.len() as u32;
        let phases = pipelines.phases();
        let offset = |band: u32, phase: u32, slice: u32| ((band * phases + phase) * slices + slice) * STRIDE as u32;
        let template = u64::from(offset(frame.bands.count(), 0, 0));
        let keys = frame.shared.keys.buffer();
        let [keys_bytes, _] = frame.bands.bytes(Kernel::Round);
        let first_line = frame.plan.slices.partition_point(|slice| slice.kind < Kind::Lines);
        for part in [0..first_line, first_line..frame.plan.slices.len()] {
            if part.is_empty() {
                continue;
            }
            if frame.plan.slices[part.start].kind == Kind::Lines {
                gbuffer.keep_depths(commands.encoder());
            }
            for band in 0..frame.bands.count() {
                let rows = frame.bands.rows_of(band);
                commands.encoder().clear_buffer(keys, 0, Some(keys_bytes));
                for (phase, at) in (0..phases).flat_map(|phase| part.clone().map(move |at| (phase, at))) {
                    let (slice, offset) = (&frame.plan.slices[at], offset(band, phase, at as u32));
                    draw(commands.encoder(), pipelines, frame, slice, &bound, offset, template);
                    if !commands.goes_on()? {
                        return Ok(false);
                    }
                }
                frame.shared.find(commands.encoder(), keys_bytes);
                let mut pass = gbuffer.begin(commands.encoder(), false);
                pass.set_pipeline(pipelines.resolve(resolving(frame.plan)));
                let [columns, in_picture] = &frame.plan.window;
                let (first, end) = (rows.start.max(in_picture.start), rows.end.min(in_picture.end));
                if columns.start < columns.end && first < end {
                    pass.set_scissor_rect(columns.start, first, columns.end - columns.start, end - first);
                    pass.set_bind_group(0, &bound[2], &[offset(band, 0, 0)]);
                    pass.draw(0..3, 0..1);
                }
            }
        }
        Ok(true)
    }
}

/// A slice: what is small, and then what is large.
fn draw(
    encoder: &mut wgpu::CommandEncoder,
    pipelines: &Pipelines,
    frame: &HybridFrame<'_>,
    slice: &Slice,
    bound: &[wgpu::BindGroup; 3],
    pass_offset: u32,
    template: u64,
) {
    let dispatch = frame.shared.draw.buffer();
    encoder.copy_buffer_to_buffer(frame.buffers.passes.buffer(), template, dispatch, 0, DISPATCH_BYTES);
    let Slice { kind, runs } = slice;
    let mut pass =
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("nodes"), ..Default::default() });
    pass.set_pipeline(pipelines.small(*kind));
    pass.set_bind_group(0, &bound[0], &[pass_offset]);
    pass.dispatch_workgroups(runs.end - runs.start, 1, 1);
    pass.set_pipeline(pipelines.large(*kind));
    pass.set_bind_group(0, &bound[1], &[pass_offset]);
    pass.dispatch_workgroups_indirect(dispatch, 0);
}

/// Bind groups of the three passes.
fn bind(gpu: &Gpu, pipelines: &Pipelines, gbuffer: &GBuffer, frame: &HybridFrame<'_>) -> [wgpu::BindGroup; 3] {
    let HybridFrame { buffers, shared, .. } = frame;
    let tables = [
        buffers.passes.entry_of::<HybridParams>(0),
        buffers.pages.entry(1),
        buffers.nodes.entry(2),
        buffers.runs.entry(3),
    ];
    // Nothing but lines looks at it.
    let before = gbuffer::view(gbuffer.before.as_ref().unwrap_or(&gbuffer.depth));
    let before = wgpu::BindGroupEntry { binding: 9, resource: wgpu::BindingResource::TextureView(&before) };
    let drawn = [shared.keys.entry(4), shared.list.entry(6), shared.draw.entry(7), before];
    let found = [shared.found.entry(9)];
    [&drawn[..], &drawn[..], &found[..]]
        .iter()
        .enumerate()
        .map(|(at, others)| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipelines.layouts[at],
                entries: &[&tables[..], others].concat(),
            })
        })
        .collect::<Vec<_>>()
        .try_into()
        .expect("one for each pass")
}
