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

/// From the current slot.
#[derive(Debug)]
struct Copy {
    from: u64,
    to: wgpu::Buffer,
    to_offset: u64,
    bytes: u64,
}

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

    /// Copies `bytes` to `to`, from `to_offset` on; both are multiples of 4.
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
        self.written_bytes += bytes.len() as u64;
        while !bytes.is_empty() {
            if self.used == SLOT_BYTES {
                self.finish(gpu)?;
            }
            self.slots[self.current].wait(gpu)?;
            let count = (SLOT_BYTES - self.used).min(bytes.len() as u64);
            let (now, later) = bytes.split_at(count as usize);
            let mapped = self.slots[self.current].buffer.get_mapped_range_mut(self.used..self.used + count);
            let mut view = mapped.map_err(|error| fault(gpu, &error))?;
            view.slice(..).copy_from_slice(now);
            drop(view);
            self.copies.push(Copy { from: self.used, to: to.clone(), to_offset, bytes: count });
            // Ranges of mapped memory begin at multiples of 8.
            self.used = (self.used + count).next_multiple_of(wgpu::MAP_ALIGNMENT);
            (to_offset, bytes) = (to_offset + count, later);
        }
        Ok(())
    }

    /// Bytes written since the last call.
    pub(crate) fn take_written_bytes(&mut self) -> u64 {
        std::mem::take(&mut self.written_bytes)
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
            encoder.copy_buffer_to_buffer(&slot.buffer, copy.from, &copy.to, copy.to_offset, copy.bytes);
        }
        let submitted = gpu.queue.submit([encoder.finish()]);
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
