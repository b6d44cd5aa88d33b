//! One picture: everything a scene draws, lit.
//!
//! Takes frames; leaves pictures on the device, or brings them to the host. What always holds: all that is kept on the device
//! is within the budget; a frame like the last one creates no buffer and no texture; after any error the renderer can be used
//! again, at the latest after [`Renderer::recover`].

mod capacity;
mod sampled;

use crate::buffers::Buffers;
use crate::frame::{Frame, Lists};
use crate::hybrid;
use crate::hybrid::arena::{self, Arena};
use crate::hybrid::keyed::HybridPass;
use crate::light::LightPass;
use crate::smooth::{self, SmoothPass};
use crate::splats::Kernel;
use crate::splats::depth_test::DepthTestPass;
use crate::splats::keyed::{self, KeyedPass};
use crate::splats::store::{self, Plan};
use crate::staging::Staging;
use crate::targets::Targets;
use crate::{Gpu, GpuLevel, Picture, RenderError, memory};
use gigalod_runtime::Interrupt;
use sampled::OnDevice;

/// Draws frames; keeps pipelines, targets and buffers between them.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    keyed_pass: KeyedPass,
    depth_test_pass: DepthTestPass,
    hybrid_pass: HybridPass,
    arena: Arena,
    light_pass: LightPass,
    /// Compiled when it is first needed.
    smooth_pass: Option<SmoothPass>,
    budget: Option<u64>,
    compute_extent_px: u32,
    hybrid_extent_px: u32,
    targets: Option<Targets>,
    staging: Staging,
    uploaded_bytes: u64,
    buffers: Buffers,
    last: Option<OnDevice>,
}

impl Renderer {
    /// Compiles what every frame needs. Passes of a kernel are compiled when it is first drawn.
    ///
    /// # Errors
    /// [`RenderError::Device`], [`RenderError::OutOfMemory`] and [`RenderError::DeviceLost`].
    pub fn new(gpu: Gpu) -> Result<Self, RenderError> {
        let light_pass = LightPass::new(&gpu);
        let staging = Staging::new(&gpu);
        let compute_extent_px = keyed::compute_extent_px(&gpu);
        let hybrid_extent_px = hybrid::keyed::compute_extent_px(&gpu);
        gpu.check()?;
        Ok(Self {
            gpu,
            keyed_pass: KeyedPass::default(),
            depth_test_pass: DepthTestPass::default(),
            hybrid_pass: HybridPass::default(),
            arena: Arena::default(),
            light_pass,
            smooth_pass: None,
            budget: None,
            compute_extent_px,
            hybrid_extent_px,
            targets: None,
            staging,
            uploaded_bytes: 0,
            buffers: Buffers::new(),
            last: None,
        })
    }

    /// The device it draws with.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Bytes that are taken on the device: targets, and all buffers that are kept.
    pub fn gpu_bytes(&self) -> u64 {
        let targets = self.targets.as_ref().map_or(0, Targets::own_bytes);
        Staging::BYTES + targets + self.buffers.bytes()
    }

    /// Bytes that the last frame sent to the device.
    pub fn uploaded_bytes(&self) -> u64 {
        self.uploaded_bytes
    }

    /// Most bytes to take on the device from now on; `None` for no limit. What is kept beyond that is freed by the next frame.
    pub fn set_budget(&mut self, bytes: Option<u64>) {
        self.budget = bytes;
    }

    /// Splats of at most this many pixels across and down are drawn by the compute pass, larger ones through the pipeline, and nodes'
    /// triangles by one invocation or by many: 0 for none, 60 is the most. That decides how long a frame takes, never what it shows.
    pub fn set_compute_extent(&mut self, extent_px: u32) {
        self.compute_extent_px = extent_px.min(keyed::MOST_COMPUTE_EXTENT_PX);
        self.hybrid_extent_px = self.compute_extent_px;
    }

    /// Opens the device anew and forgets the old one: what to do about [`RenderError::DeviceLost`]. The next frame fills the new
    /// one. Budget and settings stay.
    ///
    /// # Errors
    /// As for [`Gpu::open`] and [`Renderer::new`]; then it is still the old one.
    pub fn recover(&mut self) -> Result<(), RenderError> {
        let fresh = Gpu::open_at(self.gpu.wanted_level())?;
        self.move_to(fresh)
    }

    /// Goes on with another device, and forgets the old one, as [`Renderer::recover`] does.
    ///
    /// # Errors
    /// As for [`Renderer::new`]; then it still has the old one.
    pub fn move_to(&mut self, gpu: Gpu) -> Result<(), RenderError> {
        let fresh = Self::new(gpu)?;
        let (compute_extent_px, hybrid_extent_px) = (self.compute_extent_px, self.hybrid_extent_px);
        *self = Self { budget: self.budget, compute_extent_px, hybrid_extent_px, ..fresh };
        Ok(())
    }

    /// Draws a frame and waits until the device is done. The picture stays there.
    ///
    /// # Errors
    /// [`RenderError::Size`], [`RenderError::Samples`], [`RenderError::ForeignDrawSource`], [`RenderError::CannotBlend`],
    /// [`RenderError::CannotSmooth`], [`RenderError::NeedsStorage`], [`RenderError::TooMany`] and [`RenderError::Budget`] say what is
    /// wrong with the frame; [`RenderError::OutOfMemory`]: draw coarser; [`RenderError::DeviceLost`]: [`Renderer::recover`].
    pub fn draw(&mut self, frame: &Frame<'_>) -> Result<(), RenderError> {
        self.submit(frame, false, None)?;
        self.survive(self.gpu.wait())
    }

    /// [`Renderer::draw`], broken off some milliseconds after `interrupt` is set: then false, and the picture is still the one before.
    ///
    /// # Errors
    /// As for [`Renderer::draw`].
    pub fn draw_interruptible(&mut self, frame: &Frame<'_>, interrupt: &Interrupt) -> Result<bool, RenderError> {
        let drawn = self.submit(frame, false, Some(interrupt))?;
        self.survive(self.gpu.wait()).map(|()| drawn)
    }

    /// Draws the last frame once more from what lies on the device, without sending anything: for a window that was covered, or
    /// a bench. False where there is no last frame, as after an error.
    ///
    /// # Errors
    /// As for [`Renderer::draw`].
    pub fn redraw(&mut self) -> Result<bool, RenderError> {
        self.gpu.check()?;
        if self.last.is_none() {
            return Ok(false);
        }
        let drawn = self.submit_last(None).and_then(|_| self.gpu.wait());
        self.survive(drawn).map(|()| true)
    }

    /// The picture that was drawn last, where it lies on the device, for a window to show; `None` before the first. The next one
    /// overwrites it.
    #[cfg(feature = "window")]
    pub fn shown(&self) -> Option<crate::window::Shown> {
        self.targets.as_ref().map(|targets| crate::window::Shown::new(&targets.picture, targets.gbuffer.size))
    }

    /// [`Renderer::draw`], and brings the picture to the host.
    ///
    /// # Errors
    /// As for [`Renderer::draw`].
    pub fn picture(&mut self, frame: &Frame<'_>) -> Result<Picture, RenderError> {
        self.submit(frame, true, None)?;
        let read = self.read();
        self.survive(read)
    }

    /// What was submitted with readback.
    pub(crate) fn read(&self) -> Result<Picture, RenderError> {
        let targets = self.targets.as_ref().expect("a frame was submitted");
        targets.read(&self.gpu, &self.buffers.readback)
    }

    /// Checks a frame, makes room, uploads, and hands it to the device. False where that was broken off.
    pub(crate) fn submit(
        &mut self,
        frame: &Frame<'_>,
        read_back: bool,
        interrupt: Option<&Interrupt>,
    ) -> Result<bool, RenderError> {
        self.gpu.check()?;
        let lists = Lists::of(&self.gpu, frame)?;
        self.last = None;
        let sent = self.send(frame, &lists, read_back, interrupt);
        let drawn = sent.and_then(|sent| if sent { self.submit_last(interrupt) } else { Ok(false) });
        self.survive(drawn)
    }

    /// Makes room and uploads. False where that was broken off.
    fn send(
        &mut self,
        frame: &Frame<'_>,
        lists: &Lists<'_>,
        read_back: bool,
        interrupt: Option<&Interrupt>,
    ) -> Result<bool, RenderError> {
        let (camera, kernel) = (&frame.camera, frame.look.kernel);
        let most = store::most_in_chunk(&self.gpu);
        let area_px = lists.splat_area_px(camera);
        let sent = OnDevice {
            camera: *camera,
            look: frame.look,
            rounds: keyed::rounds(&self.gpu, camera.size, kernel, area_px),
            bands: self.bands(camera.size, kernel),
            plan: Plan::new(camera, &lists.splats, most, keyed::most_in_slice(lists.splat_count(), area_px)),
            hybrid: hybrid::plan::Plan::new(camera, &lists.hybrid, hybrid::plan::most_runs(&self.gpu))?,
            hybrid_bands: self.bands(camera.size, Kernel::Round),
            read_back,
        };
        let first = self.aimed_at(&sent, smooth::middle_px(camera), 0);
        let pages = arena::needed_bytes(lists.hybrid.iter().map(|(_, list)| *list));
        let most_page_bytes = arena::most_bytes(&self.gpu);
        if pages > most_page_bytes {
            return Err(RenderError::Budget { needed: pages, budget: most_page_bytes });
        }
        self.buffers.want(first.passes.len() as u64, &sent.plan);
        if self.gpu.level() > GpuLevel::WebGl {
            self.buffers.keyed.want(&sent.bands, kernel, sent.plan.largest_chunk());
        }
        if !sent.hybrid.is_empty() {
            let Buffers { keyed, hybrid: buffers, .. } = &mut self.buffers;
            buffers.want(keyed, &self.gpu, &sent.hybrid_bands, &sent.hybrid, first.hybrid_passes.len() as u64)?;
        }
        self.make_room(&sent, pages)?;
        let Self { gpu, staging, buffers, arena, uploaded_bytes, .. } = self;
        if !store::upload(gpu, staging, &buffers.chunks, most, &lists.splats, interrupt)?
            || !arena.place(gpu, staging, &buffers.hybrid.pages, &lists.hybrid, interrupt)?
        {
            return Ok(false);
        }
        staging.write(gpu, buffers.parts.buffer(), 0, bytemuck::cast_slice(&sent.plan.parts))?;
        if !sent.hybrid.is_empty() {
            let nodes = hybrid::plan::Plan::node_params(camera, &lists.hybrid, arena);
            buffers.hybrid.send(gpu, staging, &nodes, &sent.hybrid.runs)?;
        }
        first.send(gpu, staging, buffers)?;
        *uploaded_bytes = staging.take_written_bytes();
        self.last = Some(sent);
        Ok(true)
    }

    /// Targets of this size, and buffers for a frame, of which all is wanted but the pages of nodes; within the budget, or with an
    /// error and nothing changed.
    fn make_room(&mut self, sent: &OnDevice, page_bytes: u64) -> Result<(), RenderError> {
        let (size, samples, has_lines) = (sent.camera.size, sent.look.samples, sent.hybrid.has_lines());
        if sent.read_back {
            self.buffers.want_readback(size);
        }
        let other = Staging::BYTES + Targets::bytes(size, samples, has_lines);
        let stale = self.targets.take_if(|targets| targets.gbuffer.size != size);
        if let Some(targets) = stale {
            targets.free();
        }
        // With room for what is drawn later, then without.
        let mut fitted = Ok(());
        for wanted in arena::wishes(&self.gpu, page_bytes, self.buffers.hybrid.pages.bytes()) {
            self.buffers.hybrid.pages.wanted = wanted;
            fitted = memory::fit(&self.gpu, &mut self.buffers.all_mut(), other, self.budget);
            if !matches!(fitted, Err(RenderError::Budget { .. })) {
                break;
            }
        }
        fitted?;
        self.targets.get_or_insert_with(|| Targets::new(&self.gpu, size)).want(&self.gpu, samples, has_lines);
        self.gpu.check()
    }

    /// After [`RenderError::OutOfMemory`] frees all that was kept, so that a coarser frame finds room.
    fn survive<T>(&mut self, result: Result<T, RenderError>) -> Result<T, RenderError> {
        if result.is_err() {
            self.last = None;
        }
        if let Err(RenderError::OutOfMemory(_)) = &result {
            self.buffers.free();
            if let Some(targets) = self.targets.take() {
                targets.free();
            }
            // What came after the first error is its consequence; a lost device says so again.
            let _ = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
            let _ = self.gpu.check();
        }
        result
    }
}
