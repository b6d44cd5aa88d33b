//! Buffers that are kept from frame to frame, and the budget that all of them share.
//!
//! Takes what each buffer must hold in the next frame; leaves every buffer at least as large, or says why not. What always
//! holds: the sum of all buffers is within the budget, also while they are replaced; a frame like the last one creates nothing.

use crate::{Gpu, RenderError};

/// A buffer that grows when it must, and shrinks when room is short.
#[derive(Debug)]
pub(crate) struct Pool {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
    /// Bytes that the next frame needs.
    pub(crate) wanted: u64,
}

/// What a binding needs at least, whatever is in it.
const LEAST_BYTES: u64 = 256;

impl Pool {
    /// Without a buffer as yet.
    pub(crate) fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage: usage | wgpu::BufferUsages::COPY_DST, buffer: None, wanted: 0 }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.buffer.as_ref().map_or(0, wgpu::Buffer::size)
    }

    /// The buffer.
    ///
    /// # Panics
    /// Where nothing was wanted of it before the last [`fit`].
    pub(crate) fn buffer(&self) -> &wgpu::Buffer {
        self.buffer.as_ref().expect("what a frame uses it has wanted")
    }

    /// All of it, for a bind group.
    pub(crate) fn binding(&self) -> wgpu::BindingResource<'_> {
        self.buffer().as_entire_binding()
    }

    /// All of it, in a bind group.
    pub(crate) fn entry(&self, binding: u32) -> wgpu::BindGroupEntry<'_> {
        wgpu::BindGroupEntry { binding, resource: self.binding() }
    }

    /// A `T` in it, at a dynamic offset.
    pub(crate) fn entry_of<T>(&self, binding: u32) -> wgpu::BindGroupEntry<'_> {
        let size = std::num::NonZeroU64::new(size_of::<T>() as u64);
        let part = wgpu::BufferBinding { buffer: self.buffer(), offset: 0, size };
        wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::Buffer(part) }
    }

    /// Frees it.
    pub(crate) fn free(&mut self) {
        if let Some(buffer) = self.buffer.take() {
            buffer.destroy();
        }
    }

    fn create(&mut self, gpu: &Gpu, size: u64) {
        self.buffer = Some(gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.label),
            size,
            usage: self.usage,
            mapped_at_creation: false,
        }));
    }
}

/// A buffer's size as the device takes it.
pub(crate) fn rounded(bytes: u64) -> u64 {
    if bytes == 0 { 0 } else { bytes.next_multiple_of(LEAST_BYTES) }
}

/// Makes all pools as large as they are wanted; `other_bytes` of the budget are taken by other things. Grows with a quarter to
/// spare while there is room for that; frees what is not wanted where there is not.
///
/// # Errors
/// [`RenderError::Budget`], with nothing changed; [`RenderError::OutOfMemory`] and what else the device says.
pub(crate) fn fit(
    gpu: &Gpu,
    pools: &mut [&mut Pool],
    other_bytes: u64,
    budget: Option<u64>,
) -> Result<(), RenderError> {
    let budget = budget.unwrap_or(u64::MAX);
    let needed = other_bytes + pools.iter().map(|pool| rounded(pool.wanted)).sum::<u64>();
    if needed > budget {
        return Err(RenderError::Budget { needed, budget });
    }
    let most = gpu.most_buffer_bytes();
    let comfortable = |pool: &Pool| match rounded(pool.wanted) {
        wanted if wanted <= pool.bytes() => pool.bytes(),
        wanted => rounded(wanted + wanted / 4).min(most).max(wanted),
    };
    let in_comfort = other_bytes + pools.iter().map(|pool| comfortable(pool)).sum::<u64>();
    let tight = in_comfort > budget;
    let sizes: Vec<u64> =
        pools.iter().map(|pool| if tight { rounded(pool.wanted) } else { comfortable(pool) }).collect();
    // First all that goes, then all that comes.
    let changes = || sizes.iter().copied().enumerate();
    for (at, size) in changes() {
        if pools[at].bytes() != size {
            pools[at].free();
        }
    }
    for (at, size) in changes() {
        if pools[at].bytes() != size {
            pools[at].create(gpu, size);
            gpu.check()?;
        }
    }
    Ok(())
}
