//! What a frame hands to the device: at once, or slice by slice, so that drawing can be broken off.
//!
//! Goes in: what is encoded between two calls of [`Commands::goes_on`]. Comes out: submissions. What always holds: nothing is lost,
//! whichever way it goes; broken off, at most two slices are still being drawn.

use crate::{Gpu, RenderError};
use gigalod_runtime::Interrupt;

/// The commands of a frame.
#[derive(Debug)]
pub(crate) struct Commands<'a> {
    gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
    /// What breaks it off; without it nothing is cut.
    interrupt: Option<&'a Interrupt>,
    /// The latest slice.
    submitted: Option<wgpu::SubmissionIndex>,
}

impl<'a> Commands<'a> {
    pub(crate) fn new(gpu: &'a Gpu, interrupt: Option<&'a Interrupt>) -> Self {
        Self { gpu, encoder: gpu.device.create_command_encoder(&Default::default()), interrupt, submitted: None }
    }

    /// For what comes next.
    pub(crate) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        &mut self.encoder
    }

    /// Between two slices. False where the frame is in vain: what was encoded is the last of it.
    ///
    /// # Errors
    /// As for [`Gpu::check`].
    pub(crate) fn goes_on(&mut self) -> Result<bool, RenderError> {
        let Some(interrupt) = self.interrupt else { return Ok(true) };
        let encoder = std::mem::replace(&mut self.encoder, self.gpu.device.create_command_encoder(&Default::default()));
        let submitted = self.gpu.submit([encoder.finish()]);
        // One slice is encoded while the one before is drawn.
        if let Some(before) = self.submitted.replace(submitted) {
            self.gpu.wait_for(before)?;
        }
        Ok(!interrupt.is_set())
    }

    /// Hands in what is left.
    ///
    /// # Errors
    /// As for [`Gpu::check`].
    pub(crate) fn submit(self) -> Result<(), RenderError> {
        self.gpu.submit([self.encoder.finish()]);
        self.gpu.check()
    }
}
