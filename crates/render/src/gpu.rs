//! The device: found, opened, and watched.

use crate::RenderError;
use std::sync::{Arc, Mutex};

/// An open graphics device.
#[derive(Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    /// First error since the last [`Gpu::check`].
    error: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best adapter there is, without a window: a GPU, else a software one. `WGPU_BACKEND` chooses the interface, as
    /// in all wgpu programs.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] and [`RenderError::NoDevice`].
    pub fn open() -> Result<Self, RenderError> {
        pollster::block_on(Self::open_async())
    }

    /// [`Gpu::open`] where nothing may block.
    ///
    /// # Errors
    /// As for [`Gpu::open`].
    pub async fn open_async() -> Result<Self, RenderError> {
        // OpenGL only where there is nothing better: its loaders are the talkative ones.
        let adapter = match find_adapter(wgpu::Backends::PRIMARY).await {
            Ok(adapter) => adapter,
            Err(_) => {
                find_adapter(wgpu::Backends::all()).await.map_err(|error| RenderError::NoAdapter(error.to_string()))?
            }
        };
        // The adapter's own limits: pictures and buffers may be as large as it can. Nothing relies on more than the baseline.
        let descriptor =
            wgpu::DeviceDescriptor { label: Some("gigalod"), required_limits: adapter.limits(), ..Default::default() };
        let (device, queue) =
            adapter.request_device(&descriptor).await.map_err(|error| RenderError::NoDevice(error.to_string()))?;
        let error = Arc::new(Mutex::new(None));
        let keep_first = error.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            keep_first.lock().expect("nobody panics while holding it").get_or_insert(one_line(&error.to_string()));
        }));
        Ok(Self { device, queue, info: adapter.get_info(), error })
    }

    /// Name of the adapter, and through which interface it is driven.
    pub fn adapter(&self) -> String {
        format!("{} ({})", self.info.name, self.info.backend)
    }

    /// Longest edge of a picture, in pixels.
    pub fn max_picture_edge(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }

    /// The first error since the last call, if there was one.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        match self.error.lock().expect("nobody panics while holding it").take() {
            Some(error) => Err(RenderError::Device(error)),
            None => Ok(()),
        }
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
