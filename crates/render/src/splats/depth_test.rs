//! Splats by the depth test alone, for devices that cannot write storage. Shader: `shader/splat_depth_test.wgsl`.

use crate::Gpu;
use crate::gbuffer::{self, GBuffer};
use crate::memory::Pool;
use crate::shader::{self, Target};
use crate::splats::params::{PartParams, PassParams, STRIDE};
use crate::splats::store::{Chunk, Plan};
use crate::splats::{DEPTH_TEST, Kernel};
use gigalod_geom::Camera;
use gigalod_runtime::SplatBall;
use std::collections::BTreeMap;

/// Draws splats by the depth test.
#[derive(Debug, Default)]
pub(crate) struct DepthTestPass {
    pipelines: BTreeMap<Kernel, (wgpu::RenderPipeline, wgpu::BindGroupLayout)>,
}

/// The contents of the buffer of passes: one.
pub(crate) fn pass_bytes(camera: &Camera) -> Vec<u8> {
    bytemuck::bytes_of(&PassParams::new(camera)).to_vec()
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
        kernel: Kernel,
        plan: &Plan,
        chunks: &[Chunk],
        [passes, parts]: [&Pool; 2],
    ) {
        let (pipeline, layout) = &self.pipelines[&kernel];
        let bound = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("splats"),
            layout,
            entries: &[passes.entry_of::<PassParams>(0), parts.entry_of::<PartParams>(1)],
        });
        let mut pass = gbuffer.begin(encoder, true);
        pass.set_pipeline(pipeline);
        for chunk in chunks {
            for index in chunk.parts.clone() {
                let part = &plan.parts[index as usize];
                let from = u64::from(part.first_slot);
                pass.set_bind_group(0, &bound, &[index * STRIDE as u32]);
                pass.set_vertex_buffer(0, chunk.balls.buffer().slice(from * size_of::<SplatBall>() as u64..));
                pass.set_vertex_buffer(1, chunk.normal_colors.buffer().slice(from * 4..));
                pass.draw(0..4, 0..part.count);
            }
        }
    }
}

/// The columns of a list of splats, as the shader reads them.
fn columns() -> [wgpu::VertexBufferLayout<'static>; 2] {
    const BALL: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![0 => Float32x4];
    const NORMAL_COLOR: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![1 => Uint32];
    let column = |stride: usize, attributes| wgpu::VertexBufferLayout {
        array_stride: stride as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes,
    };
    [column(size_of::<SplatBall>(), &BALL), column(4, &NORMAL_COLOR)]
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
        entries: &[uniform(0, false, size_of::<PassParams>()), uniform(1, true, size_of::<PartParams>())],
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
            buffers: &columns().map(Some),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_columns_of_a_list_are_vertex_buffers() {
        assert_eq!(columns().map(|column| column.array_stride), [16, 4]);
        // Centre, then radius: the four numbers of a ball.
        let offsets = [std::mem::offset_of!(SplatBall, center_in_eye), std::mem::offset_of!(SplatBall, radius)];
        assert_eq!((size_of::<SplatBall>(), offsets), (16, [0, 12]));
    }
}
