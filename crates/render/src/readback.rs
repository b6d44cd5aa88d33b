//! From a texture to the host.

use crate::{Gpu, RenderError};
use std::sync::mpsc;

/// Bytes that are read back at a time: a buffer is capped at 2 GiB on many drivers, and this much is soon copied.
const BAND_BYTES: u64 = 64 << 20;

/// Copies a texture into rows of `bytes_per_pixel` times its width, without padding. Blocks until the device is done.
pub(crate) fn read_texture(gpu: &Gpu, texture: &wgpu::Texture, bytes_per_pixel: u32) -> Result<Vec<u8>, RenderError> {
    let (width, height) = (texture.width(), texture.height());
    let row = width * bytes_per_pixel;
    let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let rows_at_once = (BAND_BYTES / u64::from(padded_row)).clamp(1, u64::from(height)) as u32;
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size: u64::from(padded_row) * u64::from(rows_at_once),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut out = Vec::with_capacity(row as usize * height as usize);
    for first in (0..height).step_by(rows_at_once as usize) {
        let rows = rows_at_once.min(height - first);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x: 0, y: first, z: 0 }, ..texture.as_image_copy() },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row),
                    rows_per_image: Some(rows),
                },
            },
            wgpu::Extent3d { width, height: rows, depth_or_array_layers: 1 },
        );
        gpu.queue.submit([encoder.finish()]);
        read_rows(gpu, &buffer, |all| {
            let padded_rows = all.chunks_exact(padded_row as usize).take(rows as usize);
            padded_rows.for_each(|padded| out.extend_from_slice(&padded[..row as usize]));
        })?;
    }
    Ok(out)
}

/// Waits for the device and shows what it wrote to `buffer`.
fn read_rows(gpu: &Gpu, buffer: &wgpu::Buffer, visit: impl FnOnce(&[u8])) -> Result<(), RenderError> {
    let (sender, mapped) = mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver waits below; it is gone only if polling failed, and that is reported.
        let _ = sender.send(result);
    });
    let device_error = |error: &dyn std::fmt::Display| RenderError::Device(error.to_string());
    gpu.device
        .poll(wgpu::PollType::Wait { submission_index: None, timeout: None })
        .map_err(|error| device_error(&error))?;
    gpu.check()?;
    mapped.recv().map_err(|error| device_error(&error))?.map_err(|error| device_error(&error))?;
    visit(&buffer.get_mapped_range(..).map_err(|error| device_error(&error))?);
    buffer.unmap();
    Ok(())
}
