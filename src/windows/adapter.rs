//! The device that draws and presents the windows.

use std::sync::{Arc, Mutex, PoisonError};

use winit::window::Window;

use super::{WindowsError, platform::surface_target};
use crate::gpu::GpuError;

/// A device that can present.
pub(super) struct WindowGpu {
    pub(super) instance: wgpu::Instance,
    pub(super) adapter: wgpu::Adapter,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) name: String,
    /// First driver error since the last check.
    failure: Arc<Mutex<Option<String>>>,
}

impl WindowGpu {
    /// Opens the adapter named `preferred` if it can present to the window, otherwise the first adapter that can. Returns it with the window's
    /// surface.
    ///
    /// # Errors
    ///
    /// No adapter can present there, or it cannot be opened.
    pub(super) fn open(
        window: Arc<Window>,
        name: &str,
        preferred: &str,
    ) -> Result<(Self, wgpu::Surface<'static>), WindowsError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let surface = surface(&instance, window, name)?;
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        adapters.sort_by_key(|adapter| adapter.get_info().name != preferred);
        let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        let found = adapters.into_iter().find(|adapter| adapter.is_surface_supported(&surface));
        let Some(adapter) = found else {
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(WindowsError::NoAdapter(names));
        };
        let name = adapter.get_info().name;
        if name != preferred {
            tracing::info!("windows use the adapter {name}: {preferred} cannot present on this display");
        }
        let limits = wgpu::Limits::default().using_resolution(adapter.limits());
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("windows"),
            required_limits: limits.or_worse_values_from(&adapter.limits()),
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|source| GpuError::Device { adapter: name.clone(), source })?;
        let failure = Arc::new(Mutex::new(None));
        let reported = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut first = reported.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert_with(|| error.to_string());
        }));
        Ok((Self { instance, adapter, device, queue, name, failure }, surface))
    }

    /// Creates the surface of another window.
    pub(super) fn surface(&self, window: Arc<Window>, name: &str) -> Result<wgpu::Surface<'static>, WindowsError> {
        surface(&self.instance, window, name)
    }

    /// Waits until the device has finished everything that was submitted.
    ///
    /// # Errors
    ///
    /// The device is lost.
    pub(super) fn finish(&self) -> Result<(), WindowsError> {
        // Writes to textures are submitted only with the next commands, so submit an empty list.
        self.queue.submit([]);
        let done = self.device.poll(wgpu::PollType::wait_indefinitely());
        done.map_err(|error| WindowsError::Refused(error.to_string()))?;
        self.take_failure()
    }

    /// Returns the driver error reported since the last call, if any.
    pub(super) fn take_failure(&self) -> Result<(), WindowsError> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(message) => Err(WindowsError::Refused(message)),
            None => Ok(()),
        }
    }
}

fn surface(instance: &wgpu::Instance, window: Arc<Window>, name: &str) -> Result<wgpu::Surface<'static>, WindowsError> {
    let refused = |error: wgpu::CreateSurfaceError| WindowsError::Window {
        window: name.to_owned(),
        problem: format!("no surface: {error}"),
    };
    instance.create_surface(surface_target(window)).map_err(refused)
}
