//! From a texture to the host.

use crate::{Gpu, RenderError};
use std::sync::mpsc;

/// Copies a texture into rows of `bytes_per_pixel` times its width, without padding. Blocks until the device is done.
pub(crate) fn read_texture(gpu: &Gpu, texture: &wgpu::Texture, bytes_per_pixel: u32) -> Result<Vec<u8>, RenderError> {
    let (width, height) = (texture.width(), texture.height());
    let row = width * bytes_per_pixel;
    let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size: u64::from(padded_row) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded_row),
                rows_per_image: Some(height),
            },
        },
        texture.size(),
    );
    gpu.queue.submit([encoder.finish()]);
    let (sender, mapped) = mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver waits below; it is gone only if polling failed, and that is reported.
        let _ = sender.send(result);
    });
    gpu.device
        .poll(wgpu::PollType::Wait { submission_index: None, timeout: None })
        .map_err(|error| RenderError::Device(error.to_string()))?;
    gpu.check()?;
    let device_error = |error: &dyn std::fmt::Display| RenderError::Device(error.to_string());
    mapped.recv().map_err(|error| device_error(&error))?.map_err(|error| device_error(&error))?;
    let rows = buffer.get_mapped_range(..).map_err(|error| device_error(&error))?;
    let mut out = Vec::with_capacity(row as usize * height as usize);
    for padded in rows.chunks_exact(padded_row as usize) {
        out.extend_from_slice(&padded[..row as usize]);
    }
    Ok(out)
}
