//! Smooth edges: a picture is the mean, in linear light, of several that are sampled at other places of each pixel.
//!
//! Goes in: how many. Comes out: where, and the pass that brings their sum into the picture. Shader: `shader/smooth.wgsl`.
//!
//! What always holds: the places are the same for the same number, spread evenly over the pixel (their mean is its middle where their
//! number is odd); the last is the middle itself, so that what lies in the G-buffer afterwards is what it is without smoothing.

use crate::cover;
use crate::gbuffer;
use crate::light::PICTURE;
use crate::shader::{self, Target};
use crate::{Gpu, RenderError};
use gigalod_geom::{Camera, ImageSize};
use glam::DVec2;

pub(crate) const SOURCE: &str = include_str!("shader/smooth.wgsl");

/// Holds what pictures add up to, in linear light: half floats, the finest that every device can add to.
pub(crate) const SUM: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Most places in a pixel. The sum keeps 11 bits, so more would not be seen.
pub const MOST_SAMPLES: u32 = 64;

/// Adds up.
pub(crate) const ADD: wgpu::BlendState = {
    let component = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState { color: component, alpha: component }
};

/// Bytes on the device of what several pictures add up to.
pub(crate) fn sum_bytes(size: ImageSize, samples: u32) -> u64 {
    if samples > 1 { size.pixels() as u64 * 8 } else { 0 }
}

/// A target to add pictures up in.
pub(crate) fn create_sum(gpu: &Gpu, size: ImageSize) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
    gbuffer::create_texture(&gpu.device, "sum", size, SUM, usage)
}

/// Checks that so many places can be looked at.
///
/// # Errors
/// [`RenderError::Samples`], [`RenderError::CannotSmooth`].
pub(crate) fn check(gpu: &Gpu, samples: u32) -> Result<(), RenderError> {
    match samples {
        1 => Ok(()),
        2..=MOST_SAMPLES if gpu.can_add() => Ok(()),
        2..=MOST_SAMPLES => Err(RenderError::CannotSmooth),
        _ => Err(RenderError::Samples(samples)),
    }
}

/// Where each picture is sampled, from the middles of pixels: a lattice of rank 1 whose points are as far apart as can be.
///
/// # Source
/// Dammertz & Keller, *Image Synthesis by Rank-1 Lattices*, MCQMC 2006: the generator with the largest smallest distance, on the torus.
fn places(samples: u32) -> impl Iterator<Item = DVec2> {
    // Half a pixel to one side is half a pixel to the other: so many this way, so many that.
    let signed = move |at: u32, turns: bool| {
        let (at, all) = (i64::from(at % samples), i64::from(samples));
        (if 2 * at > all || 2 * at == all && turns { at - all } else { at }) as f64 / f64::from(samples)
    };
    let place = move |generator: u32, at: u32| {
        let product = at * generator;
        DVec2::new(signed(at, false), signed(product, (product / samples) % 2 == 1))
    };
    let least_squared = move |generator: &u32| {
        (1..samples).map(|at| place(*generator, at).length_squared()).fold(f64::INFINITY, f64::min)
    };
    // At most two places in a row. The first of the best.
    let spreads = |generator: &u32| (1..samples).filter(|at| (at * generator).is_multiple_of(samples)).count() < 2;
    let generator =
        (1..samples).rev().filter(spreads).max_by(|a, b| least_squared(a).total_cmp(&least_squared(b))).unwrap_or(1);
    (0..samples).rev().map(move |at| place(generator, at))
}

/// Where in the picture the view axis meets it.
pub(crate) fn middle_px(camera: &Camera) -> [f32; 2] {
    [camera.size.width, camera.size.height].map(|edge| edge as f32 * 0.5)
}

/// The same as seen from each place.
pub(crate) fn middles_px(camera: &Camera, samples: u32) -> impl Iterator<Item = [f32; 2]> {
    let middle = DVec2::new(f64::from(camera.size.width), f64::from(camera.size.height)) * 0.5;
    places(samples).map(move |place| (middle - place).as_vec2().to_array())
}

/// Brings a sum into the picture.
#[derive(Debug)]
pub(crate) struct SmoothPass {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl SmoothPass {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let module = shader::module(device, "smooth.wgsl", SOURCE, Target::None);
        let layout = cover::layout(device, "smooth", &[cover::texture_entry(0)]);
        let passes = (&module, "cover_picture", "smoothed");
        let pipeline = cover::pipeline(device, "smooth", &layout, passes, &[], PICTURE.into());
        Self { pipeline, layout }
    }

    pub(crate) fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        sum: &wgpu::Texture,
        picture: &wgpu::Texture,
    ) {
        let [sum, target] = [sum, picture].map(gbuffer::view);
        let bound = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("smooth"),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&sum) }],
        });
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("smooth"),
            color_attachments: &[Some(gbuffer::attachment(&target, true, wgpu::Color::TRANSPARENT))],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &bound, &[]);
        pass.draw(0..3, 0..1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fill_the_pixel_evenly_and_end_in_its_middle() {
        for samples in 1..=MOST_SAMPLES {
            let places: Vec<DVec2> = places(samples).collect();
            assert_eq!((places.len(), places.last()), (samples as usize, Some(&DVec2::ZERO)));
            let is_inside = |place: &DVec2| place.abs().max_element() <= 0.5;
            assert!(places.iter().all(is_inside), "{samples}: {places:?}");
            let mean = places.iter().sum::<DVec2>() / f64::from(samples);
            let off = if samples % 2 == 1 { 1e-12 } else { 0.5 / f64::from(samples) + 1e-12 };
            assert!(mean.abs().max_element() <= off, "{samples}: {mean}");
            // Each row and each column of as many has one.
            for axis in 0..2 {
                let mut rows: Vec<i64> =
                    places.iter().map(|place| (place[axis] * f64::from(samples)).round() as i64).collect();
                rows.sort_unstable();
                rows.dedup();
                let of_lattice = samples as usize;
                assert!(rows.len() == of_lattice || axis == 1 && rows.len() * 2 >= of_lattice, "{samples}: {rows:?}");
            }
            // No closer than half of what the densest packing has.
            let densest = (2.0 / 3f64.sqrt() / f64::from(samples)).sqrt();
            for (at, a) in places.iter().enumerate() {
                for b in &places[..at] {
                    let apart = ((*a - *b + 0.5).rem_euclid(DVec2::ONE) - 0.5).length();
                    assert!(apart >= densest * 0.5, "{samples}: {a} {b}");
                }
            }
        }
    }
}
