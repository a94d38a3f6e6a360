//! Chooses and opens an adapter, reports its features and the fallbacks in use, and explains why no adapter was found.

use std::{
    fmt,
    panic::{self, AssertUnwindSafe},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use serde::Serialize;

use super::{
    compile_ahead::CompileAhead,
    frame_pool::{Counters, FramePool},
};
use crate::plan::Limits;

/// Which adapter to open, and how.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// Part of the adapter's name, case-insensitive; `None`: the fastest kind of adapter.
    pub adapter: Option<String>,
    /// Sums in 32-bit words even if the adapter has 64-bit atomics, to test that path.
    pub force_u32_accumulator: bool,
    /// Blends 16-bit floats even if the adapter blends 32-bit floats, to test that path.
    pub force_half_blending: bool,
    /// Binds at most this many bytes of stars or pixels at once, even if the adapter supports more, to test strips, batches and segments
    /// on small images.
    pub binding_limit_bytes: Option<u64>,
}

/// Why an adapter could not be opened or failed later.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter, or none with the given name, was found.
    #[error("{0}")]
    NoAdapter(String),
    /// The driver refused the device.
    #[error("adapter `{adapter}`: cannot open the device: {source}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// Error of the driver.
        source: wgpu::RequestDeviceError,
    },
    /// The device of a headset's runtime cannot be created or used.
    #[error("cannot use the device of the headset's runtime: {0}")]
    Adopt(String),
    /// The device no longer responds.
    #[error("the device was lost: {0}")]
    Lost(String),
    /// The driver refused a command, or ran out of memory.
    #[error("the device refused the frame: {0}")]
    Refused(String),
    /// Results could not be read back.
    #[error("cannot read results back from the device: {0}")]
    Readback(#[from] wgpu::MapRangeError),
}

/// Report of `steradian info` on the adapter in use.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AdapterReport {
    /// Name of the adapter.
    pub adapter: String,
    /// Driver and its version.
    pub driver: String,
    /// Graphics interface.
    pub backend: String,
    /// Kind of device.
    pub device_type: String,
    /// Optional features that are used.
    pub features: Vec<String>,
    /// Relevant limits and their values.
    pub limits: Vec<(String, u64)>,
    /// Replacements for missing features.
    pub fallbacks: Vec<String>,
}

impl fmt::Display for AdapterReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "adapter    {}", self.adapter)?;
        writeln!(f, "driver     {}", self.driver)?;
        writeln!(f, "backend    {}", self.backend)?;
        writeln!(f, "type       {}", self.device_type)?;
        writeln!(f, "features   {}", self.features.join(", "))?;
        for (name, value) in &self.limits {
            writeln!(f, "limit      {name} = {value}")?;
        }
        if self.fallbacks.is_empty() {
            write!(f, "fallbacks  none")
        } else {
            write!(f, "fallbacks  {}", self.fallbacks.join("; "))
        }
    }
}

/// The features and limits in use of an adapter, and the fallbacks for missing ones.
#[derive(Clone)]
pub(super) struct Selection {
    pub(super) features: wgpu::Features,
    pub(super) limits: wgpu::Limits,
    wide_accumulator: bool,
    timestamps: bool,
    blend_format: wgpu::TextureFormat,
    fallbacks: Vec<String>,
}

impl Selection {
    pub(super) fn new(adapter: &wgpu::Adapter, options: &GpuOptions) -> Self {
        let offered = adapter.features();
        let u64_features = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS;
        let mut features = wgpu::Features::empty();
        let mut fallbacks = Vec::new();
        let wide_accumulator = offered.contains(u64_features) && !options.force_u32_accumulator;
        if wide_accumulator {
            features |= u64_features;
        } else if options.force_u32_accumulator {
            fallbacks.push("sums in 32-bit words with carries (requested)".to_owned());
        } else {
            fallbacks.push("no 64-bit atomics: sums in 32-bit words with carries".to_owned());
        }
        let timestamps = offered.contains(wgpu::Features::TIMESTAMP_QUERY);
        if timestamps {
            features |= wgpu::Features::TIMESTAMP_QUERY;
        } else {
            fallbacks.push("no timestamps: GPU times are not measured".to_owned());
        }

        let blends_floats = offered.contains(wgpu::Features::FLOAT32_BLENDABLE) && !options.force_half_blending;
        let blend_format = if blends_floats {
            features |= wgpu::Features::FLOAT32_BLENDABLE;
            wgpu::TextureFormat::Rgba32Float
        } else {
            let why = if options.force_half_blending { "requested" } else { "no blending of 32-bit floats" };
            fallbacks.push(format!("methods that blend sum in 16-bit floats, up to 65504 cd/m^2 ({why})"));
            wgpu::TextureFormat::Rgba16Float
        };

        // Only the limits that determine the size of a batch are raised above the defaults.
        let available = adapter.limits();
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            max_buffer_size: available.max_buffer_size,
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            // The resolve pass binds nine storage buffers, the pass over pixels of `sky_cube` thirteen.
            max_storage_buffers_per_shader_stage: available.max_storage_buffers_per_shader_stage,
            ..Default::default()
        };
        let limits = limits.or_worse_values_from(&available);
        Self { features, limits, wide_accumulator, timestamps, blend_format, fallbacks }
    }

    /// Descriptor for the request of the device.
    pub(super) fn descriptor(&self) -> wgpu::DeviceDescriptor<'static> {
        wgpu::DeviceDescriptor {
            label: Some("steradian"),
            required_features: self.features,
            required_limits: self.limits.clone(),
            ..Default::default()
        }
    }
}

/// Longest time for submitted work before the device counts as lost.
pub(crate) const SUBMISSION_TIMEOUT: Duration = Duration::from_secs(600);

/// An open device.
pub struct Gpu {
    /// The device of the adapter.
    pub device: wgpu::Device,
    /// Queue of the device.
    pub queue: wgpu::Queue,
    /// Whether sums use 64-bit words.
    pub(crate) wide_accumulator: bool,
    /// Whether passes are timed by the device.
    pub(crate) timestamps: bool,
    /// Format of the targets that blend.
    pub(crate) blend_format: wgpu::TextureFormat,
    /// Whether the adapter is a software driver.
    pub(crate) software: bool,
    binding_limit_bytes: u64,
    readback_limit_bytes: u64,
    /// The first error of the driver since the last [`Gpu::take_failure`].
    failure: Arc<Mutex<Option<String>>>,
    report: AdapterReport,
    pub(super) pool: Mutex<FramePool>,
    pub(super) counters: Counters,
    /// Set for software drivers, if this module opened the device.
    pub(super) compile_ahead: Option<CompileAhead>,
    /// Largest number of workgroups of a dispatch along an axis.
    pub(super) max_workgroups: u32,
    /// Buffers that passes bind in addition to their own: see [`Gpu::bind_tables`].
    pub(super) tables: Vec<wgpu::Buffer>,
}

impl Gpu {
    /// Opens an adapter. Prefers discrete GPUs to integrated ones, and those to software drivers.
    pub fn open(options: &GpuOptions) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Cpu => 3,
            wgpu::DeviceType::Other => 4,
        });
        let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        let wanted = options.adapter.as_deref().map(str::to_lowercase);
        let chosen = adapters
            .into_iter()
            .zip(&names)
            .find(|(_, name)| wanted.as_ref().is_none_or(|wanted| name.to_lowercase().contains(wanted)));
        let Some((adapter, name)) = chosen else {
            return Err(GpuError::NoAdapter(explain_no_adapter(options.adapter.as_deref(), &names)));
        };
        Self::open_adapter(&adapter, options).map_err(|source| GpuError::Device { adapter: name.clone(), source })
    }

    fn open_adapter(adapter: &wgpu::Adapter, options: &GpuOptions) -> Result<Self, wgpu::RequestDeviceError> {
        let selection = Selection::new(adapter, options);
        let (device, queue) = pollster::block_on(adapter.request_device(&selection.descriptor()))?;
        let ahead = CompileAhead::new(adapter.clone(), selection.clone());
        let mut gpu = Self::assemble(adapter.get_info(), device, queue, selection, options);
        gpu.compile_ahead = gpu.software.then_some(ahead);
        Ok(gpu)
    }

    /// Wraps a device that was opened with `selection`.
    pub(super) fn assemble(
        info: wgpu::AdapterInfo,
        device: wgpu::Device,
        queue: wgpu::Queue,
        selection: Selection,
        options: &GpuOptions,
    ) -> Self {
        let Selection { features, limits, wide_accumulator, timestamps, blend_format, fallbacks } = selection;
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let report = AdapterReport {
            adapter: info.name,
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            backend: format!("{:?}", info.backend),
            device_type: format!("{:?}", info.device_type),
            features: features.iter_names().map(|(name, _)| name.to_owned()).collect(),
            limits: vec![
                ("max_storage_buffer_binding_size".to_owned(), limits.max_storage_buffer_binding_size),
                ("max_buffer_size".to_owned(), limits.max_buffer_size),
                (
                    "max_compute_workgroups_per_dimension".to_owned(),
                    u64::from(limits.max_compute_workgroups_per_dimension),
                ),
                ("max_view_side_px".to_owned(), u64::from(limits.max_texture_dimension_2d)),
            ],
            fallbacks,
        };
        let available_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let binding_limit_bytes =
            options.binding_limit_bytes.map_or(available_bytes, |limit| limit.min(available_bytes));
        let failure = Arc::new(Mutex::new(None));
        let reported = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut first = reported.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert_with(|| error.to_string());
        }));
        Self {
            device,
            queue,
            wide_accumulator,
            timestamps,
            blend_format,
            software,
            binding_limit_bytes,
            readback_limit_bytes: options.binding_limit_bytes.unwrap_or(1 << 30).min(limits.max_buffer_size / 16 * 16),
            failure,
            report,
            pool: Mutex::default(),
            counters: Counters::default(),
            compile_ahead: None,
            max_workgroups: limits.max_compute_workgroups_per_dimension,
            tables: Vec::new(),
        }
    }

    /// Report on the adapter.
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// Limits of the adapter for plans.
    pub fn limits(&self) -> Limits {
        Limits {
            max_binding_bytes: self.max_binding_bytes(),
            max_view_side_px: self.max_view_side_px(),
            wide_sums: self.wide_accumulator,
            blend_texel_bytes: u64::from(self.blend_format.block_copy_size(None).unwrap_or(16)),
        }
    }

    /// Largest side of a view in pixels.
    pub fn max_view_side_px(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }

    /// Largest number of workgroups of a dispatch along an axis.
    pub(crate) fn max_workgroups(&self) -> u32 {
        self.max_workgroups
    }

    /// Largest size of a buffer binding, bytes.
    pub(crate) fn max_binding_bytes(&self) -> u64 {
        self.binding_limit_bytes
    }

    /// Largest size of a host-visible buffer, bytes.
    pub(crate) fn max_readback_bytes(&self) -> u64 {
        self.readback_limit_bytes
    }

    /// Returns the first error that the driver reported since the last call, if any.
    pub fn take_failure(&self) -> Result<(), GpuError> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(message) => Err(GpuError::Refused(message)),
            None => Ok(()),
        }
    }

    /// Waits for a submission; `None`: for all of them.
    ///
    /// # Errors
    ///
    /// The device is lost, or takes longer than [`SUBMISSION_TIMEOUT`].
    pub(crate) fn wait(&self, submission_index: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        self.wait_at_most(submission_index, SUBMISSION_TIMEOUT)
    }

    /// Waits like [`Gpu::wait`], for at most `timeout`.
    pub fn wait_at_most(
        &self,
        submission_index: Option<wgpu::SubmissionIndex>,
        timeout: Duration,
    ) -> Result<(), GpuError> {
        self.poll(submission_index, timeout)?.map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// Waits for a submission for at most `timeout`. Returns whether it is complete.
    ///
    /// # Errors
    ///
    /// The device is lost.
    pub(crate) fn done_within(&self, submission: wgpu::SubmissionIndex, timeout: Duration) -> Result<bool, GpuError> {
        match self.poll(Some(submission), timeout)? {
            Ok(()) => Ok(true),
            Err(wgpu::PollError::Timeout) => Ok(false),
            Err(error) => Err(GpuError::Lost(error.to_string())),
        }
    }

    fn poll(
        &self,
        submission_index: Option<wgpu::SubmissionIndex>,
        timeout: Duration,
    ) -> Result<Result<(), wgpu::PollError>, GpuError> {
        let wait = wgpu::PollType::Wait { submission_index, timeout: Some(timeout) };
        // wgpu panics if the driver has lost its device. Nothing shared with that code is used after the error.
        let polled = panic::catch_unwind(AssertUnwindSafe(|| self.device.poll(wait)));
        polled.map(|polled| polled.map(drop)).map_err(|_| GpuError::Lost("the driver stopped".to_owned()))
    }
}

fn explain_no_adapter(wanted: Option<&str>, found: &[String]) -> String {
    let install = "install a Vulkan driver: the vendor's driver for a GPU, otherwise the software driver \
                   (Debian and Ubuntu: apt install libvulkan1 mesa-vulkan-drivers)";
    match (wanted, found) {
        (Some(wanted), [_, ..]) => {
            format!("no adapter has `{wanted}` in its name; found: {}", found.join(", "))
        }
        (Some(wanted), []) => format!("no Vulkan adapter found (requested: `{wanted}`); {install}"),
        (None, _) => format!("no Vulkan adapter found; {install}"),
    }
}
