//! The lighting pass: G-buffer to picture. Shader: `shader/light.wgsl`.

use crate::gbuffer::{self, GBuffer};
use crate::memory::Pool;
use crate::shader::{self, Target};
use crate::splats::params::four;
use crate::{Gpu, smooth};
use gigalod_geom::Camera;
use gigalod_geom::color::LINEAR_OF_SRGB8;
use glam::DVec3;

pub(crate) const SOURCE: &str = include_str!("shader/light.wgsl");

/// The finished picture.
pub(crate) const PICTURE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// Share of the light that comes from everywhere; design.md's shading for all comparisons.
const AMBIENT: f32 = 0.15;

/// Where light comes from, and what is seen where there is nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Towards the light, world space, any length; `None` for a lamp at the viewer's shoulder.
    pub towards_light: Option<DVec3>,
    /// 8-bit sRGB.
    pub background: [u8; 3],
}

impl Default for Lighting {
    fn default() -> Self {
        Self { towards_light: None, background: [32, 32, 36] }
    }
}

/// Inputs of the lighting pass. WGSL twin: `shader/light_params.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct LightParams {
    /// View axes, in world axes.
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    /// Unit vector, world axes.
    towards_light: [f32; 4],
    /// Linear light.
    light: [f32; 4],
    /// Linear light; alpha 1.
    background: [f32; 4],
    middle_px: [f32; 2],
    focal_px: f32,
    ambient: f32,
    /// What this picture is of a sum of several.
    share: f32,
    pad_a: f32,
    pad_b: f32,
    pad_c: f32,
}

/// Lights a G-buffer.
#[derive(Debug)]
pub(crate) struct LightPass {
    pipeline: wgpu::RenderPipeline,
    /// Adds to a sum; where the device can.
    adding: Option<wgpu::RenderPipeline>,
    layout: wgpu::BindGroupLayout,
}

impl LightPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let device = &gpu.device;
        let module = shader::module(device, "light.wgsl", SOURCE, Target::None);
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let unfiltered = wgpu::TextureSampleType::Float { filterable: false };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("light"),
            entries: &[
                entry(
                    0,
                    wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: false,
                        min_binding_size: std::num::NonZeroU64::new(size_of::<LightParams>() as u64),
                    },
                ),
                entry(1, texture(unfiltered)),
                entry(2, texture(unfiltered)),
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("light"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline_to = |target: wgpu::ColorTargetState| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("light"),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("cover_picture"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: Default::default(),
                depth_stencil: None,
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("light"),
                    compilation_options: Default::default(),
                    targets: &[Some(target)],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let sum = wgpu::ColorTargetState { blend: Some(smooth::ADD), ..smooth::SUM.into() };
        let adding = gpu.can_add().then(|| pipeline_to(sum));
        Self { pipeline: pipeline_to(PICTURE.into()), adding, layout }
    }

    /// What its uniform buffer holds.
    pub(crate) fn params(camera: &Camera, lighting: &Lighting, middle_px: [f32; 2], share: f32) -> LightParams {
        let linear = |srgb: [u8; 3]| {
            let [r, g, b] = srgb.map(|value| LINEAR_OF_SRGB8[usize::from(value)]);
            [r, g, b, 1.0]
        };
        let towards = lighting.towards_light.and_then(|light| light.try_normalize());
        LightParams {
            right: four(camera.right),
            up: four(camera.up),
            forward: four(camera.forward),
            towards_light: four(towards.unwrap_or(camera.shoulder_light())),
            light: [1.0; 4],
            background: linear(lighting.background),
            middle_px,
            focal_px: camera.focal_px() as f32,
            ambient: AMBIENT,
            share,
            pad_a: 0.0,
            pad_b: 0.0,
            pad_c: 0.0,
        }
    }

    /// Binds a G-buffer and a way of lighting it.
    pub(crate) fn bind(&self, device: &wgpu::Device, gbuffer: &GBuffer, params: &Pool) -> wgpu::BindGroup {
        let [albedo, normal] = [&gbuffer.albedo, &gbuffer.normal].map(gbuffer::view);
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("light"),
            layout: &self.layout,
            entries: &[
                entry(0, params.binding()),
                entry(1, wgpu::BindingResource::TextureView(&albedo)),
                entry(2, wgpu::BindingResource::TextureView(&normal)),
            ],
        })
    }

    /// Into a picture, or to be added to a sum.
    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, bind_group: &wgpu::BindGroup, adds: bool) {
        let adding = self.adding.as_ref().filter(|_| adds);
        pass.set_pipeline(adding.unwrap_or(&self.pipeline));
        pass.set_bind_group(0, bind_group, &[]);
        pass.draw(0..3, 0..1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_params_have_one_layout() {
        shader::assert_same_layout!(
            LightParams,
            SOURCE,
            [
                right,
                up,
                forward,
                towards_light,
                light,
                background,
                middle_px,
                focal_px,
                ambient,
                share,
                pad_a,
                pad_b,
                pad_c
            ]
        );
    }
}
