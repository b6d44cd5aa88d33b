//! A window's surface: a finished picture, and a user interface of egui over it. Behind the feature `window`.
//!
//! Goes in: a window's handles, pictures that a [`Renderer`] finished, egui's triangles. Comes out: what the window shows. wgpu does
//! not show through; egui's types do, because its painter needs the device.
//!
//! What always holds: a window as large as the picture shows its bytes unchanged; painting waits for the display, never for files;
//! a surface that is lost, outdated or hidden is put right by the next frame, a lost device by [`WindowPainter::recover`]. The
//! renderer that comes with a painter may draw on another thread meanwhile.

use crate::shader::{self, Target};
use crate::{Gpu, GpuLevel, RenderError, Renderer, cover};
use egui_wgpu::ScreenDescriptor;
use epaint::image::ImageDelta;
use epaint::textures::TexturesDelta;
use epaint::{ClippedPrimitive, ImageData, TextureId};
use gigalod_geom::ImageSize;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use std::collections::BTreeMap;
use std::sync::Arc;

const SOURCE: &str = include_str!("shader/present.wgsl");

/// A window of whatever library.
pub trait WindowHandles: HasWindowHandle + HasDisplayHandle + Send + Sync + std::fmt::Debug + 'static {}
impl<W: HasWindowHandle + HasDisplayHandle + Send + Sync + std::fmt::Debug + 'static> WindowHandles for W {}

/// A picture on the device that a window can show.
#[derive(Clone, Debug)]
pub struct Shown {
    picture: wgpu::Texture,
    size: ImageSize,
}

impl Shown {
    pub(crate) fn new(picture: &wgpu::Texture, size: ImageSize) -> Self {
        Self { picture: picture.clone(), size }
    }

    /// Pixels.
    pub fn size(&self) -> ImageSize {
        self.size
    }
}

/// What egui wants painted.
#[derive(Debug)]
pub struct UiPaint<'a> {
    /// Tessellated shapes.
    pub primitives: &'a [ClippedPrimitive],
    /// Physical pixels for each of egui's points.
    pub pixels_per_point: f32,
}

/// What became of asking for an image.
#[derive(Debug)]
pub enum Acquired {
    /// To be painted.
    Image(WindowImage),
    /// The window is hidden, or has no size.
    Hidden,
    /// The surface was put right: ask once more.
    Again,
}

/// An image that the window will show.
#[derive(Debug)]
pub struct WindowImage(wgpu::SurfaceTexture);

/// The same, with what paints it.
#[derive(Debug)]
pub struct PaintedImage {
    commands: Vec<wgpu::CommandBuffer>,
    target: wgpu::SurfaceTexture,
}

/// Paints one window.
#[derive(Debug)]
pub struct WindowPainter {
    window: Arc<dyn WindowHandles>,
    gpu: Gpu,
    surface: Surface,
    present: PresentPass,
    ui: Ui,
    size: ImageSize,
}

/// egui's painter.
struct Ui {
    renderer: egui_wgpu::Renderer,
    /// All that it has, for a device that is still to come.
    textures: BTreeMap<u64, (TextureId, ImageDelta)>,
}

impl std::fmt::Debug for Ui {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Ui")
    }
}

#[derive(Debug)]
struct Surface {
    instance: wgpu::Instance,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
}

impl WindowPainter {
    /// Opens the best device that can draw into the window, and a renderer on it. Nothing is compiled for splats yet.
    ///
    /// # Errors
    /// As for [`Gpu::open`] and [`Renderer::new`].
    pub fn open(window: Arc<dyn WindowHandles>, size: ImageSize) -> Result<(Self, Renderer), RenderError> {
        let (gpu, surface) = pollster::block_on(open(&window, size, GpuLevel::from_env()?))?;
        let present = PresentPass::new(&gpu, surface.config.format);
        let ui = Ui::new(&gpu, surface.config.format);
        let renderer = Renderer::new(gpu.clone())?;
        Ok((Self { window, gpu, surface, present, ui, size }, renderer))
    }

    /// After [`RenderError::DeviceLost`]: opens a device anew, for this window and, by [`Renderer::move_to`], its renderer.
    ///
    /// # Errors
    /// As for [`Gpu::open`]; then it is still the old one.
    pub fn recover(&mut self) -> Result<Gpu, RenderError> {
        let (gpu, surface) = pollster::block_on(open(&self.window, self.size, self.gpu.wanted_level()))?;
        self.present = PresentPass::new(&gpu, surface.config.format);
        let textures = std::mem::take(&mut self.ui.textures);
        self.ui = Ui::new(&gpu, surface.config.format);
        for (id, image) in textures.values() {
            self.ui.renderer.update_texture(&gpu.device, &gpu.queue, *id, image);
        }
        self.ui.textures = textures;
        (self.gpu, self.surface) = (gpu, surface);
        Ok(self.gpu.clone())
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The window has another size now, in physical pixels; no size while it is minimised.
    pub fn resize(&mut self, size: ImageSize) {
        self.size = size;
        if size.width.min(size.height) > 0 {
            (self.surface.config.width, self.surface.config.height) = clamped(&self.gpu, size);
            self.gpu.configure(&self.surface.surface, &self.surface.config);
        }
    }

    /// The next image of the window; waits for the display. The driver's work, as [`WindowPainter::show`] is.
    ///
    /// # Errors
    /// [`RenderError::DeviceLost`]: [`WindowPainter::recover`]; others say what was wrong.
    pub fn acquire(&mut self) -> Result<Acquired, RenderError> {
        use wgpu::CurrentSurfaceTexture as Current;
        self.gpu.check()?;
        if self.size.width.min(self.size.height) == 0 {
            return Ok(Acquired::Hidden);
        }
        match self.surface.surface.get_current_texture() {
            Current::Success(target) | Current::Suboptimal(target) => Ok(Acquired::Image(WindowImage(target))),
            Current::Timeout | Current::Validation => Ok(Acquired::Again),
            Current::Occluded => Ok(Acquired::Hidden),
            Current::Outdated => {
                self.gpu.configure(&self.surface.surface, &self.surface.config);
                Ok(Acquired::Again)
            }
            Current::Lost => {
                self.gpu.check()?;
                let made = self.surface.instance.create_surface(Handles(self.window.clone()));
                self.surface.surface = made.map_err(|error| RenderError::NoAdapter(error.to_string()))?;
                self.gpu.configure(&self.surface.surface, &self.surface.config);
                Ok(Acquired::Again)
            }
        }
    }

    /// Takes in changes of textures; to be called for each frame of egui, also where there is no image to paint.
    pub fn take_textures(&mut self, textures: &TexturesDelta) {
        self.ui.take(&self.gpu, textures);
    }

    /// Paints a picture into the upper left `area` of the window, in physical pixels, stretched where it has another size; a user
    /// interface over all of it.
    pub fn paint(
        &mut self,
        target: WindowImage,
        shown: Option<&Shown>,
        area: ImageSize,
        ui: &UiPaint<'_>,
    ) -> PaintedImage {
        let WindowImage(target) = target;
        let Gpu { device, queue, .. } = &self.gpu;
        let size = target.texture.size();
        let screen =
            ScreenDescriptor { size_in_pixels: [size.width, size.height], pixels_per_point: ui.pixels_per_point };
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut commands = self.ui.renderer.update_buffers(device, queue, &mut encoder, ui.primitives, &screen);
        let picture = shown.map(|shown| self.present.bind(&self.gpu, &shown.picture));
        {
            let view = target.texture.create_view(&Default::default());
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("window"),
                    color_attachments: &[Some(crate::gbuffer::attachment(&view, true, wgpu::Color::BLACK))],
                    ..Default::default()
                })
                .forget_lifetime();
            if let Some(picture) = &picture {
                // A window that has just been made smaller may not hold all of it.
                let [width, height] = screen.size_in_pixels.map(|edge| edge as f32);
                let (area_width, area_height) = (area.width as f32, area.height as f32);
                pass.set_viewport(0.0, 0.0, area_width.min(width), area_height.min(height), 0.0, 1.0);
                pass.set_pipeline(&self.present.pipeline);
                pass.set_bind_group(0, picture, &[]);
                pass.draw(0..3, 0..1);
                pass.set_viewport(0.0, 0.0, width, height, 0.0, 1.0);
            }
            self.ui.renderer.render(&mut pass, ui.primitives, &screen);
        }
        commands.push(encoder.finish());
        PaintedImage { commands, target }
    }

    /// Frees textures that egui no longer uses; to be called at the end of each of its frames.
    pub fn free_textures(&mut self, textures: &TexturesDelta) {
        self.ui.free(textures);
    }

    /// Hands a painted image to the driver.
    ///
    /// # Errors
    /// As for [`WindowPainter::acquire`].
    pub fn show(&mut self, image: PaintedImage) -> Result<(), RenderError> {
        self.gpu.submit(image.commands);
        self.gpu.queue.present(image.target);
        self.gpu.check()
    }
}

/// Writes a part of a kept image anew.
fn patch(kept: &mut ImageDelta, [x, y]: [usize; 2], part: &ImageDelta) {
    let (ImageData::Color(whole), ImageData::Color(part)) = (&mut kept.image, &part.image);
    let whole = Arc::make_mut(whole);
    let width = whole.size[0];
    for (row, pixels) in part.pixels.chunks(part.size[0].max(1)).enumerate() {
        let begin = (y + row) * width + x;
        if let Some(place) = whole.pixels.get_mut(begin..begin + pixels.len()) {
            place.copy_from_slice(pixels);
        }
    }
}

fn key(id: TextureId) -> u64 {
    match id {
        TextureId::Managed(number) => number << 1,
        TextureId::User(number) => number << 1 | 1,
    }
}

impl Ui {
    fn new(gpu: &Gpu, format: wgpu::TextureFormat) -> Self {
        let renderer = egui_wgpu::Renderer::new(&gpu.device, format, egui_wgpu::RendererOptions::default());
        Self { renderer, textures: BTreeMap::new() }
    }

    /// Uploads what has changed, and keeps it.
    fn take(&mut self, gpu: &Gpu, textures: &TexturesDelta) {
        let all = textures.set.iter().flat_map(|(id, deltas)| deltas.iter().map(move |delta| (id, delta)));
        for (id, delta) in all {
            self.renderer.update_texture(&gpu.device, &gpu.queue, *id, delta);
            match (delta.pos, self.textures.get_mut(&key(*id))) {
                (Some(at), Some((_, kept))) => patch(kept, at, delta),
                _ => {
                    self.textures.insert(key(*id), (*id, delta.clone()));
                }
            }
        }
    }

    fn free(&mut self, textures: &TexturesDelta) {
        for id in &textures.free {
            self.renderer.free_texture(id);
            self.textures.remove(&key(*id));
        }
    }
}

/// A window that surfaces share.
#[derive(Debug)]
struct Handles(Arc<dyn WindowHandles>);

impl HasWindowHandle for Handles {
    fn window_handle(&self) -> Result<raw_window_handle::WindowHandle<'_>, raw_window_handle::HandleError> {
        self.0.window_handle()
    }
}

impl HasDisplayHandle for Handles {
    fn display_handle(&self) -> Result<raw_window_handle::DisplayHandle<'_>, raw_window_handle::HandleError> {
        self.0.display_handle()
    }
}

/// A device for a window: as [`Gpu::open`], of those that can draw into it.
async fn open(
    window: &Arc<dyn WindowHandles>,
    size: ImageSize,
    wanted: GpuLevel,
) -> Result<(Gpu, Surface), RenderError> {
    let mut why = String::new();
    for backends in [wgpu::Backends::PRIMARY, wgpu::Backends::all()] {
        let mut descriptor = wgpu::InstanceDescriptor::new_with_display_handle(Box::new(Handles(window.clone())));
        descriptor.backends = backends;
        let instance = wgpu::Instance::new(descriptor.with_env());
        let surface = match instance.create_surface(Handles(window.clone())) {
            Ok(surface) => surface,
            Err(error) => {
                why = error.to_string();
                continue;
            }
        };
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: Some(&surface),
            ..Default::default()
        };
        let adapter = match instance.request_adapter(&options).await {
            Ok(adapter) => adapter,
            Err(error) => {
                why = error.to_string();
                continue;
            }
        };
        let gpu = Gpu::of_adapter(&adapter, wanted).await?;
        let (width, height) = clamped(&gpu, size);
        let Some(mut config) = surface.get_default_config(&adapter, width, height) else {
            why = "the window takes no pictures of this adapter".into();
            continue;
        };
        // egui blends what people see, not light; and pictures are bytes already.
        let formats = surface.get_capabilities(&adapter).formats;
        let bytes = [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm];
        let Some(format) = bytes.into_iter().find(|format| formats.contains(format)) else {
            why = format!("the window takes pictures as {formats:?}, expected Bgra8Unorm or Rgba8Unorm");
            continue;
        };
        config.format = format;
        config.present_mode = wgpu::PresentMode::Fifo;
        // A window lives of short ways, not of many pictures.
        config.desired_maximum_frame_latency = 1;
        gpu.configure(&surface, &config);
        gpu.check()?;
        return Ok((gpu, Surface { instance, surface, config }));
    }
    Err(RenderError::NoAdapter(why))
}

fn clamped(gpu: &Gpu, size: ImageSize) -> (u32, u32) {
    let limit = gpu.max_picture_edge();
    (size.width.clamp(1, limit), size.height.clamp(1, limit))
}

/// Copies a picture into the window. Shader: `shader/present.wgsl`.
#[derive(Debug)]
struct PresentPass {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl PresentPass {
    fn new(gpu: &Gpu, target: wgpu::TextureFormat) -> Self {
        let device = &gpu.device;
        let module = shader::module(device, "present.wgsl", SOURCE, Target::None);
        let layout = cover::layout(device, "present", &[cover::texture_entry(0)]);
        let encode = [("ENCODE", f64::from(u8::from(!gpu.has_view_formats)))];
        let passes = (&module, "cover_window", "present");
        let pipeline = cover::pipeline(device, "present", &layout, passes, &encode, target.into());
        Self { pipeline, layout }
    }

    fn bind(&self, gpu: &Gpu, picture: &wgpu::Texture) -> wgpu::BindGroup {
        let format = gpu.has_view_formats.then(|| picture.format().remove_srgb_suffix());
        let usage = Some(wgpu::TextureUsages::TEXTURE_BINDING);
        let view = picture.create_view(&wgpu::TextureViewDescriptor { format, usage, ..Default::default() });
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("present"),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
        })
    }
}
