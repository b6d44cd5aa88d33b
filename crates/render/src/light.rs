//! The lighting pass: G-buffer to picture. Shader: `shader/light.wgsl`.

use crate::gbuffer::{self, GBuffer};
use crate::memory::Pool;
use crate::shader::{self, Target};
use crate::splats::params::four;
use crate::{Gpu, cover, smooth};
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
        let params = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: std::num::NonZeroU64::new(size_of::<LightParams>() as u64),
            },
            count: None,
        };
        let layout = cover::layout(device, "light", &[params, cover::texture_entry(1), cover::texture_entry(2)]);
        let passes = (&module, "cover_picture", "light");
        let pipeline_to = |target| cover::pipeline(device, "light", &layout, passes, &[], target);
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
