//! One picture: everything a scene draws, lit.

use crate::gbuffer::{self, GBuffer};
use crate::light::{LightPass, PICTURE};
use crate::readback::read_texture;
use crate::splats::{Kernel, SplatBatch, SplatPass};
use crate::{Gpu, Lighting, RenderError};
use gigalod_geom::{Camera, ImageSize};
use gigalod_runtime::{DrawSource, Similarity, SplatBall};

/// How things are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look {
    /// Shape of splats.
    pub kernel: Kernel,
    /// Light and background.
    pub lighting: Lighting,
}

/// What a frame draws, from where.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// World space.
    pub camera: Camera,
    /// How it looks.
    pub look: Look,
    /// What each instance draws, and where it stands.
    pub draws: Vec<(Similarity, &'a DrawSource)>,
}

/// A finished picture and what it was lit from, on the host; rows from the top.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels.
    pub size: ImageSize,
    /// 8-bit sRGB and alpha, 4 bytes a pixel.
    pub rgba: Vec<u8>,
    /// Distance along the view axis, world units; `+inf` for background.
    pub depth: Vec<f32>,
    /// Largest distance in pixels between two points of the splat that was drawn; 0 for background.
    pub footprint_px: Vec<f32>,
}

/// Draws frames; keeps pipelines and targets between them.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    splat_pass: SplatPass,
    light_pass: LightPass,
    gbuffer: Option<(GBuffer, wgpu::Texture)>,
    gpu_bytes: u64,
}

impl Renderer {
    /// Compiles all passes.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    pub fn new(gpu: Gpu) -> Result<Self, RenderError> {
        let (splat_pass, light_pass) = (SplatPass::new(&gpu.device), LightPass::new(&gpu.device));
        gpu.check()?;
        Ok(Self { gpu, splat_pass, light_pass, gbuffer: None, gpu_bytes: 0 })
    }

    /// The device it draws with.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Bytes that the last frame took on the device.
    pub fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }

    /// Draws a frame and waits for it.
    ///
    /// # Errors
    /// [`RenderError::Size`], [`RenderError::Device`] and [`RenderError::ForeignDrawSource`].
    pub fn picture(&mut self, frame: &Frame<'_>) -> Result<Picture, RenderError> {
        let size = frame.camera.size;
        let limit = self.gpu.max_picture_edge();
        if size.width.min(size.height) == 0 || size.width.max(size.height) > limit {
            return Err(RenderError::Size { width: size.width, height: size.height, limit });
        }
        if self.gbuffer.as_ref().is_none_or(|(gbuffer, _)| gbuffer.size != size) {
            let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
            let picture = gbuffer::create_texture(&self.gpu.device, "picture", size, PICTURE, usage);
            self.gbuffer = Some((GBuffer::new(&self.gpu.device, size), picture));
        }
        let (gbuffer, picture) = self.gbuffer.as_ref().expect("made above where it was missing");
        let device = &self.gpu.device;
        let near = near_plane(frame);
        let mut batches: Vec<SplatBatch> = Vec::new();
        for (placement, source) in &frame.draws {
            match source {
                DrawSource::Splats(splats) => batches.extend(self.splat_pass.upload(
                    device,
                    &frame.camera,
                    placement,
                    frame.look.kernel,
                    near,
                    splats,
                )),
                _ => return Err(RenderError::ForeignDrawSource),
            }
        }
        self.gpu_bytes =
            gbuffer.bytes() + size.pixels() as u64 * 4 + batches.iter().map(SplatBatch::bytes).sum::<u64>();

        let lit = self.light_pass.bind(device, gbuffer, &frame.camera, &frame.look.lighting);
        let mut encoder = device.create_command_encoder(&Default::default());
        let [albedo, normal, depth, depth_test, target] =
            [&gbuffer.albedo, &gbuffer.normal, &gbuffer.depth, &gbuffer.depth_test, picture].map(gbuffer::view);
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("G-buffer"),
                color_attachments: &[
                    Some(cleared(&albedo, wgpu::Color::TRANSPARENT)),
                    Some(cleared(&normal, wgpu::Color::TRANSPARENT)),
                    Some(cleared(&depth, gbuffer::NO_DEPTH)),
                ],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &depth_test,
                    depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            for batch in &batches {
                self.splat_pass.draw(&mut pass, batch);
            }
        }
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("light"),
                color_attachments: &[Some(cleared(&target, wgpu::Color::TRANSPARENT))],
                ..Default::default()
            });
            self.light_pass.draw(&mut pass, &lit);
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()?;

        let rgba = read_texture(&self.gpu, picture, 4)?;
        let depth = read_texture(&self.gpu, &gbuffer.depth, 4)?;
        let normal = read_texture(&self.gpu, &gbuffer.normal, 8)?;
        Ok(Picture {
            size,
            rgba,
            depth: depth.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            footprint_px: normal.as_chunks::<8>().0.iter().map(|pixel| f32_of_f16([pixel[6], pixel[7]])).collect(),
        })
    }
}

fn cleared(view: &wgpu::TextureView, color: wgpu::Color) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(color), store: wgpu::StoreOp::Store },
    }
}

/// How close to the eye something may come before it counts as being there: about a 2²⁰th of the distance to the farthest
/// thing drawn. The depth buffer has the same precision whatever this is; and as it is a power of two, depths round the same
/// way whatever it is, so what else is drawn makes no difference to a pixel.
fn near_plane(frame: &Frame<'_>) -> f64 {
    let farthest = frame.draws.iter().map(|(placement, source)| match source {
        DrawSource::Splats(splats) => {
            let squared = |ball: &SplatBall| glam::Vec3::from_array(ball.center_in_eye).length_squared();
            f64::from(splats.iter().map(|(ball, _)| squared(ball)).fold(0.0, f32::max)).sqrt() * placement.scale
        }
        _ => 0.0,
    });
    match farthest.fold(0.0, f64::max) {
        0.0 => 1.0,
        farthest => power_of_two_below(farthest) / f64::from(1 << 20),
    }
}

fn power_of_two_below(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    f64::from_bits(value.to_bits() & EXPONENT)
}

/// IEEE 754 half to single precision; finite and positive numbers are all that is stored here.
fn f32_of_f16(bytes: [u8; 2]) -> f32 {
    let half = u16::from_le_bytes(bytes);
    let (exponent, fraction) = (half >> 10 & 31, f32::from(half & 1023) / 1024.0);
    match exponent {
        0 => fraction * 2f32.powi(-14),
        _ => (1.0 + fraction) * 2f32.powi(i32::from(exponent) - 15),
    }
}
