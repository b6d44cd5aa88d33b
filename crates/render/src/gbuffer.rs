//! What a pixel shows before it is lit: albedo, normal, linear depth.

use gigalod_geom::ImageSize;

/// sRGB-encoded; alpha is 1 where there is a surface, less where a blended one ends.
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

/// What passes draw to, in this order.
pub(crate) const COLOR_TARGETS: [Option<wgpu::ColorTargetState>; 3] = [target(ALBEDO), target(NORMAL), target(DEPTH)];

const fn target(format: wgpu::TextureFormat) -> Option<wgpu::ColorTargetState> {
    Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL })
}

/// The depth test of a pass.
pub(crate) fn depth_state(compare: wgpu::CompareFunction, write: bool) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH_TEST,
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: Default::default(),
        bias: Default::default(),
    }
}

/// The G-buffer of one picture size.
#[derive(Debug)]
pub(crate) struct GBuffer {
    pub(crate) size: ImageSize,
    pub(crate) albedo: wgpu::Texture,
    pub(crate) normal: wgpu::Texture,
    pub(crate) depth: wgpu::Texture,
    pub(crate) depth_test: wgpu::Texture,
    /// Depths of what was drawn before lines, which look at it; only where there are any.
    pub(crate) before: Option<wgpu::Texture>,
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
            before: None,
        }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(size: ImageSize) -> u64 {
        size.pixels() as u64 * (4 + 8 + 4 + 4)
    }

    /// A pass that draws to it; `clear`: what was there is forgotten.
    pub(crate) fn begin<'a>(&self, encoder: &'a mut wgpu::CommandEncoder, clear: bool) -> wgpu::RenderPass<'a> {
        let [albedo, normal, depth, depth_test] = [&self.albedo, &self.normal, &self.depth, &self.depth_test].map(view);
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("G-buffer"),
            color_attachments: &[
                Some(attachment(&albedo, clear, wgpu::Color::TRANSPARENT)),
                Some(attachment(&normal, clear, wgpu::Color::TRANSPARENT)),
                Some(attachment(&depth, clear, NO_DEPTH)),
            ],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth_test,
                depth_ops: Some(wgpu::Operations {
                    load: if clear { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load },
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }

    /// Bytes of the depths before lines.
    pub(crate) fn before_bytes(size: ImageSize, has_lines: bool) -> u64 {
        if has_lines { size.pixels() as u64 * 4 } else { 0 }
    }

    /// Makes room for depths before lines where there are lines, and frees it where there are none.
    pub(crate) fn want_before(&mut self, device: &wgpu::Device, has_lines: bool) {
        if !has_lines {
            self.before.take().iter().for_each(wgpu::Texture::destroy);
        } else if self.before.is_none() {
            let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
            self.before = Some(create_texture(device, "depth before", self.size, DEPTH, usage));
        }
    }

    /// Keeps the depths of what has been drawn, where there are lines.
    pub(crate) fn keep_depths(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(before) = &self.before {
            encoder.copy_texture_to_texture(self.depth.as_image_copy(), before.as_image_copy(), self.depth.size());
        }
    }

    /// Frees it.
    pub(crate) fn free(&self) {
        [&self.albedo, &self.normal, &self.depth, &self.depth_test].into_iter().for_each(wgpu::Texture::destroy);
        self.before.iter().for_each(wgpu::Texture::destroy);
    }
}

/// A target that is cleared, or drawn over.
pub(crate) fn attachment(
    view: &wgpu::TextureView,
    clear: bool,
    color: wgpu::Color,
) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: if clear { wgpu::LoadOp::Clear(color) } else { wgpu::LoadOp::Load },
            store: wgpu::StoreOp::Store,
        },
    }
}

pub(crate) fn create_texture(
    device: &wgpu::Device,
    label: &str,
    size: ImageSize,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    create_texture_seen_as(device, label, size, format, usage, &[])
}

/// The same, to be looked at in these formats as well.
pub(crate) fn create_texture_seen_as(
    device: &wgpu::Device,
    label: &str,
    size: ImageSize,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
    view_formats: &[wgpu::TextureFormat],
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: size.width, height: size.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats,
    })
}

pub(crate) fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
