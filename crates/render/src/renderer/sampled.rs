//! What lies on the device, drawn once, or at several places of each pixel.
//!
//! Goes in: a frame that was sent. Comes out: the picture, on the device. What always holds: broken off, the picture is still the one
//! before; the G-buffer holds afterwards what the middles of pixels show.

use super::Renderer;
use crate::buffers::Buffers;
use crate::commands::Commands;
use crate::hybrid::keyed::HybridFrame;
use crate::light::{LightParams, LightPass};
use crate::smooth::{self, SmoothPass};
use crate::splats::depth_test::{self, DepthTestFrame};
use crate::splats::keyed::{self, Bands, KeyedFrame};
use crate::splats::pipelines::{Resolving, Round};
use crate::splats::store::Plan;
use crate::staging::Staging;
use crate::targets::Targets;
use crate::{Gpu, GpuLevel, Look, RenderError, gbuffer, hybrid};
use gigalod_geom::Camera;
use gigalod_runtime::Interrupt;
use gigalod_runtime::hybrid::RANKS;

/// A frame that lies on the device, ready to be drawn.
#[derive(Debug)]
pub(super) struct OnDevice {
    pub(super) camera: Camera,
    pub(super) look: Look,
    pub(super) rounds: &'static [Round],
    pub(super) bands: Bands,
    pub(super) plan: Plan,
    pub(super) hybrid: hybrid::plan::Plan,
    pub(super) hybrid_bands: Bands,
    pub(super) read_back: bool,
}

/// What of a frame depends on where its pixels are looked at.
pub(super) struct Aimed {
    pub(super) passes: Vec<u8>,
    /// Empty where there is nothing hybrid.
    pub(super) hybrid_passes: Vec<u8>,
    light: LightParams,
}

impl Aimed {
    pub(super) fn send(&self, gpu: &Gpu, staging: &mut Staging, buffers: &Buffers) -> Result<(), RenderError> {
        staging.write(gpu, buffers.passes.buffer(), 0, &self.passes)?;
        if !self.hybrid_passes.is_empty() {
            staging.write(gpu, buffers.hybrid.passes.buffer(), 0, &self.hybrid_passes)?;
        }
        staging.write(gpu, buffers.light.buffer(), 0, bytemuck::bytes_of(&self.light))?;
        staging.finish(gpu)
    }
}

/// A picture of several that add up.
#[derive(Clone, Copy, Debug)]
struct Adding {
    is_first: bool,
    is_last: bool,
}

impl Renderer {
    /// Draws what lies on the device, as often as its look says. False where that was broken off.
    pub(super) fn submit_last(&mut self, interrupt: Option<&Interrupt>) -> Result<bool, RenderError> {
        let last = self.last.take().expect("just sent, or asked for");
        let drawn = self.draw_sampled(&last, interrupt);
        self.last = Some(last);
        drawn
    }

    fn draw_sampled(&mut self, last: &OnDevice, interrupt: Option<&Interrupt>) -> Result<bool, RenderError> {
        let samples = last.look.samples;
        if samples == 1 {
            return self.draw_once(last, None, interrupt);
        }
        for (at, middle_px) in smooth::middles_px(&last.camera, samples).enumerate() {
            if interrupt.is_some_and(Interrupt::is_set) {
                return Ok(false);
            }
            let aimed = self.aimed_at(last, middle_px, at as u32);
            aimed.send(&self.gpu, &mut self.staging, &self.buffers)?;
            let adding = Adding { is_first: at == 0, is_last: at as u32 + 1 == samples };
            if !self.draw_once(last, Some(adding), interrupt)? {
                return Ok(false);
            }
        }
        self.uploaded_bytes += self.staging.take_written_bytes();
        Ok(true)
    }

    /// What says where a pixel is looked at, and for the which time.
    pub(super) fn aimed_at(&self, sent: &OnDevice, middle_px: [f32; 2], sample: u32) -> Aimed {
        let OnDevice { camera, look, bands, plan, hybrid, hybrid_bands, read_back, .. } = sent;
        let aim = (camera, middle_px);
        let passes = if self.gpu.level() > GpuLevel::WebGl {
            keyed::pass_bytes(&self.gpu, aim, look.kernel, bands, plan, self.compute_extent_px, *read_back)
        } else {
            depth_test::pass_bytes(camera, middle_px)
        };
        let hybrid_passes = match hybrid.is_empty() {
            true => Vec::new(),
            false => {
                let aim = (camera, middle_px, sample * u32::from(RANKS) / look.samples);
                hybrid::keyed::pass_bytes(&self.gpu, aim, hybrid_bands, hybrid, self.hybrid_extent_px)
            }
        };
        let light = LightPass::params(camera, &look.lighting, middle_px, 1.0 / look.samples as f32);
        Aimed { passes, hybrid_passes, light }
    }

    /// Draws what lies on the device into the picture, or adds it to the sum. False where that was broken off.
    fn draw_once(
        &mut self,
        last: &OnDevice,
        adding: Option<Adding>,
        interrupt: Option<&Interrupt>,
    ) -> Result<bool, RenderError> {
        let Self { gpu, buffers: whole, targets, .. } = self;
        let OnDevice { look, rounds, bands, plan, hybrid, hybrid_bands, read_back, .. } = last;
        let Targets { gbuffer, picture, sum } = targets.as_ref().expect("made with the room");
        let mut commands = Commands::new(gpu, interrupt);
        let chunks = &whole.chunks[..plan.chunks.len()];
        let (kernel, passes, parts) = (look.kernel, &whole.passes, &whole.parts);
        let resolving = Resolving { is_shared: plan.is_shared(), footprint: *read_back };
        if chunks.is_empty() {
            drop(gbuffer.begin(commands.encoder(), true));
        } else if gpu.level() > GpuLevel::WebGl {
            self.keyed_pass.prepare(gpu, kernel, resolving);
            let (bands, buffers) = (*bands, &whole.keyed);
            let keyed = KeyedFrame { kernel, rounds, resolving, bands, plan, chunks, passes, parts, buffers };
            if !self.keyed_pass.encode(gpu, &mut commands, gbuffer, &keyed)? {
                return Ok(false);
            }
        } else {
            self.depth_test_pass.prepare(gpu, kernel);
            let splats = DepthTestFrame { kernel, plan, chunks, passes, parts };
            self.depth_test_pass.encode(gpu, commands.encoder(), gbuffer, &splats);
        }
        if !hybrid.is_empty() {
            self.hybrid_pass.prepare(gpu, hybrid);
            let Buffers { keyed: shared, hybrid: buffers, .. } = &*whole;
            let frame = HybridFrame { bands: *hybrid_bands, plan: hybrid, buffers, shared };
            if !self.hybrid_pass.encode(gpu, &mut commands, gbuffer, &frame)? {
                return Ok(false);
            }
        }
        let lit = self.light_pass.bind(&gpu.device, gbuffer, &whole.light);
        let sum = sum.as_ref().filter(|_| adding.is_some());
        {
            let target = gbuffer::view(sum.unwrap_or(picture));
            let clears = adding.is_none_or(|adding| adding.is_first);
            let mut pass = commands.encoder().begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("light"),
                color_attachments: &[Some(gbuffer::attachment(&target, clears, wgpu::Color::TRANSPARENT))],
                ..Default::default()
            });
            self.light_pass.draw(&mut pass, &lit, sum.is_some());
        }
        if let Some(sum) = sum.filter(|_| adding.is_some_and(|adding| adding.is_last)) {
            let smooth_pass = self.smooth_pass.get_or_insert_with(|| SmoothPass::new(&gpu.device));
            smooth_pass.encode(&gpu.device, commands.encoder(), sum, picture);
        }
        commands.submit().map(|()| true)
    }
}
