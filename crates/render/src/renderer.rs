//! One picture: everything a scene draws, lit.
//!
//! Takes frames; leaves pictures on the device, or brings them to the host. What always holds: all that is kept on the device
//! is within the budget; a frame like the last one creates no buffer and no texture; after any error the renderer can be used
//! again, at the latest after [`Renderer::recover`].

mod capacity;

use crate::buffers::Buffers;
use crate::commands::Commands;
use crate::frame::{Frame, Lists};
use crate::hybrid;
use crate::hybrid::arena::{self, Arena};
use crate::hybrid::keyed::{HybridFrame, HybridPass};
use crate::light::LightPass;
use crate::splats::Kernel;
use crate::splats::depth_test::{self, DepthTestFrame, DepthTestPass};
use crate::splats::keyed::{self, Bands, KeyedFrame, KeyedPass};
use crate::splats::pipelines::{Resolving, Round};
use crate::splats::store::{self, Plan};
use crate::staging::Staging;
use crate::targets::Targets;
use crate::{Gpu, GpuLevel, Picture, RenderError, gbuffer, memory};
use gigalod_geom::ImageSize;
use gigalod_runtime::Interrupt;

/// Draws frames; keeps pipelines, targets and buffers between them.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    keyed_pass: KeyedPass,
    depth_test_pass: DepthTestPass,
    hybrid_pass: HybridPass,
    arena: Arena,
    light_pass: LightPass,
    budget: Option<u64>,
    compute_extent_px: u32,
    hybrid_extent_px: u32,
    targets: Option<Targets>,
    staging: Staging,
    uploaded_bytes: u64,
    buffers: Buffers,
    last: Option<OnDevice>,
}

/// A frame that lies on the device, ready to be drawn.
#[derive(Debug)]
struct OnDevice {
    kernel: Kernel,
    rounds: &'static [Round],
    resolving: Resolving,
    bands: Bands,
    plan: Plan,
    hybrid: hybrid::plan::Plan,
    hybrid_bands: Bands,
}

impl Renderer {
    /// Compiles what every frame needs. Passes of a kernel are compiled when it is first drawn.
    ///
    /// # Errors
    /// [`RenderError::Device`], [`RenderError::OutOfMemory`] and [`RenderError::DeviceLost`].
    pub fn new(gpu: Gpu) -> Result<Self, RenderError> {
        let light_pass = LightPass::new(&gpu.device);
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
        let targets = self.targets.as_ref().map_or(0, |targets| Targets::bytes(targets.gbuffer.size));
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
    /// [`RenderError::Size`], [`RenderError::ForeignDrawSource`], [`RenderError::CannotBlend`], [`RenderError::NeedsStorage`],
    /// [`RenderError::TooMany`] and [`RenderError::Budget`] say what is wrong with the frame; [`RenderError::OutOfMemory`]: draw coarser;
    /// [`RenderError::DeviceLost`]: [`Renderer::recover`].
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
        let plan = Plan::new(camera, &lists.splats, most, keyed::most_in_slice(lists.splat_count(), area_px));
        let bands = self.bands(camera.size, kernel);
        let keyed = self.gpu.level() > GpuLevel::WebGl;
        let passes = if keyed {
            keyed::pass_bytes(&self.gpu, camera, kernel, &bands, &plan, self.compute_extent_px, read_back)
        } else {
            depth_test::pass_bytes(camera)
        };
        self.buffers.want(passes.len() as u64, &plan);
        if keyed {
            self.buffers.keyed.want(&bands, kernel, plan.largest_chunk());
        }
        let hybrid_bands = self.bands(camera.size, Kernel::Round);
        let hybrid = hybrid::plan::Plan::new(camera, &lists.hybrid, hybrid::plan::most_runs(&self.gpu))?;
        let hybrid_passes = hybrid::keyed::pass_bytes(&self.gpu, camera, &hybrid_bands, &hybrid, self.hybrid_extent_px);
        let pages = arena::needed_bytes(lists.hybrid.iter().map(|(_, list)| *list));
        let most_page_bytes = arena::most_bytes(&self.gpu);
        if pages > most_page_bytes {
            return Err(RenderError::Budget { needed: pages, budget: most_page_bytes });
        }
        if !hybrid.is_empty() {
            let Buffers { keyed, hybrid: buffers, .. } = &mut self.buffers;
            buffers.want(keyed, &self.gpu, &hybrid_bands, &hybrid, hybrid_passes.len() as u64)?;
        }
        self.make_room(camera.size, pages, read_back)?;
        let Self { gpu, staging, buffers, arena, uploaded_bytes, .. } = self;
        if !store::upload(gpu, staging, &buffers.chunks, most, &lists.splats, interrupt)?
            || !arena.place(gpu, staging, &buffers.hybrid.pages, &lists.hybrid, interrupt)?
        {
            return Ok(false);
        }
        staging.write(gpu, buffers.passes.buffer(), 0, &passes)?;
        staging.write(gpu, buffers.parts.buffer(), 0, bytemuck::cast_slice(&plan.parts))?;
        if !hybrid.is_empty() {
            let nodes = hybrid::plan::Plan::node_params(camera, &lists.hybrid, arena);
            buffers.hybrid.send(gpu, staging, &nodes, &hybrid.runs, &hybrid_passes)?;
        }
        let light = LightPass::params(camera, &frame.look.lighting);
        staging.write(gpu, buffers.light.buffer(), 0, bytemuck::bytes_of(&light))?;
        staging.finish(gpu)?;
        *uploaded_bytes = staging.take_written_bytes();
        let rounds = keyed::rounds(gpu, camera.size, kernel, area_px);
        let resolving = Resolving { is_shared: plan.is_shared(), footprint: read_back };
        self.last = Some(OnDevice { kernel, rounds, resolving, bands, plan, hybrid, hybrid_bands });
        Ok(true)
    }

    /// Draws what lies on the device. False where that was broken off.
    fn submit_last(&mut self, interrupt: Option<&Interrupt>) -> Result<bool, RenderError> {
        let Self { gpu, buffers: whole, targets, .. } = self;
        let OnDevice { kernel, rounds, resolving, bands, plan, hybrid, hybrid_bands } =
            self.last.as_ref().expect("just sent, or asked for");
        let Targets { gbuffer, picture } = targets.as_ref().expect("made with the room");
        let mut commands = Commands::new(gpu, interrupt);
        let chunks = &whole.chunks[..plan.chunks.len()];
        let (kernel, resolving, passes, parts) = (*kernel, *resolving, &whole.passes, &whole.parts);
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
        {
            let target = gbuffer::view(picture);
            let mut pass = commands.encoder().begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("light"),
                color_attachments: &[Some(gbuffer::attachment(&target, true, wgpu::Color::TRANSPARENT))],
                ..Default::default()
            });
            self.light_pass.draw(&mut pass, &lit);
        }
        commands.submit().map(|()| true)
    }

    /// Targets of this size, and buffers for a frame, of which all is wanted but the pages of nodes; within the budget, or with an
    /// error and nothing changed.
    fn make_room(&mut self, size: ImageSize, page_bytes: u64, read_back: bool) -> Result<(), RenderError> {
        if read_back {
            self.buffers.want_readback(size);
        }
        let other = Staging::BYTES + Targets::bytes(size);
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
        if self.targets.is_none() {
            self.targets = Some(Targets::new(&self.gpu, size));
            self.gpu.check()?;
        }
        Ok(())
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
