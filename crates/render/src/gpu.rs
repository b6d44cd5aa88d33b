//! The device: found, opened, and watched.
//!
//! Takes how much of the device may be used; gives a device whose errors are kept until somebody asks. What always holds: a lost
//! device stays lost, and says so whatever else went wrong.

use crate::RenderError;
use crate::gbuffer::create_texture_seen_as;
use gigalod_geom::ImageSize;
use std::sync::{Arc, Mutex, RwLock};

/// How much of what a device can do may be used. The picture is the same, but for what [`GpuLevel::WebGl`] says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum GpuLevel {
    /// No compute passes, no storage buffers: splats are drawn by the depth test, and not with Gaussian kernels. Of two splats
    /// equally near but for rounding, another may win.
    WebGl,
    /// The baseline of WebGPU and nothing beyond.
    WebGpu,
    /// All there is.
    #[default]
    Native,
}

impl GpuLevel {
    /// What the environment variable `GIGALOD_GPU_LEVEL` asks for (`webgl`, `webgpu` or `native`), by default `native`: to see
    /// on one device what another will show, or to get around a driver's faults.
    ///
    /// # Errors
    /// [`RenderError::Level`].
    pub fn from_env() -> Result<Self, RenderError> {
        match std::env::var("GIGALOD_GPU_LEVEL").as_deref() {
            Err(_) | Ok("" | "native") => Ok(Self::Native),
            Ok("webgpu") => Ok(Self::WebGpu),
            Ok("webgl") => Ok(Self::WebGl),
            Ok(other) => Err(RenderError::Level(other.into())),
        }
    }
}

/// An open graphics device. Clones are the same one.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    /// Asked for.
    wanted: GpuLevel,
    /// Got.
    level: GpuLevel,
    /// A texture can be looked at in another format than its own.
    pub(crate) has_view_formats: bool,
    can_add: bool,
    faults: Arc<Mutex<Faults>>,
    /// Held by whoever submits; by one alone who needs the queue to run empty.
    submitting: Arc<RwLock<()>>,
}

/// What went wrong since somebody asked.
#[derive(Debug, Default)]
struct Faults {
    /// Stays.
    lost: Option<String>,
    /// The first since the last [`Gpu::check`].
    first: Option<RenderError>,
}

impl Gpu {
    /// Opens the best adapter there is, without a window: a GPU, else a software one. `WGPU_BACKEND` chooses the interface, as
    /// in all wgpu programs, and `GIGALOD_GPU_LEVEL` what may be used of it ([`GpuLevel::from_env`]).
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`], [`RenderError::NoDevice`] and [`RenderError::Level`].
    pub fn open() -> Result<Self, RenderError> {
        Self::open_at(GpuLevel::from_env()?)
    }

    /// [`Gpu::open`], using no more of the device than `level`.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] and [`RenderError::NoDevice`].
    pub fn open_at(level: GpuLevel) -> Result<Self, RenderError> {
        pollster::block_on(Self::open_async(level))
    }

    /// [`Gpu::open_at`] where nothing may block.
    ///
    /// # Errors
    /// As for [`Gpu::open_at`].
    pub async fn open_async(wanted: GpuLevel) -> Result<Self, RenderError> {
        // OpenGL only where there is nothing better: its loaders are the talkative ones.
        let adapter = match find_adapter(wgpu::Backends::PRIMARY).await {
            Ok(adapter) => adapter,
            Err(_) => {
                find_adapter(wgpu::Backends::all()).await.map_err(|error| RenderError::NoAdapter(error.to_string()))?
            }
        };
        Self::of_adapter(&adapter, wanted).await
    }

    /// Opens an adapter.
    pub(crate) async fn of_adapter(adapter: &wgpu::Adapter, wanted: GpuLevel) -> Result<Self, RenderError> {
        let level = wanted.min(highest_level(adapter));
        let required_features =
            if level == GpuLevel::Native { WIDE_KEYS & adapter.features() } else { wgpu::Features::empty() };
        // The adapter's own limits: pictures and buffers may be as large as it can. Nothing relies on more than the baseline.
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gigalod"),
            required_limits: adapter.limits(),
            required_features,
            ..Default::default()
        };
        let (device, queue) =
            adapter.request_device(&descriptor).await.map_err(|error| RenderError::NoDevice(error.to_string()))?;
        let faults = Arc::new(Mutex::new(Faults::default()));
        let keep_first = faults.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let text = one_line(&error.to_string());
            let fault = match error {
                wgpu::Error::OutOfMemory { .. } => RenderError::OutOfMemory(text),
                _ => RenderError::Device(text),
            };
            keep_first.lock().expect("nobody panics while holding it").first.get_or_insert(fault);
        }));
        let keep_lost = faults.clone();
        device.set_device_lost_callback(move |reason, text| {
            let why = match (reason, one_line(&text)) {
                (wgpu::DeviceLostReason::Destroyed, _) => "it was given up".into(),
                (_, text) if text.is_empty() => "the driver does not say why".into(),
                (_, text) => text,
            };
            keep_lost.lock().expect("nobody panics while holding it").lost.get_or_insert(why);
        });
        let has_view_formats = adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::VIEW_FORMATS);
        let sum = adapter.get_texture_format_features(crate::smooth::SUM);
        let can_add = sum.allowed_usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT)
            && sum.flags.contains(wgpu::TextureFormatFeatureFlags::BLENDABLE);
        Ok(Self {
            device,
            queue,
            info: adapter.get_info(),
            wanted,
            level,
            has_view_formats,
            can_add,
            faults,
            submitting: Arc::default(),
        })
    }

    /// Hands commands to the device. The only way to do so: a window's surface is configured while nobody does.
    pub(crate) fn submit(&self, commands: impl IntoIterator<Item = wgpu::CommandBuffer>) -> wgpu::SubmissionIndex {
        let _turn = self.submitting.read().expect("nobody panics while holding it");
        self.queue.submit(commands)
    }

    /// Gives a surface its size. That waits for the queue to be empty, and fails where another thread submits meanwhile; so others
    /// wait for it.
    #[cfg(feature = "window")]
    pub(crate) fn configure(&self, surface: &wgpu::Surface<'_>, config: &wgpu::SurfaceConfiguration) {
        let _alone = self.submitting.write().expect("nobody panics while holding it");
        surface.configure(&self.device, config);
    }

    /// Name of the adapter, and through which interface it is driven.
    pub fn adapter(&self) -> String {
        format!("{} ({})", self.info.name, self.info.backend)
    }

    /// What is used of the device: what was asked for, or as much of it as the device has.
    pub fn level(&self) -> GpuLevel {
        self.level
    }

    /// What was asked for.
    pub(crate) fn wanted_level(&self) -> GpuLevel {
        self.wanted
    }

    /// True where keys of 64 bits can be compared and exchanged at once.
    pub fn has_wide_keys(&self) -> bool {
        self.device.features().contains(WIDE_KEYS)
    }

    /// True where the host's processor does the drawing.
    pub(crate) fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// True where pictures can be added up, for smooth edges.
    pub(crate) fn can_add(&self) -> bool {
        self.can_add
    }

    /// Longest edge of a picture, in pixels.
    pub fn max_picture_edge(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }

    /// Gives the device up, with all that is on it: what a driver may do at any time. The next frame is
    /// [`RenderError::DeviceLost`], until [`crate::Renderer::recover`].
    pub fn close(&self) {
        self.device.destroy();
        let _ = self.device.poll(wgpu::PollType::Poll);
        let mut faults = self.faults.lock().expect("nobody panics while holding it");
        faults.lost.get_or_insert_with(|| "it was given up".into());
    }

    /// A texture of sRGB values that a window can also show as the bytes that they are, where the device allows it.
    pub(crate) fn create_shown_texture(
        &self,
        label: &str,
        size: ImageSize,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        let bytes = [format.remove_srgb_suffix()];
        let view_formats = if self.has_view_formats { &bytes[..] } else { &[] };
        create_texture_seen_as(&self.device, label, size, format, usage, view_formats)
    }

    /// Bytes that a buffer may have, and that a pass can see of it.
    pub(crate) fn most_buffer_bytes(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_buffer_size.min(limits.max_storage_buffer_binding_size.max(1 << 20)).min(1 << 30)
    }

    /// True where the device is gone.
    pub fn is_lost(&self) -> bool {
        self.faults.lock().expect("nobody panics while holding it").lost.is_some()
    }

    /// The first error since the last call, if there was one.
    ///
    /// # Errors
    /// [`RenderError::DeviceLost`], [`RenderError::OutOfMemory`] and [`RenderError::Device`].
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let mut faults = self.faults.lock().expect("nobody panics while holding it");
        let first = faults.first.take();
        match (&faults.lost, first) {
            // A device may be lost for lack of memory: then that is the news, and the loss is next.
            (Some(_), Some(fault @ RenderError::OutOfMemory(_))) => Err(fault),
            (Some(why), _) => Err(RenderError::DeviceLost(why.clone())),
            (None, Some(fault)) => Err(fault),
            (None, None) => Ok(()),
        }
    }

    /// Waits until the device has done all it was given.
    ///
    /// # Errors
    /// As for [`Gpu::check`].
    pub(crate) fn wait(&self) -> Result<(), RenderError> {
        self.poll(wgpu::PollType::wait_indefinitely())
    }

    /// Waits until the device has done what it was given up to then.
    ///
    /// # Errors
    /// As for [`Gpu::check`].
    pub(crate) fn wait_for(&self, submitted: wgpu::SubmissionIndex) -> Result<(), RenderError> {
        self.poll(wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None })
    }

    fn poll(&self, until: wgpu::PollType) -> Result<(), RenderError> {
        let polled = self.device.poll(until);
        self.check()?;
        polled.map(|_| ()).map_err(|error| RenderError::Device(error.to_string()))
    }
}

/// What keys of 64 bits need.
const WIDE_KEYS: wgpu::Features = wgpu::Features::SHADER_INT64.union(wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX);

fn highest_level(adapter: &wgpu::Adapter) -> GpuLevel {
    let storage = wgpu::DownlevelFlags::COMPUTE_SHADERS
        | wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE
        | wgpu::DownlevelFlags::VERTEX_STORAGE
        | wgpu::DownlevelFlags::INDIRECT_EXECUTION;
    // What the passes bind in one stage.
    let enough = adapter.limits().max_storage_buffers_per_shader_stage >= 6;
    match (adapter.get_downlevel_capabilities().flags.contains(storage) && enough, adapter.features()) {
        (false, _) => GpuLevel::WebGl,
        (true, features) if !features.contains(WIDE_KEYS) => GpuLevel::WebGpu,
        (true, _) => GpuLevel::Native,
    }
}

/// The best adapter of some interfaces, or of those that the environment asks for.
async fn find_adapter(backends: wgpu::Backends) -> Result<wgpu::Adapter, wgpu::RequestAdapterError> {
    let descriptor = wgpu::InstanceDescriptor { backends, ..wgpu::InstanceDescriptor::new_without_display_handle() };
    let options =
        wgpu::RequestAdapterOptions { power_preference: wgpu::PowerPreference::HighPerformance, ..Default::default() };
    wgpu::Instance::new(descriptor.with_env()).request_adapter(&options).await
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
