//! Chooses and opens an adapter, and waits for its work.

use std::{
    panic::{self, AssertUnwindSafe},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use super::{
    Tables,
    adapter::{
        AdapterReport, FAINT_MAP_FROM, FUSED_DISPLAY_FROM, GpuOptions, Need, Selection, Skipped, TABLES_FROM,
        explain_no_adapter, unusable,
    },
    compile_ahead::CompileAhead,
    driver_cache::DriverCache,
    frame_pool::{Counters, FramePool},
};
use crate::{plan::Limits, platform::BACKENDS};

/// Why an adapter could not be opened or failed later.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter, or none with the given name, was found.
    #[error("{0}")]
    NoAdapter(String),
    /// The adapter with the given name lacks something that all passes need; without a name, every adapter does.
    #[error("{}", unusable(.0))]
    Unusable(Vec<Skipped>),
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
    /// Storage buffers that a stage may bind.
    storage_buffers: u32,
    /// The first error of the driver since the last [`Gpu::take_failure`].
    failure: Arc<Mutex<Option<String>>>,
    report: AdapterReport,
    needs: Vec<Need>,
    options: GpuOptions,
    pub(super) pool: Mutex<FramePool>,
    pub(super) counters: Arc<Counters>,
    /// Set for software drivers that keep compiled shaders on disk, if this module opened the device.
    pub(super) compile_ahead: Option<Arc<CompileAhead>>,
    /// Largest number of workgroups of a dispatch along an axis.
    pub(super) max_workgroups: u32,
    /// Tables that passes bind in addition to their own buffers: see [`Gpu::bind_tables`].
    pub(super) tables: Tables,
}

impl Gpu {
    /// Opens an adapter. Prefers discrete GPUs to integrated ones, and integrated GPUs to software drivers. Adapters that lack something that all
    /// passes need are skipped.
    ///
    /// # Errors
    ///
    /// No adapter can be used.
    pub fn open(options: &GpuOptions) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = BACKENDS;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Cpu => 3,
            wgpu::DeviceType::Other => 4,
        });
        let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        let wanted = options.adapter.as_deref().map(str::to_lowercase);
        let mut skipped = Vec::new();
        let mut refused = None;
        for (adapter, name) in adapters.into_iter().zip(&names) {
            if wanted.as_ref().is_some_and(|wanted| !name.to_lowercase().contains(wanted)) {
                continue;
            }
            let selection = match Selection::new(&adapter, options) {
                Ok(selection) => selection,
                Err(lacks) => {
                    skipped.push(Skipped { adapter: name.clone(), lacks });
                    continue;
                }
            };
            match Self::open_adapter(&adapter, selection, options) {
                Ok(gpu) => {
                    let others = skipped.iter().map(Skipped::to_string).chain(refused.iter().map(ToString::to_string));
                    others.for_each(|other: String| tracing::warn!("not used: {other}"));
                    return Ok(gpu);
                }
                Err(source) => {
                    refused.get_or_insert(GpuError::Device { adapter: name.clone(), source });
                }
            }
        }
        Err(match refused {
            Some(refused) => refused,
            None if skipped.is_empty() => GpuError::NoAdapter(explain_no_adapter(options.adapter.as_deref(), &names)),
            None => GpuError::Unusable(skipped),
        })
    }

    fn open_adapter(
        adapter: &wgpu::Adapter,
        selection: Selection,
        options: &GpuOptions,
    ) -> Result<Self, wgpu::RequestDeviceError> {
        let (device, queue) = pollster::block_on(adapter.request_device(&selection.descriptor()))?;
        let mut gpu = Self::assemble(adapter.get_info(), device, queue, selection.clone(), options);
        if gpu.software
            && let Some(driver_cache) = DriverCache::of_driver(&gpu.report.driver)
        {
            gpu.compile_ahead = Some(Arc::new(CompileAhead::new(adapter.clone(), selection, driver_cache)));
        }
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
        let Selection { features, limits, needs, wide_accumulator, timestamps, blend_format, fallbacks, .. } =
            selection;
        let options = GpuOptions { adapter: Some(info.name.clone()), ..options.clone() };
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let report = AdapterReport {
            adapter: info.name,
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            backend: format!("{:?}", info.backend),
            device_type: format!("{:?}", info.device_type),
            features: features.iter_names().map(|(name, _)| name.to_owned()).collect(),
            limits: vec![
                (
                    "max_storage_buffers_per_shader_stage".to_owned(),
                    u64::from(limits.max_storage_buffers_per_shader_stage),
                ),
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
            storage_buffers: limits.max_storage_buffers_per_shader_stage,
            readback_limit_bytes: options.binding_limit_bytes.unwrap_or(1 << 30).min(limits.max_buffer_size / 16 * 16),
            failure,
            report,
            needs,
            options,
            pool: Mutex::default(),
            counters: Arc::default(),
            compile_ahead: None,
            max_workgroups: limits.max_compute_workgroups_per_dimension,
            tables: Tables::None,
        }
    }

    /// Returns the report on the adapter.
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// Returns the needs of all passes, each with the limit of the adapter.
    pub fn needs(&self) -> &[Need] {
        &self.needs
    }

    /// Returns the options that open the same adapter in the same way.
    pub fn options(&self) -> &GpuOptions {
        &self.options
    }

    /// Returns the maximum size of tables in a storage buffer, bytes; 0 if tables are in a texture.
    pub(crate) fn table_buffer_bytes(&self) -> u64 {
        if self.storage_buffers >= TABLES_FROM { self.max_binding_bytes() } else { 0 }
    }

    /// Limits of the adapter for plans.
    pub fn limits(&self) -> Limits {
        Limits {
            fuses_display: self.storage_buffers >= FUSED_DISPLAY_FROM,
            reads_faint_map: self.storage_buffers >= FAINT_MAP_FROM,
            max_binding_bytes: self.max_binding_bytes(),
            max_view_side_px: self.max_view_side_px(),
            wide_sums: self.wide_accumulator,
            blend_texel_bytes: u64::from(self.blend_format.block_copy_size(None).unwrap_or(16)),
        }
    }

    /// Returns the largest side of a view in pixels.
    pub fn max_view_side_px(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }

    /// Returns the largest number of workgroups of a dispatch along an axis.
    pub(crate) fn max_workgroups(&self) -> u32 {
        self.max_workgroups
    }

    /// Returns the largest size of a buffer binding, bytes.
    pub(crate) fn max_binding_bytes(&self) -> u64 {
        self.binding_limit_bytes
    }

    /// Returns the largest size of a host-visible buffer, bytes.
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
