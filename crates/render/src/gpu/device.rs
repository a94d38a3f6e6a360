//! Finding an adapter and opening it: what it offers, which fallbacks are taken, and what to do where there is none.

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
    /// Part of the adapter's name, in any case; `None`: the fastest kind there is.
    pub adapter: Option<String>,
    /// Sum in 32-bit words even where the adapter has 64-bit atomics, to test that path.
    pub force_u32_accumulator: bool,
    /// Blend in halves even where the adapter blends 32-bit floats, to test that path.
    pub force_half_blending: bool,
    /// Bind at most this many bytes of stars or pixels at once, though the adapter may allow more, to test strips, batches
    /// and segments on small images.
    pub binding_limit_bytes: Option<u64>,
}

/// Why no adapter could be opened, or why it failed later.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// There is none, or none of that name.
    #[error("{0}")]
    NoAdapter(String),
    /// The driver refused the device.
    #[error("adapter `{adapter}`: cannot open the device: {source}")]
    Device {
        /// Its name.
        adapter: String,
        /// What the driver said.
        source: wgpu::RequestDeviceError,
    },
    /// A device that somebody else makes cannot be made or used.
    #[error("cannot use the device of the headset's runtime: {0}")]
    Adopt(String),
    /// The device does not answer any more.
    #[error("the device was lost: {0}")]
    Lost(String),
    /// The driver refused a command, or had no memory left.
    #[error("the device refused the frame: {0}")]
    Refused(String),
    /// Results could not be read back.
    #[error("cannot read results back from the device: {0}")]
    Readback(#[from] wgpu::MapRangeError),
}

/// What `steradian info` tells about the adapter in use.
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
    /// Limits that matter, with their values.
    pub limits: Vec<(String, u64)>,
    /// What is done differently because a feature is missing.
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

/// What of an adapter is used, and what is done differently because it lacks something.
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
    pub(super) fn of(adapter: &wgpu::Adapter, options: &GpuOptions) -> Self {
        let offered = adapter.features();
        let u64_features = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS;
        let mut features = wgpu::Features::empty();
        let mut fallbacks = Vec::new();
        let wide_accumulator = offered.contains(u64_features) && !options.force_u32_accumulator;
        if wide_accumulator {
            features |= u64_features;
        } else if options.force_u32_accumulator {
            fallbacks.push("sums in 32-bit words with carries (asked for)".to_owned());
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
            let why = if options.force_half_blending { "asked for" } else { "no blending of 32-bit floats" };
            fallbacks.push(format!("methods that blend add up in 16-bit floats, which end at 65504 cd/m^2 ({why})"));
            wgpu::TextureFormat::Rgba16Float
        };

        // Only the limits that decide how much fits at once are raised over the defaults.
        let available = adapter.limits();
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            max_buffer_size: available.max_buffer_size,
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            // The resolve pass binds nine, the pass over pixels of `sky_cube` thirteen.
            max_storage_buffers_per_shader_stage: available.max_storage_buffers_per_shader_stage,
            ..Default::default()
        };
        let limits = limits.or_worse_values_from(&available);
        Self { features, limits, wide_accumulator, timestamps, blend_format, fallbacks }
    }

    /// How the device is asked for.
    pub(super) fn descriptor(&self) -> wgpu::DeviceDescriptor<'static> {
        wgpu::DeviceDescriptor {
            label: Some("steradian"),
            required_features: self.features,
            required_limits: self.limits.clone(),
            ..Default::default()
        }
    }
}

/// How long a device may take for what was submitted before it counts as lost.
pub(crate) const SUBMISSION_TIMEOUT: Duration = Duration::from_secs(600);

/// An open device.
pub struct Gpu {
    /// The device of the adapter.
    pub device: wgpu::Device,
    /// Queue of the device.
    pub queue: wgpu::Queue,
    /// Whether sums use 64-bit words.
    pub wide_accumulator: bool,
    /// Whether passes are timed by the device.
    pub timestamps: bool,
    /// Format of the targets that blend.
    pub blend_format: wgpu::TextureFormat,
    /// Whether the adapter is a software driver.
    pub software: bool,
    binding_limit_bytes: u64,
    readback_limit_bytes: u64,
    /// The first error that the driver reported and nobody has seen yet.
    failure: Arc<Mutex<Option<String>>>,
    report: AdapterReport,
    pub(super) pool: Mutex<FramePool>,
    pub(super) counters: Counters,
    /// Software drivers alone have it, where the device was opened here.
    pub(super) compile_ahead: Option<CompileAhead>,
    /// Workgroups of a dispatch along each axis, at most.
    pub(super) max_workgroups: u32,
    /// What passes bind beside their own buffers: see [`Gpu::bind_tables`].
    pub(super) tables: Vec<wgpu::Buffer>,
}

impl Gpu {
    /// Opens an adapter. Discrete GPUs are preferred to integrated ones, those to software.
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
        let selection = Selection::of(adapter, options);
        let (device, queue) = pollster::block_on(adapter.request_device(&selection.descriptor()))?;
        let ahead = CompileAhead::new(adapter.clone(), selection.clone());
        let mut gpu = Self::assemble(adapter.get_info(), device, queue, selection, options);
        gpu.compile_ahead = gpu.software.then_some(ahead);
        Ok(gpu)
    }

    /// A device that was opened with what `selection` describes.
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

    /// What was opened.
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// What plans may ask of the adapter.
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

    /// Most workgroups along an axis of a dispatch.
    pub fn max_workgroups(&self) -> u32 {
        self.max_workgroups
    }

    /// Bytes that one buffer binding may have.
    pub fn max_binding_bytes(&self) -> u64 {
        self.binding_limit_bytes
    }

    /// Bytes that one host-visible buffer may have.
    pub fn max_readback_bytes(&self) -> u64 {
        self.readback_limit_bytes
    }

    /// The error that the driver has reported since the last call, if any.
    pub fn take_failure(&self) -> Result<(), GpuError> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(message) => Err(GpuError::Refused(message)),
            None => Ok(()),
        }
    }

    /// Waits for a submission; `None`: for all there are.
    ///
    /// # Errors
    ///
    /// The device is lost, or takes longer than any frame does.
    pub fn wait(&self, submission_index: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        self.wait_at_most(submission_index, SUBMISSION_TIMEOUT)
    }

    /// The same for at most `timeout`.
    pub fn wait_at_most(
        &self,
        submission_index: Option<wgpu::SubmissionIndex>,
        timeout: Duration,
    ) -> Result<(), GpuError> {
        self.poll(submission_index, timeout)?.map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// Waits for a submission for at most `timeout`; whether the device is through with it.
    ///
    /// # Errors
    ///
    /// The device is lost.
    pub fn done_within(&self, submission: wgpu::SubmissionIndex, timeout: Duration) -> Result<bool, GpuError> {
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
        // A driver that has lost its device is a panic in there. Of what is shared with it nothing is used after an error.
        let polled = panic::catch_unwind(AssertUnwindSafe(|| self.device.poll(wait)));
        polled.map(|polled| polled.map(drop)).map_err(|_| GpuError::Lost("the driver has given it up".to_owned()))
    }
}

fn explain_no_adapter(wanted: Option<&str>, found: &[String]) -> String {
    let install = "install a Vulkan driver: for a GPU its vendor's, without one the software driver \
                   (Debian and Ubuntu: apt install libvulkan1 mesa-vulkan-drivers)";
    match (wanted, found) {
        (Some(wanted), [_, ..]) => {
            format!("no adapter's name contains `{wanted}`; found: {}", found.join(", "))
        }
        (Some(wanted), []) => format!("no Vulkan adapter found (asked for `{wanted}`); {install}"),
        (None, _) => format!("no Vulkan adapter found; {install}"),
    }
}
