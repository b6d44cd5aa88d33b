//! The splat pass: balls into the G-buffer. Shader: `shader/splats.wgsl`.

use crate::gbuffer;
use crate::shader;
use gigalod_geom::Camera;
use gigalod_runtime::{ModelView, Similarity, SplatDraw};
use glam::DVec3;

pub(crate) const SOURCE: &str = include_str!("shader/splats.wgsl");

/// The shape of a splat; the splats paper, section 3.3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kernel {
    /// The square around the ball's silhouette.
    Square,
    /// The ball's silhouette itself.
    #[default]
    Round,
}

/// Inputs of the splat pass. WGSL twin: `shader/splat_params.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct SplatParams {
    /// View axes, in the model's axes.
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    /// The model's axes, in world axes.
    model_x: [f32; 4],
    model_y: [f32; 4],
    model_z: [f32; 4],
    size_px: [f32; 2],
    /// Pixels covered by one unit of length seen from one unit away.
    focal_px: f32,
    /// World units.
    near: f32,
    /// World units in a model unit.
    world_from_model: f32,
    kernel: u32,
    pad: [u32; 2],
}

/// Draws lists of splats.
#[derive(Debug)]
pub(crate) struct SplatPass {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

/// A list on the device, ready to be drawn.
#[derive(Debug)]
pub(crate) struct SplatBatch {
    bind_group: wgpu::BindGroup,
    splats: wgpu::Buffer,
    count: u32,
}

impl SplatPass {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let module = shader::module(device, "splats.wgsl", SOURCE);
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("splats"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: std::num::NonZeroU64::new(size_of::<SplatParams>() as u64),
                },
                count: None,
            }],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("splats"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("splats"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("place"),
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<SplatDraw>() as u64,
                    step_mode: wgpu::VertexStepMode::Instance,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Uint32],
                })],
            },
            primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleStrip, ..Default::default() },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: gbuffer::DEPTH_TEST,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("cover"),
                compilation_options: Default::default(),
                targets: &[Some(gbuffer::ALBEDO.into()), Some(gbuffer::NORMAL.into()), Some(gbuffer::DEPTH.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline, layout }
    }

    /// Uploads a list, in as many batches as the device's buffers make of it.
    pub(crate) fn upload(
        &self,
        device: &wgpu::Device,
        camera: &Camera,
        placement: &Similarity,
        kernel: Kernel,
        near: f64,
        splats: &[SplatDraw],
    ) -> Vec<SplatBatch> {
        let params = SplatParams::new(camera, placement, kernel, near);
        let most = device.limits().max_buffer_size.min(1 << 30) as usize / size_of::<SplatDraw>();
        splats
            .chunks(most.max(1))
            .map(|splats| {
                let uniform =
                    buffer_with(device, "splat params", wgpu::BufferUsages::UNIFORM, bytemuck::bytes_of(&params));
                let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("splats"),
                    layout: &self.layout,
                    entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }],
                });
                let buffer = buffer_with(device, "splats", wgpu::BufferUsages::VERTEX, bytemuck::cast_slice(splats));
                SplatBatch { bind_group, splats: buffer, count: splats.len() as u32 }
            })
            .collect()
    }

    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, batch: &SplatBatch) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &batch.bind_group, &[]);
        pass.set_vertex_buffer(0, batch.splats.slice(..));
        pass.draw(0..4, 0..batch.count);
    }
}

impl SplatBatch {
    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.splats.size()
    }
}

impl SplatParams {
    fn new(camera: &Camera, placement: &Similarity, kernel: Kernel, near: f64) -> Self {
        let view = ModelView::new(camera, placement).camera;
        let in_world = |axis: DVec3| four(placement.rotation * axis);
        Self {
            right: four(view.right),
            up: four(view.up),
            forward: four(view.forward),
            model_x: in_world(DVec3::X),
            model_y: in_world(DVec3::Y),
            model_z: in_world(DVec3::Z),
            size_px: [camera.size.width as f32, camera.size.height as f32],
            focal_px: camera.focal_px() as f32,
            near: near as f32,
            world_from_model: placement.scale as f32,
            kernel: match kernel {
                Kernel::Square => 0,
                Kernel::Round => 1,
            },
            pad: [0; 2],
        }
    }
}

/// A direction as a uniform holds it.
pub(crate) fn four(direction: DVec3) -> [f32; 4] {
    direction.as_vec3().extend(0.0).to_array()
}

/// A buffer with these contents.
pub(crate) fn buffer_with(
    device: &wgpu::Device,
    label: &str,
    usage: wgpu::BufferUsages,
    contents: &[u8],
) -> wgpu::Buffer {
    use wgpu::util::DeviceExt;
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splat_params_have_one_layout() {
        shader::assert_same_layout!(
            SplatParams,
            SOURCE,
            [right, up, forward, model_x, model_y, model_z, size_px, focal_px, near, world_from_model, kernel, pad]
        );
    }

    #[test]
    fn a_splat_is_five_words_in_the_order_of_the_vertex_attributes() {
        assert_eq!(size_of::<SplatDraw>(), 20);
        let offsets = [
            std::mem::offset_of!(SplatDraw, center_in_eye),
            std::mem::offset_of!(SplatDraw, radius),
            std::mem::offset_of!(SplatDraw, normal_color),
        ];
        let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Uint32];
        assert_eq!(offsets.map(|at| at as u64), attributes.map(|attribute| attribute.offset));
    }
}
