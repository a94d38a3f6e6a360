//! Judges an adapter: compares its limits with the needs of all passes, and chooses replacements for missing features.

use std::{fmt, ops::Range, str::FromStr};

use serde::Serialize;

/// Minimum number of storage buffers per stage for the resolve pass to read a map of faint light.
pub(super) const FAINT_MAP_FROM: u32 = 9;
/// Minimum number of storage buffers per stage for the resolve pass to write the display image in addition.
pub(super) const FUSED_DISPLAY_FROM: u32 = 10;
/// Minimum number of storage buffers per stage for all passes to bind a buffer of projection tables in addition.
pub(super) const TABLES_FROM: u32 = 11;
/// Smallest binding size, in bytes, at which pictures and stars are still divided into parts of a useful size.
const LEAST_BINDING_BYTES: u64 = 16 << 20;

/// Options for the selection and use of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// Part of the adapter's name, case-insensitive; `None`: the fastest kind of adapter.
    pub adapter: Option<String>,
    /// Sums in 32-bit words even if the adapter has 64-bit atomics, to test that path.
    pub force_u32_accumulator: bool,
    /// Blends 16-bit floats even if the adapter blends 32-bit floats, to test that path.
    pub force_half_blending: bool,
    /// Measures no GPU times even if the adapter has timestamps, to test that path.
    pub force_no_timestamps: bool,
    /// Uses at most this many storage buffers per shader stage, to test adapters that offer fewer.
    pub storage_buffers: Option<u32>,
    /// Uses no more than the default limits of WebGPU, which every adapter of that standard offers.
    pub default_limits: bool,
    /// Binds at most this many bytes of stars or pixels at once, even if the adapter supports more. Tests use it to check strips, batches and
    /// segments on small images.
    pub binding_limit_bytes: Option<u64>,
}

/// A restriction that is unknown or has an invalid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a restriction of an adapter: valid restrictions are webgpu, no-64-bit-atomics, no-float-blending, no-timestamps, storage-buffers=N and binding-mib=N, separated by commas"
)]
pub struct RestrictionError(String);

impl GpuOptions {
    /// Adds restrictions of the adapter, for tests: a comma-separated list of `webgpu` (the default limits of WebGPU, without the optional features),
    /// `no-64-bit-atomics`, `no-float-blending`, `no-timestamps`, `storage-buffers=N` and `binding-mib=N`.
    ///
    /// # Errors
    ///
    /// An entry is unknown, or its number is not valid.
    pub fn restricted(mut self, restrictions: &str) -> Result<Self, RestrictionError> {
        for entry in restrictions.split(',').map(str::trim) {
            let invalid = || RestrictionError(entry.to_owned());
            let (name, value) = entry.split_once('=').map_or((entry, None), |(name, value)| (name, Some(value)));
            match (name, value) {
                ("webgpu", None) => {
                    self.default_limits = true;
                    self.force_u32_accumulator = true;
                    self.force_half_blending = true;
                    self.force_no_timestamps = true;
                }
                ("no-64-bit-atomics", None) => self.force_u32_accumulator = true,
                ("no-float-blending", None) => self.force_half_blending = true,
                ("no-timestamps", None) => self.force_no_timestamps = true,
                ("storage-buffers", Some(number)) => self.storage_buffers = Some(positive(number).ok_or_else(invalid)?),
                ("binding-mib", Some(number)) => {
                    let mib: u32 = positive(number).ok_or_else(invalid)?;
                    self.binding_limit_bytes = Some(u64::from(mib) << 20);
                }
                _ => return Err(invalid()),
            }
        }
        Ok(self)
    }

    /// Returns the restrictions in the format of [`Self::restricted`], with bindings in whole MiB; empty if there are none.
    pub fn restrictions(&self) -> String {
        // `webgpu` implies some of the others, so it comes first.
        let flags = [
            (self.default_limits, "webgpu"),
            (self.force_u32_accumulator, "no-64-bit-atomics"),
            (self.force_half_blending, "no-float-blending"),
            (self.force_no_timestamps, "no-timestamps"),
        ];
        let flags = flags.into_iter().filter(|(is_set, _)| *is_set).map(|(_, name)| name.to_owned());
        let buffers = self.storage_buffers.map(|number| format!("storage-buffers={number}"));
        let binding = self.binding_limit_bytes.map(|bytes| format!("binding-mib={}", (bytes >> 20).max(1)));
        flags.chain(buffers).chain(binding).collect::<Vec<_>>().join(",")
    }
}

fn positive(text: &str) -> Option<u32> {
    u32::from_str(text).ok().filter(|number| *number > 0)
}

/// A limit that all passes require of an adapter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Need {
    /// Name of the limit.
    pub name: &'static str,
    /// Required value.
    pub needed: u64,
    /// Value that the adapter offers.
    pub offered: u64,
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}: at least {} needed", self.offered, self.name, self.needed)
    }
}

/// An adapter that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// Its name.
    pub adapter: String,
    /// The requirements that it does not meet.
    pub lacks: Vec<Need>,
}

impl fmt::Display for Skipped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lacks: Vec<String> = self.lacks.iter().map(Need::to_string).collect();
        write!(f, "adapter `{}` offers too little: {}", self.adapter, lacks.join("; "))
    }
}

/// Lists the adapters that cannot be used, with the reasons, as an error text.
pub(super) fn unusable(skipped: &[Skipped]) -> String {
    let skipped: Vec<String> = skipped.iter().map(Skipped::to_string).collect();
    skipped.join("; ")
}

/// Lists the requirements of all passes, each with the limit that the adapter offers. The table in `docs/adapters.md` lists the use of every shader.
fn needs(offered: &wgpu::Limits) -> Vec<Need> {
    let least = wgpu::Limits::default();
    let need = |name, needed: u32, offered: u32| Need { name, needed: u64::from(needed), offered: u64::from(offered) };
    vec![
        need(
            "storage buffers per stage",
            least.max_storage_buffers_per_shader_stage,
            offered.max_storage_buffers_per_shader_stage,
        ),
        Need {
            name: "bytes per storage binding",
            needed: LEAST_BINDING_BYTES,
            offered: offered.max_storage_buffer_binding_size,
        },
        need(
            "uniform buffers per stage",
            least.max_uniform_buffers_per_shader_stage,
            offered.max_uniform_buffers_per_shader_stage,
        ),
        Need {
            name: "bytes per uniform binding",
            needed: least.max_uniform_buffer_binding_size,
            offered: offered.max_uniform_buffer_binding_size,
        },
        need("bind groups", least.max_bind_groups, offered.max_bind_groups),
        need(
            "textures per stage",
            least.max_sampled_textures_per_shader_stage,
            offered.max_sampled_textures_per_shader_stage,
        ),
        need("pixels along a texture", least.max_texture_dimension_2d, offered.max_texture_dimension_2d),
        need(
            "bytes of workgroup memory",
            least.max_compute_workgroup_storage_size,
            offered.max_compute_workgroup_storage_size,
        ),
        need(
            "invocations per workgroup",
            least.max_compute_invocations_per_workgroup,
            offered.max_compute_invocations_per_workgroup,
        ),
    ]
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

/// Sizes of the memory blocks in which a software driver allocates buffers and textures; a larger resource has a separate block. A block is freed
/// when nothing in it is used. With blocks of 128 MiB, wgpu's default, small buffers of later frames would keep the main memory of removed scenes
/// allocated.
const SOFTWARE_BLOCK_BYTES: Range<u64> = 4 << 20..16 << 20;

/// The features and limits of an adapter that are used, and the fallbacks for missing ones.
#[derive(Clone)]
pub(super) struct Selection {
    pub(super) features: wgpu::Features,
    pub(super) limits: wgpu::Limits,
    pub(super) needs: Vec<Need>,
    pub(super) wide_accumulator: bool,
    pub(super) timestamps: bool,
    pub(super) blend_format: wgpu::TextureFormat,
    pub(super) fallbacks: Vec<String>,
    memory_hints: wgpu::MemoryHints,
}

impl Selection {
    /// Checks an adapter, and selects the features and limits to use.
    ///
    /// # Errors
    ///
    /// The adapter lacks something that all passes need. The error lists the unmet requirements.
    pub(super) fn new(adapter: &wgpu::Adapter, options: &GpuOptions) -> Result<Self, Vec<Need>> {
        let limits = used_limits(&adapter.limits(), options);
        let needs = needs(&limits);
        let lacks: Vec<Need> = needs.iter().filter(|need| need.offered < need.needed).cloned().collect();
        if !lacks.is_empty() {
            return Err(lacks);
        }
        let offered = adapter.features();
        let mut features = wgpu::Features::empty();
        let mut fallbacks = Vec::new();
        let reason = |forced: bool, lack: &'static str| if forced { "requested" } else { lack };

        let u64_features = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS;
        let wide_accumulator = offered.contains(u64_features) && !options.force_u32_accumulator;
        if wide_accumulator {
            features |= u64_features;
        } else {
            let reason = reason(options.force_u32_accumulator, "no 64-bit atomics");
            fallbacks.push(format!("sums in 32-bit words with carries ({reason})"));
        }

        let timestamps = offered.contains(wgpu::Features::TIMESTAMP_QUERY) && !options.force_no_timestamps;
        if timestamps {
            features |= wgpu::Features::TIMESTAMP_QUERY;
        } else {
            let reason = reason(options.force_no_timestamps, "no timestamps");
            fallbacks.push(format!("GPU times are not measured ({reason})"));
        }

        let blends_floats = offered.contains(wgpu::Features::FLOAT32_BLENDABLE) && !options.force_half_blending;
        let blend_format = if blends_floats {
            features |= wgpu::Features::FLOAT32_BLENDABLE;
            wgpu::TextureFormat::Rgba32Float
        } else {
            let reason = reason(options.force_half_blending, "no blending of 32-bit floats");
            fallbacks.push(format!("blending methods sum in 16-bit floats, up to 65504 cd/m^2 ({reason})"));
            wgpu::TextureFormat::Rgba16Float
        };

        let buffers = limits.max_storage_buffers_per_shader_stage;
        let by_buffers = [
            (TABLES_FROM, "projection tables in a texture"),
            (FUSED_DISPLAY_FROM, "a separate pass for display images"),
            (FAINT_MAP_FROM, "faint stars drawn one by one, without a map"),
        ];
        let replaced = by_buffers.iter().filter(|(from, _)| buffers < *from);
        fallbacks.extend(replaced.map(|(_, instead)| format!("{instead} ({buffers} storage buffers per stage)")));
        let memory_hints = match adapter.get_info().device_type {
            wgpu::DeviceType::Cpu => {
                wgpu::MemoryHints::Manual { suballocated_device_memory_block_size: SOFTWARE_BLOCK_BYTES }
            }
            _ => wgpu::MemoryHints::Performance,
        };
        Ok(Self { features, limits, needs, wide_accumulator, timestamps, blend_format, fallbacks, memory_hints })
    }

    /// Returns the descriptor for the device request.
    pub(super) fn descriptor(&self) -> wgpu::DeviceDescriptor<'static> {
        wgpu::DeviceDescriptor {
            label: Some("steradian"),
            required_features: self.features,
            required_limits: self.limits.clone(),
            memory_hints: self.memory_hints.clone(),
            ..Default::default()
        }
    }
}

/// Limits for the device. Only those that determine the size of a batch and the number of bindings are raised above the defaults of WebGPU.
fn used_limits(available: &wgpu::Limits, options: &GpuOptions) -> wgpu::Limits {
    let mut limits = wgpu::Limits::default();
    if !options.default_limits {
        limits.max_storage_buffer_binding_size = available.max_storage_buffer_binding_size;
        limits.max_buffer_size = available.max_buffer_size;
        limits.max_texture_dimension_2d = available.max_texture_dimension_2d;
        limits.max_storage_buffers_per_shader_stage = available.max_storage_buffers_per_shader_stage;
    }
    if let Some(most) = options.storage_buffers {
        limits.max_storage_buffers_per_shader_stage = limits.max_storage_buffers_per_shader_stage.min(most);
    }
    limits.or_worse_values_from(available)
}

pub(super) fn explain_no_adapter(wanted: Option<&str>, found: &[String]) -> String {
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "an unexpected error fails the test")]
mod tests {
    use super::*;

    #[test]
    fn restrictions_are_read_or_refused_by_name() {
        let read = |text: &str| GpuOptions::default().restricted(text);
        let webgpu = read("webgpu").unwrap();
        assert!(webgpu.default_limits && webgpu.force_u32_accumulator && webgpu.force_half_blending);
        assert!(webgpu.force_no_timestamps);
        let small = read("storage-buffers=4, binding-mib=64").unwrap();
        assert_eq!((small.storage_buffers, small.binding_limit_bytes), (Some(4), Some(64 << 20)));
        for text in ["", "webgpu=1", "storage-buffers", "storage-buffers=0", "binding-mib=-1", "no-timestamps,fast"] {
            let error = read(text).unwrap_err().to_string();
            let entry = text.rsplit(',').next().unwrap();
            assert!(error.starts_with(&format!("`{entry}` is not a restriction")), "{error}");
        }
    }

    #[test]
    fn restrictions_are_written_as_they_are_read() {
        assert_eq!(GpuOptions::default().restrictions(), "");
        for text in
            ["webgpu", "no-64-bit-atomics", "no-float-blending,no-timestamps", "storage-buffers=4,binding-mib=64"]
        {
            let options = GpuOptions::default().restricted(text).unwrap();
            let again = GpuOptions::default().restricted(&options.restrictions()).unwrap();
            assert_eq!(format!("{again:?}"), format!("{options:?}"), "{text}");
        }
    }

    #[test]
    fn an_adapter_with_too_little_is_named_with_what_it_lacks() {
        let available = wgpu::Limits::default();
        let lacks = |options: &GpuOptions, available: &wgpu::Limits| -> Vec<String> {
            let needs = needs(&used_limits(available, options));
            needs.iter().filter(|need| need.offered < need.needed).map(Need::to_string).collect()
        };
        let none: [&str; 0] = [];
        assert_eq!(lacks(&GpuOptions::default(), &available), none);
        let four = GpuOptions { storage_buffers: Some(4), ..GpuOptions::default() };
        assert_eq!(lacks(&four, &available), ["4 storage buffers per stage: at least 8 needed"]);
        let small = wgpu::Limits { max_compute_workgroup_storage_size: 8192, max_bind_groups: 2, ..available };
        assert_eq!(
            lacks(&GpuOptions::default(), &small),
            ["2 bind groups: at least 4 needed", "8192 bytes of workgroup memory: at least 16384 needed"]
        );
    }

    #[test]
    fn more_than_the_defaults_is_used_only_if_offered_and_allowed() {
        let available = wgpu::Limits { max_storage_buffers_per_shader_stage: 64, ..wgpu::Limits::default() };
        let used = |options: &GpuOptions| used_limits(&available, options).max_storage_buffers_per_shader_stage;
        assert_eq!(used(&GpuOptions::default()), 64);
        assert_eq!(used(&GpuOptions { default_limits: true, ..GpuOptions::default() }), 8);
        assert_eq!(used(&GpuOptions { storage_buffers: Some(9), ..GpuOptions::default() }), 9);
    }
}
