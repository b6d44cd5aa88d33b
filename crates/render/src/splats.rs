//! The splat pass: balls into the G-buffer. Shader: `shader/splats.wgsl`.

use crate::gbuffer;
use crate::shader;
use gigalod_geom::Camera;
use gigalod_runtime::splats::NormalColor;
use gigalod_runtime::{ModelView, Similarity, SplatBall, SplatList};
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

/// The columns of a [`SplatList`], as the shader reads them.
fn columns() -> [wgpu::VertexBufferLayout<'static>; 2] {
    const BALL: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32];
    const NORMAL_COLOR: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![2 => Uint32];
    let column = |stride: usize, attributes| wgpu::VertexBufferLayout {
        array_stride: stride as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes,
    };
    [column(size_of::<SplatBall>(), &BALL), column(size_of::<NormalColor>(), &NORMAL_COLOR)]
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
    balls: wgpu::Buffer,
    normal_colors: wgpu::Buffer,
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
                buffers: &columns().map(Some),
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
        splats: &SplatList,
    ) -> Vec<SplatBatch> {
        let params = SplatParams::new(camera, placement, kernel, near);
        let most = device.limits().max_buffer_size.min(1 << 30) as usize / size_of::<SplatBall>();
        let batch = |balls: &[SplatBall], normal_colors: &[NormalColor]| {
            let uniform = buffer_with(device, "splat params", wgpu::BufferUsages::UNIFORM, bytemuck::bytes_of(&params));
            let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("splats"),
                layout: &self.layout,
                entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }],
            });
            SplatBatch {
                bind_group,
                balls: buffer_with(device, "balls", wgpu::BufferUsages::VERTEX, bytemuck::cast_slice(balls)),
                normal_colors: buffer_with(
                    device,
                    "normals and colours",
                    wgpu::BufferUsages::VERTEX,
                    bytemuck::cast_slice(normal_colors),
                ),
                count: balls.len() as u32,
            }
        };
        let pieces = splats.pieces.iter();
        pieces
            .flat_map(|piece| piece.balls.chunks(most.max(1)).zip(piece.normal_colors.chunks(most.max(1))))
            .map(|(balls, normal_colors)| batch(balls, normal_colors))
            .collect()
    }

    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, batch: &SplatBatch) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &batch.bind_group, &[]);
        pass.set_vertex_buffer(0, batch.balls.slice(..));
        pass.set_vertex_buffer(1, batch.normal_colors.slice(..));
        pass.draw(0..4, 0..batch.count);
    }
}

impl SplatBatch {
    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.balls.size() + self.normal_colors.size()
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
    fn the_columns_of_a_list_are_vertex_buffers() {
        let [balls, normal_colors] = columns();
        assert_eq!((size_of::<SplatBall>(), size_of::<NormalColor>()), (16, 4));
        let offsets = [std::mem::offset_of!(SplatBall, center_in_eye), std::mem::offset_of!(SplatBall, radius)];
        assert_eq!(offsets.map(|at| at as u64).as_slice(), [0, 1].map(|at: usize| balls.attributes[at].offset));
        assert_eq!((balls.array_stride, normal_colors.array_stride), (16, 4));
    }
}
