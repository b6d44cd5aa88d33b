//! Splats by the depth test alone, for devices that cannot write storage. Shader: `shader/splat_depth_test.wgsl`.

use crate::Gpu;
use crate::gbuffer::{self, GBuffer};
use crate::memory::Pool;
use crate::shader::{self, Target};
use crate::splats::params::{PartParams, PassParams, STRIDE};
use crate::splats::store::{self, Chunk, Plan};
use crate::splats::{DEPTH_TEST, Kernel};
use gigalod_geom::Camera;
use std::collections::BTreeMap;

/// Draws splats by the depth test.
#[derive(Debug, Default)]
pub(crate) struct DepthTestPass {
    pipelines: BTreeMap<Kernel, (wgpu::RenderPipeline, wgpu::BindGroupLayout)>,
}

/// The contents of the buffer of passes: one.
pub(crate) fn pass_bytes(camera: &Camera, middle_px: [f32; 2]) -> Vec<u8> {
    bytemuck::bytes_of(&PassParams::new(camera, middle_px)).to_vec()
}

/// What a frame draws with.
pub(crate) struct DepthTestFrame<'a> {
    pub(crate) kernel: Kernel,
    pub(crate) plan: &'a Plan,
    pub(crate) chunks: &'a [Chunk],
    pub(crate) passes: &'a Pool,
    pub(crate) parts: &'a Pool,
}

impl DepthTestPass {
    /// Compiles the pass of a kernel that does not blend, once.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, kernel: Kernel) {
        self.pipelines.entry(kernel).or_insert_with(|| compile(gpu, kernel));
    }

    /// Draws all splats of a frame into a G-buffer, which it clears. The kernel has been prepared.
    pub(crate) fn encode(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        gbuffer: &GBuffer,
        frame: &DepthTestFrame<'_>,
    ) {
        let DepthTestFrame { kernel, plan, chunks, passes, parts } = *frame;
        let (pipeline, layout) = &self.pipelines[&kernel];
        let mut pass = gbuffer.begin(encoder, true);
        pass.set_pipeline(pipeline);
        for (chunk, planned) in chunks.iter().zip(&plan.chunks) {
            let bound = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("splats"),
                layout,
                entries: &[
                    passes.entry_of::<PassParams>(0),
                    parts.entry_of::<PartParams>(1),
                    chunk.balls.entry(2),
                    chunk.normal_colors.entry(3),
                ],
            });
            for index in planned.parts.clone() {
                pass.set_bind_group(0, &bound, &[index * STRIDE as u32]);
                pass.draw(0..4, 0..plan.parts[index as usize].count);
            }
        }
    }
}

fn compile(gpu: &Gpu, kernel: Kernel) -> (wgpu::RenderPipeline, wgpu::BindGroupLayout) {
    let device = &gpu.device;
    let module = shader::module(device, "splat_depth_test.wgsl", DEPTH_TEST, Target::None);
    let uniform = |binding, has_dynamic_offset, bytes: usize| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset,
            min_binding_size: std::num::NonZeroU64::new(bytes as u64),
        },
        count: None,
    };
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("splats"),
        entries: &[
            uniform(0, false, size_of::<PassParams>()),
            uniform(1, true, size_of::<PartParams>()),
            store::layout_entry(2, wgpu::ShaderStages::VERTEX),
            store::layout_entry(3, wgpu::ShaderStages::VERTEX),
        ],
    });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("splats"),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let constants = [("kernel", kernel.code())];
    let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("splats"),
        layout: Some(&pipeline_layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("place"),
            compilation_options: options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleStrip, ..Default::default() },
        depth_stencil: Some(gbuffer::depth_state(wgpu::CompareFunction::Greater, true)),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("cover"),
            compilation_options: options,
            targets: &gbuffer::COLOR_TARGETS,
        }),
        multiview_mask: None,
        cache: None,
    });
    (pipeline, layout)
}
