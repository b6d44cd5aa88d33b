//! From the host to the device, through a few buffers that are written again and again: writing to memory that the system has
//! just given is several times slower.
//!
//! Takes bytes and where they go; what always holds: they are there for all that is submitted after [`Staging::finish`].

use crate::{Gpu, RenderError};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Bytes of one buffer; a multiple of what copies are aligned to.
const SLOT_BYTES: u64 = 2 << 20;
const SLOTS: usize = 3;

/// Upload buffers.
#[derive(Debug)]
pub(crate) struct Staging {
    slots: Vec<Slot>,
    current: usize,
    used: u64,
    copies: Vec<Copy>,
    written_bytes: u64,
}

#[derive(Debug)]
struct Slot {
    buffer: wgpu::Buffer,
    /// Set while the device may still read it.
    mapping: Option<(Receiver<Result<(), wgpu::BufferAsyncError>>, wgpu::SubmissionIndex)>,
}

/// From the current slot, from `from` on.
#[derive(Debug)]
struct Copy {
    from: u64,
    to: Goal,
}

#[derive(Debug)]
enum Goal {
    Buffer { buffer: wgpu::Buffer, offset: u64, bytes: u64 },
    Texels { texture: wgpu::Texture, origin: wgpu::Origin3d, size: wgpu::Extent3d, row_bytes: u32 },
}

/// Where writes begin in a slot: texels have up to 16 bytes, and ranges of mapped memory begin at multiples of 8.
const ALIGNMENT: u64 = 16;

impl Staging {
    /// Bytes on the device.
    pub(crate) const BYTES: u64 = SLOT_BYTES * SLOTS as u64;

    pub(crate) fn new(gpu: &Gpu) -> Self {
        let slot = |_| Slot {
            buffer: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("staging"),
                size: SLOT_BYTES,
                usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: true,
            }),
            mapping: None,
        };
        Self { slots: (0..SLOTS).map(slot).collect(), current: 0, used: 0, copies: Vec::new(), written_bytes: 0 }
    }

    /// Bytes written since the last call.
    pub(crate) fn take_written_bytes(&mut self) -> u64 {
        std::mem::take(&mut self.written_bytes)
    }

    /// Copies `bytes` to a buffer, from `to_offset` on; both are multiples of 4.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn write(
        &mut self,
        gpu: &Gpu,
        to: &wgpu::Buffer,
        mut to_offset: u64,
        mut bytes: &[u8],
    ) -> Result<(), RenderError> {
        while !bytes.is_empty() {
            let count = self.room(gpu, 1)?.min(bytes.len() as u64);
            let (now, later) = bytes.split_at(count as usize);
            let to = Goal::Buffer { buffer: to.clone(), offset: to_offset, bytes: count };
            self.put(gpu, now, to)?;
            (to_offset, bytes) = (to_offset + count, later);
        }
        Ok(())
    }

    /// Copies `bytes` to a texture of rows, from texel number `first` on. Rows are multiples of what copies are aligned to.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn write_texels(
        &mut self,
        gpu: &Gpu,
        to: &wgpu::Texture,
        mut first: u64,
        mut bytes: &[u8],
    ) -> Result<(), RenderError> {
        let texel = u64::from(to.format().block_copy_size(None).expect("a format of plain texels"));
        let width = u64::from(to.width());
        while !bytes.is_empty() {
            let room = self.room(gpu, texel)? / texel;
            let (texels, column) = (bytes.len() as u64 / texel, first % width);
            // Whole rows at once, or what there is of one.
            let rows = if column == 0 { room.min(texels) / width } else { 0 };
            let count = if rows > 0 { rows * width } else { room.min(texels).min(width - column) };
            let (now, later) = bytes.split_at((count * texel) as usize);
            let to = Goal::Texels {
                texture: to.clone(),
                origin: wgpu::Origin3d { x: column as u32, y: (first / width) as u32, z: 0 },
                size: wgpu::Extent3d {
                    width: count.min(width) as u32,
                    height: rows.max(1) as u32,
                    depth_or_array_layers: 1,
                },
                row_bytes: (width * texel) as u32,
            };
            self.put(gpu, now, to)?;
            (first, bytes) = (first + count, later);
        }
        Ok(())
    }

    /// Bytes that can be put into the current slot, at least `least`.
    fn room(&mut self, gpu: &Gpu, least: u64) -> Result<u64, RenderError> {
        if SLOT_BYTES - self.used < least {
            self.finish(gpu)?;
        }
        Ok(SLOT_BYTES - self.used)
    }

    fn put(&mut self, gpu: &Gpu, bytes: &[u8], to: Goal) -> Result<(), RenderError> {
        self.written_bytes += bytes.len() as u64;
        let (slot, end) = (&mut self.slots[self.current], self.used + bytes.len() as u64);
        slot.wait(gpu)?;
        let mapped = slot.buffer.get_mapped_range_mut(self.used..end);
        let mut view = mapped.map_err(|error| fault(gpu, &error))?;
        view.slice(..).copy_from_slice(bytes);
        drop(view);
        self.copies.push(Copy { from: self.used, to });
        self.used = end.next_multiple_of(ALIGNMENT);
        Ok(())
    }

    /// Submits what was written.
    ///
    /// # Errors
    /// What the device says.
    pub(crate) fn finish(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        if self.copies.is_empty() {
            return Ok(());
        }
        let slot = &mut self.slots[self.current];
        slot.buffer.unmap();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for copy in self.copies.drain(..) {
            match copy.to {
                Goal::Buffer { buffer, offset, bytes } => {
                    encoder.copy_buffer_to_buffer(&slot.buffer, copy.from, &buffer, offset, bytes);
                }
                Goal::Texels { texture, origin, size, row_bytes } => {
                    let rows = (size.height > 1).then_some(size.height);
                    let layout = wgpu::TexelCopyBufferLayout {
                        offset: copy.from,
                        bytes_per_row: rows.map(|_| row_bytes),
                        rows_per_image: rows,
                    };
                    encoder.copy_buffer_to_texture(
                        wgpu::TexelCopyBufferInfo { buffer: &slot.buffer, layout },
                        wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
                        size,
                    );
                }
            }
        }
        let submitted = gpu.submit([encoder.finish()]);
        let (sender, receiver) = channel();
        slot.buffer.map_async(wgpu::MapMode::Write, .., move |result| {
            // Nobody listens where the renderer is gone.
            let _ = sender.send(result);
        });
        slot.mapping = Some((receiver, submitted));
        self.current = (self.current + 1) % SLOTS;
        self.used = 0;
        gpu.check()
    }
}

impl Slot {
    /// Until it can be written to.
    fn wait(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        let Some((receiver, submitted)) = self.mapping.take() else { return Ok(()) };
        let mapped = match receiver.try_recv() {
            Ok(mapped) => mapped,
            Err(TryRecvError::Disconnected) => return Err(fault(gpu, &"an upload buffer went away")),
            Err(TryRecvError::Empty) => {
                let until = wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None };
                gpu.device.poll(until).map_err(|error| fault(gpu, &error))?;
                receiver.recv().map_err(|error| fault(gpu, &error))?
            }
        };
        mapped.map_err(|error| fault(gpu, &error))
    }
}

/// What the device says, or else `error`.
pub(crate) fn fault(gpu: &Gpu, error: &dyn std::fmt::Display) -> RenderError {
    gpu.check().err().unwrap_or_else(|| RenderError::Device(error.to_string()))
}
