//! Memory that is kept from frame to frame, and the budget that all of it shares.
//!
//! Takes what each buffer or texture must hold in the next frame; leaves each at least as large, or says why not. What always
//! holds: their sum is within the budget, also while they are replaced; a frame like the last one creates nothing.

use crate::{Gpu, RenderError};

/// A buffer, or a texture of rows, that grows when it must, and shrinks when room is short.
#[derive(Debug)]
pub(crate) struct Pool {
    label: &'static str,
    kind: Kind,
    held: Option<Held>,
    /// Bytes that the next frame needs.
    pub(crate) wanted: u64,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Buffer(wgpu::BufferUsages),
    Rows { format: wgpu::TextureFormat, width: u64, row_bytes: u64 },
}

#[derive(Debug)]
enum Held {
    Buffer(wgpu::Buffer),
    Rows(wgpu::Texture, wgpu::TextureView),
}

/// What a binding needs at least, whatever is in it.
const LEAST_BYTES: u64 = 256;

impl Pool {
    /// A buffer, without memory as yet.
    pub(crate) fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, kind: Kind::Buffer(usage | wgpu::BufferUsages::COPY_DST), held: None, wanted: 0 }
    }

    /// A texture that passes read, with rows of `width` texels, without memory as yet.
    pub(crate) fn rows(label: &'static str, format: wgpu::TextureFormat, width: u64) -> Self {
        let texel_bytes = format.block_copy_size(None).expect("a format of plain texels");
        let kind = Kind::Rows { format, width, row_bytes: width * u64::from(texel_bytes) };
        Self { label, kind, held: None, wanted: 0 }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        match (&self.held, self.kind) {
            (Some(Held::Buffer(buffer)), _) => buffer.size(),
            (Some(Held::Rows(texture, _)), Kind::Rows { row_bytes, .. }) => row_bytes * u64::from(texture.height()),
            _ => 0,
        }
    }

    /// Bytes that hold what is wanted, as the device takes them.
    pub(crate) fn least_bytes(&self) -> u64 {
        self.rounded(self.wanted)
    }

    fn rounded(&self, bytes: u64) -> u64 {
        let unit = match self.kind {
            Kind::Buffer(_) => LEAST_BYTES,
            Kind::Rows { row_bytes, .. } => row_bytes,
        };
        bytes.next_multiple_of(unit)
    }

    /// Bytes that are enough for a while: with a quarter to spare.
    fn comfortable_bytes(&self, gpu: &Gpu) -> u64 {
        let most = match self.kind {
            Kind::Buffer(_) => gpu.most_buffer_bytes(),
            Kind::Rows { row_bytes, .. } => row_bytes * u64::from(gpu.max_picture_edge()),
        };
        match self.least_bytes() {
            least if least <= self.bytes() => self.bytes(),
            least => self.rounded(least + least / 4).min(most).max(least),
        }
    }

    /// The buffer.
    ///
    /// # Panics
    /// Where nothing was wanted of it before the last [`fit`], or where it is a texture.
    pub(crate) fn buffer(&self) -> &wgpu::Buffer {
        match &self.held {
            Some(Held::Buffer(buffer)) => buffer,
            _ => panic!("what a frame uses it has wanted: {}", self.label),
        }
    }

    /// The texture.
    ///
    /// # Panics
    /// Where nothing was wanted of it before the last [`fit`], or where it is a buffer.
    pub(crate) fn texture(&self) -> &wgpu::Texture {
        match &self.held {
            Some(Held::Rows(texture, _)) => texture,
            _ => panic!("what a frame uses it has wanted: {}", self.label),
        }
    }

    /// All of it, for a bind group.
    pub(crate) fn binding(&self) -> wgpu::BindingResource<'_> {
        match &self.held {
            Some(Held::Rows(_, view)) => wgpu::BindingResource::TextureView(view),
            _ => self.buffer().as_entire_binding(),
        }
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
        match self.held.take() {
            Some(Held::Buffer(buffer)) => buffer.destroy(),
            Some(Held::Rows(texture, _)) => texture.destroy(),
            None => {}
        }
    }

    fn create(&mut self, gpu: &Gpu, bytes: u64) {
        self.held = match self.kind {
            _ if bytes == 0 => None,
            Kind::Buffer(usage) => Some(Held::Buffer(gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size: bytes,
                usage,
                mapped_at_creation: false,
            }))),
            Kind::Rows { format, width, row_bytes } => {
                let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                    label: Some(self.label),
                    size: wgpu::Extent3d {
                        width: width as u32,
                        height: (bytes / row_bytes) as u32,
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                    view_formats: &[],
                });
                let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
                Some(Held::Rows(texture, view))
            }
        };
    }
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
    let needed = other_bytes + pools.iter().map(|pool| pool.least_bytes()).sum::<u64>();
    if needed > budget {
        return Err(RenderError::Budget { needed, budget });
    }
    let in_comfort = other_bytes + pools.iter().map(|pool| pool.comfortable_bytes(gpu)).sum::<u64>();
    let tight = in_comfort > budget;
    let sizes: Vec<u64> =
        pools.iter().map(|pool| if tight { pool.least_bytes() } else { pool.comfortable_bytes(gpu) }).collect();
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
