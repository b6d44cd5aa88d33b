//! What a pixel shows before it is lit: albedo, normal, linear depth.

use gigalod_geom::ImageSize;

/// sRGB-encoded, alpha 1 where there is a surface.
pub(crate) const ALBEDO: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// World space; w holds the extent in pixels of what was drawn there.
pub(crate) const NORMAL: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Distance along the view axis in world units, as the bits of an `f32`: unlike a 32-bit float target, a 32-bit integer one can
/// be drawn to and copied on every adapter, OpenGL included.
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
/// What [`DEPTH`] holds where there is nothing.
pub(crate) const NO_DEPTH: wgpu::Color = wgpu::Color { r: 0x7f80_0000 as f64, g: 0.0, b: 0.0, a: 0.0 };
/// For the depth test alone. near / z: 1 at the near plane, 0 at infinity; as a float that has the same relative precision at
/// all distances.
pub(crate) const DEPTH_TEST: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The G-buffer of one picture size.
#[derive(Debug)]
pub(crate) struct GBuffer {
    pub(crate) size: ImageSize,
    pub(crate) albedo: wgpu::Texture,
    pub(crate) normal: wgpu::Texture,
    pub(crate) depth: wgpu::Texture,
    pub(crate) depth_test: wgpu::Texture,
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
            depth_test: texture("depth test", DEPTH_TEST),
        }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.size.pixels() as u64 * (4 + 8 + 4 + 4)
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
