//! The buffers that a renderer keeps.
//!
//! Goes in: what a frame needs of each. What always holds: nothing is taken here; [`crate::memory::fit`] does that for all of them.

use crate::hybrid::keyed::HybridBuffers;
use crate::light::LightParams;
use crate::memory::Pool;
use crate::readback;
use crate::splats::keyed::KeyedBuffers;
use crate::splats::params::STRIDE;
use crate::splats::store::{Chunk, Plan};
use gigalod_geom::ImageSize;

#[derive(Debug)]
pub(crate) struct Buffers {
    pub(crate) chunks: Vec<Chunk>,
    pub(crate) keyed: KeyedBuffers,
    pub(crate) hybrid: HybridBuffers,
    pub(crate) passes: Pool,
    pub(crate) parts: Pool,
    pub(crate) light: Pool,
    pub(crate) readback: Pool,
}

impl Buffers {
    pub(crate) fn new() -> Self {
        use wgpu::BufferUsages as Usage;
        Self {
            chunks: Vec::new(),
            keyed: KeyedBuffers::new(),
            hybrid: HybridBuffers::new(),
            passes: Pool::new("passes", Usage::UNIFORM | Usage::COPY_SRC),
            parts: Pool::new("parts", Usage::UNIFORM | Usage::STORAGE),
            light: Pool::new("light", Usage::UNIFORM),
            readback: Pool::new("readback", Usage::MAP_READ),
        }
    }

    /// Asks for room for a frame, and for nothing else: all but its keys.
    pub(crate) fn want(&mut self, pass_bytes: u64, plan: &Plan) {
        self.all_mut().iter_mut().for_each(|pool| pool.wanted = 0);
        if self.chunks.len() < plan.chunks.len() {
            self.chunks.resize_with(plan.chunks.len(), Chunk::new);
        }
        for (chunk, planned) in self.chunks.iter_mut().zip(&plan.chunks) {
            chunk.want(planned.splats);
        }
        self.want_parts(pass_bytes, plan.parts.len() as u64);
    }

    /// Asks for room for all that does not grow with the number of splats or pixels.
    pub(crate) fn want_parts(&mut self, pass_bytes: u64, parts: u64) {
        self.passes.wanted = pass_bytes;
        self.parts.wanted = parts.max(1) * STRIDE;
        self.light.wanted = size_of::<LightParams>() as u64;
    }

    /// Asks for room to read a picture back.
    pub(crate) fn want_readback(&mut self, size: ImageSize) {
        self.readback.wanted = readback::buffer_bytes(size);
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.all().map(Pool::bytes).sum()
    }

    /// Bytes that hold what is wanted.
    pub(crate) fn least_bytes(&self) -> u64 {
        self.all().map(Pool::least_bytes).sum()
    }

    /// Gives everything back.
    pub(crate) fn free(&mut self) {
        self.all_mut().into_iter().for_each(Pool::free);
        self.chunks.clear();
    }

    fn all(&self) -> impl Iterator<Item = &Pool> {
        let KeyedBuffers { keys, found, sums, list, draw } = &self.keyed;
        let HybridBuffers { pages, nodes, runs, passes } = &self.hybrid;
        let chunks = self.chunks.iter().flat_map(|chunk| [&chunk.balls, &chunk.normal_colors]);
        [keys, found, sums, list, draw, &self.passes, &self.parts, &self.light, &self.readback]
            .into_iter()
            .chain([pages, nodes, runs, passes])
            .chain(chunks)
    }

    /// Each of them.
    pub(crate) fn all_mut(&mut self) -> Vec<&mut Pool> {
        let KeyedBuffers { keys, found, sums, list, draw } = &mut self.keyed;
        let HybridBuffers { pages, nodes, runs, passes } = &mut self.hybrid;
        let chunks = self.chunks.iter_mut().flat_map(|chunk| [&mut chunk.balls, &mut chunk.normal_colors]);
        [keys, found, sums, list, draw, &mut self.passes, &mut self.parts, &mut self.light, &mut self.readback]
            .into_iter()
            .chain([pages, nodes, runs, passes])
            .chain(chunks)
            .collect()
    }
}
