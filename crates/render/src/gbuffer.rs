//! What a pixel shows before it is lit: albedo, normal, depth.

use gigalod_geom::ImageSize;

/// sRGB-encoded, alpha 1 where there is a surface.
pub(crate) const ALBEDO: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// World space; w holds the extent in pixels of what was drawn there.
pub(crate) const NORMAL: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// near / z: 1 at the near plane, 0 at infinity and for background. As a float this has the same relative precision at all
/// distances, and unlike a 32-bit colour target it can be drawn to on every adapter; z is `near / depth`.
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The G-buffer of one picture size.
#[derive(Debug)]
pub(crate) struct GBuffer {
    pub(crate) size: ImageSize,
    pub(crate) albedo: wgpu::Texture,
    pub(crate) normal: wgpu::Texture,
    pub(crate) depth: wgpu::Texture,
}

impl GBuffer {
    pub(crate) fn new(device: &wgpu::Device, size: ImageSize) -> Self {
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let texture = |label, format| create_texture(device, label, size, format, usage);
        Self {
            size,
            albedo: texture("albedo", ALBEDO),
            normal: texture("normal", NORMAL),
            depth: texture("depth", DEPTH),
        }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.size.pixels() as u64 * (4 + 8 + 4)
    }
}

pub(crate) fn create_texture(
    device: &wgpu::Device,
    label: &str,
    size: ImageSize,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: size.width, height: size.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

pub(crate) fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
