//! From a texture to the host.

use crate::memory::Pool;
use crate::staging::fault;
use crate::{Gpu, RenderError};
use gigalod_geom::ImageSize;
use std::sync::mpsc;

/// Bytes that are read back at a time, unless a row has more.
const BAND_BYTES: u64 = 8 << 20;

/// Bytes of the buffer that textures of this size are read through, with up to 8 bytes a pixel.
pub(crate) fn buffer_bytes(size: ImageSize) -> u64 {
    let row = padded(size.width * 8);
    row * rows_at_once(row, size.height)
}

fn padded(row_bytes: u32) -> u64 {
    u64::from(row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT))
}

fn rows_at_once(padded_row: u64, height: u32) -> u64 {
    (BAND_BYTES / padded_row).clamp(1, u64::from(height))
}

/// Copies a texture into rows of `bytes_per_pixel` (4 or 8) times its width, without padding, through `buffer`, which has
/// [`buffer_bytes`]. Blocks until the device is done.
pub(crate) fn read_texture(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    bytes_per_pixel: u32,
    buffer: &Pool,
) -> Result<Vec<u8>, RenderError> {
    let (width, height) = (texture.width(), texture.height());
    let row = width * bytes_per_pixel;
    let padded_row = padded(row) as u32;
    let rows_at_once = rows_at_once(padded(row), height).min(buffer.bytes() / padded(row)) as u32;
    let buffer = buffer.buffer();
    let mut out = Vec::with_capacity(row as usize * height as usize);
    for first in (0..height).step_by(rows_at_once as usize) {
        let rows = rows_at_once.min(height - first);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x: 0, y: first, z: 0 }, ..texture.as_image_copy() },
            wgpu::TexelCopyBufferInfo {
                buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row),
                    rows_per_image: Some(rows),
                },
            },
            wgpu::Extent3d { width, height: rows, depth_or_array_layers: 1 },
        );
        gpu.submit([encoder.finish()]);
        read_rows(gpu, buffer, |all| {
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
    gpu.wait()?;
    mapped.recv().map_err(|error| fault(gpu, &error))?.map_err(|error| fault(gpu, &error))?;
    visit(&buffer.get_mapped_range(..).map_err(|error| fault(gpu, &error))?);
    buffer.unmap();
    Ok(())
}
