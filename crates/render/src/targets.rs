//! What a picture of one size is drawn into, and the way from there to the host.
//!
//! Goes in: a size. Comes out: textures on the device, or a [`Picture`] of what was drawn. What always holds: a picture that is shown
//! somewhere stays until it is no longer shown.

use crate::gbuffer::GBuffer;
use crate::light::PICTURE;
use crate::memory::Pool;
use crate::readback::read_texture;
use crate::{Gpu, RenderError, smooth};
use gigalod_geom::ImageSize;

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

/// G-buffer and picture.
#[derive(Debug)]
pub(crate) struct Targets {
    pub(crate) gbuffer: GBuffer,
    pub(crate) picture: wgpu::Texture,
    /// What several pictures add up to, for smooth edges.
    pub(crate) sum: Option<wgpu::Texture>,
}

impl Targets {
    pub(crate) fn new(gpu: &Gpu, size: ImageSize) -> Self {
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::TEXTURE_BINDING;
        let picture = gpu.create_shown_texture("picture", size, PICTURE, usage);
        Self { gbuffer: GBuffer::new(&gpu.device, size), picture, sum: None }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(size: ImageSize, samples: u32, has_lines: bool) -> u64 {
        let further = smooth::sum_bytes(size, samples) + GBuffer::before_bytes(size, has_lines);
        GBuffer::bytes(size) + size.pixels() as u64 * 4 + further
    }

    /// Bytes that these take.
    pub(crate) fn own_bytes(&self) -> u64 {
        Self::bytes(self.gbuffer.size, if self.sum.is_some() { 2 } else { 1 }, self.gbuffer.before.is_some())
    }

    /// Makes what a frame of so many samples, with lines or without, needs besides, and frees what it does not.
    pub(crate) fn want(&mut self, gpu: &Gpu, samples: u32, has_lines: bool) {
        self.gbuffer.want_before(&gpu.device, has_lines);
        if samples == 1 {
            self.sum.take().iter().for_each(wgpu::Texture::destroy);
        } else if self.sum.is_none() {
            self.sum = Some(smooth::create_sum(gpu, self.gbuffer.size));
        }
    }

    /// Frees them at once; the picture when nobody shows it any more.
    pub(crate) fn free(self) {
        self.gbuffer.free();
        self.sum.iter().for_each(wgpu::Texture::destroy);
    }

    /// Waits for the device, and brings what it drew to the host; `through` has room as [`crate::readback::buffer_bytes`] says.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn read(&self, gpu: &Gpu, through: &Pool) -> Result<Picture, RenderError> {
        let rgba = read_texture(gpu, &self.picture, 4, through)?;
        let depth = read_texture(gpu, &self.gbuffer.depth, 4, through)?;
        let normal = read_texture(gpu, &self.gbuffer.normal, 8, through)?;
        Ok(Picture {
            size: self.gbuffer.size,
            rgba,
            depth: depth.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            footprint_px: normal.as_chunks::<8>().0.iter().map(|pixel| f32_of_f16([pixel[6], pixel[7]])).collect(),
        })
    }
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
