//! Compiles the shaders of a software driver on several threads.
//!
//! A software driver compiles a compute shader when it first runs, on the thread of the queue, one shader after another, and stores the machine code
//! in a cache on disk. Therefore each shader is dispatched once with zero workgroups, on extra devices, one per thread. The device that draws frames
//! then loads the machine code from the cache. Shaders that the cache already has are skipped (`gpu/driver_cache.rs`). If the driver has no such
//! cache, nothing is compiled in advance.

use std::{
    mem,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use rayon::prelude::*;
use wgpu::naga;

use super::{ShaderSource, adapter::Selection, driver_cache::DriverCache};

/// Size of every buffer, bytes; larger if a structure of the shader needs it.
const LEAST_BUFFER_BYTES: u64 = 1 << 16;

/// A binding of a compute shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Binding {
    group: u32,
    binding: u32,
    kind: BindingKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BindingKind {
    /// A buffer with its usage and size.
    Buffer {
        usage: wgpu::BufferUsages,
        bytes: u64,
    },
    /// A texture of one texel per layer. The driver's code for reading a texture does not depend on its format.
    Texture {
        format: wgpu::TextureFormat,
        dimension: wgpu::TextureViewDimension,
        usage: wgpu::TextureUsages,
    },
    Sampler,
}

/// Reason why a shader cannot be compiled in advance. The first frame compiles it instead.
#[derive(Debug, thiserror::Error)]
enum SkipReason {
    #[error("no second device: {0}")]
    Device(#[from] wgpu::RequestDeviceError),
    #[error("it cannot be read: {0}")]
    Parse(String),
    #[error("it has a binding that is neither a buffer, nor a flat texture, nor a sampler")]
    Binding,
    #[error("{0}")]
    Driver(String),
}

/// A shader with values for its overridable constants.
struct Shader {
    source: ShaderSource,
    constants: Vec<(String, f64)>,
}

/// Devices for compiling that no thread uses at the moment.
type Idle = Mutex<Vec<(wgpu::Device, wgpu::Queue)>>;

/// Treatment of the shaders of created pipelines.
#[derive(Default)]
enum Mode {
    /// The first frame compiles them.
    #[default]
    Nothing,
    /// The creating thread compiles them, on one of these devices.
    Compile(Arc<Idle>),
    /// They are collected, to be compiled later.
    Collect(Vec<Shader>),
}

/// Compiles for one adapter.
pub(super) struct CompileAhead {
    adapter: wgpu::Adapter,
    selection: Selection,
    driver_cache: DriverCache,
    mode: Mutex<Mode>,
}

/// Shaders that were collected, to be compiled on a thread that nothing waits for.
pub(crate) struct CollectedShaders {
    ahead: Arc<CompileAhead>,
    shaders: Vec<Shader>,
}

impl CollectedShaders {
    /// Compiles those that the driver's cache does not have, on the threads of rayon's current pool. A frame that needs one of them earlier compiles
    /// it itself.
    pub(crate) fn compile(&self) {
        let begin = Instant::now();
        let idle = Idle::default();
        self.shaders.par_iter().for_each(|Shader { source, constants }| {
            let constants: Vec<(&str, f64)> = constants.iter().map(|(name, value)| (name.as_str(), *value)).collect();
            self.ahead.compile_on(&idle, source, &constants);
        });
        tracing::debug!("compiled the shaders of a later scene in {:.1} s", begin.elapsed().as_secs_f64());
    }
}

impl CompileAhead {
    pub(super) fn new(adapter: wgpu::Adapter, selection: Selection, driver_cache: DriverCache) -> Self {
        Self { adapter, selection, driver_cache, mode: Mutex::default() }
    }

    fn mode(&self) -> MutexGuard<'_, Mode> {
        // No code panics while it holds the lock.
        self.mode.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs `make` and compiles the compute shaders of all pipelines that it creates.
    pub(super) fn during(&self, make: impl FnOnce()) {
        *self.mode() = Mode::Compile(Arc::default());
        make();
        *self.mode() = Mode::Nothing;
    }

    /// From now on, collects the shaders of created pipelines. Has no effect inside `during`.
    pub(super) fn collect(&self) {
        let mut mode = self.mode();
        if matches!(*mode, Mode::Nothing) {
            *mode = Mode::Collect(Vec::new());
        }
    }

    /// Returns the shaders that were collected, and ends the collection.
    pub(super) fn take_collected(self: &Arc<Self>) -> Option<CollectedShaders> {
        let mut mode = self.mode();
        let Mode::Collect(collected) = &mut *mode else { return None };
        let shaders = mem::take(collected);
        *mode = Mode::Nothing;
        (!shaders.is_empty()).then(|| CollectedShaders { ahead: Arc::clone(self), shaders })
    }

    /// Inside `during`, compiles a shader with values for its overridable constants, if the driver's cache does not have it; after `collect`,
    /// collects it.
    pub(super) fn compile(&self, source: &ShaderSource, constants: &[(&str, f64)]) {
        let idle = match &mut *self.mode() {
            Mode::Nothing => return,
            Mode::Collect(shaders) => {
                let constants = constants.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
                shaders.push(Shader { source: source.clone(), constants });
                return;
            }
            Mode::Compile(idle) => Arc::clone(idle),
        };
        self.compile_on(&idle, source, constants);
    }

    /// Compiles a shader on an idle device or a new one, unless the driver's cache has it.
    fn compile_on(&self, idle: &Idle, source: &ShaderSource, constants: &[(&str, f64)]) {
        // No code panics while it holds the lock.
        let devices = || idle.lock().unwrap_or_else(PoisonError::into_inner);
        let compiled = self.driver_cache.compile(source, constants, || {
            let device = devices().pop();
            let (device, queue) = device.map_or_else(|| self.open(), Ok)?;
            let begin = Instant::now();
            dispatch_nothing(&device, &queue, source, constants)?;
            tracing::debug!("compiled {} in {} ms", source.name, begin.elapsed().as_millis());
            devices().push((device, queue));
            Ok::<_, SkipReason>(())
        });
        // The first frame compiles the shader instead.
        if let Err(reason) = compiled {
            tracing::debug!("cannot compile {} in advance, so the first frame compiles it: {reason}", source.name);
        }
    }

    fn open(&self) -> Result<(wgpu::Device, wgpu::Queue), SkipReason> {
        Ok(pollster::block_on(self.adapter.request_device(&self.selection.descriptor()))?)
    }
}

/// Returns the bindings that an entry point uses. They are those in the layout that a pipeline derives from it.
fn bindings(source: &ShaderSource) -> Result<Vec<Binding>, SkipReason> {
    let module = naga::front::wgsl::parse_str(&source.text).map_err(|error| SkipReason::Parse(error.to_string()))?;
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::empty(), naga::valid::Capabilities::all());
    let info = validator.validate(&module).map_err(|error| SkipReason::Parse(error.to_string()))?;
    let entry = module.entry_points.iter().position(|entry| entry.name == source.entry_point);
    let entry = info.get_entry_point(entry.ok_or_else(|| SkipReason::Parse("the entry point is missing".to_owned()))?);
    let used = module.global_variables.iter().filter(|(handle, _)| !entry[*handle].is_empty());
    let bound = used.filter_map(|(_, variable)| variable.binding.map(|binding| (binding, variable)));
    bound
        .map(|(binding, variable)| {
            let inner = &module.types[variable.ty].inner;
            let bytes = || u64::from(inner.size(module.to_ctx())).max(LEAST_BUFFER_BYTES).next_multiple_of(16);
            let kind = match (variable.space, inner) {
                (naga::AddressSpace::Uniform, _) => {
                    BindingKind::Buffer { usage: wgpu::BufferUsages::UNIFORM, bytes: bytes() }
                }
                (naga::AddressSpace::Storage { .. }, _) => {
                    BindingKind::Buffer { usage: wgpu::BufferUsages::STORAGE, bytes: bytes() }
                }
                (_, naga::TypeInner::Image { dim: naga::ImageDimension::D2, arrayed, class }) => {
                    let (format, usage) = form_of(*class).ok_or(SkipReason::Binding)?;
                    let dimension =
                        if *arrayed { wgpu::TextureViewDimension::D2Array } else { wgpu::TextureViewDimension::D2 };
                    BindingKind::Texture { format, dimension, usage }
                }
                (_, naga::TypeInner::Sampler { comparison: false }) => BindingKind::Sampler,
                _ => return Err(SkipReason::Binding),
            };
            Ok(Binding { group: binding.group, binding: binding.binding, kind })
        })
        .collect()
}

/// Returns a format that a texture of this class may have, and its usage; `None` for textures with several samples.
fn form_of(class: naga::ImageClass) -> Option<(wgpu::TextureFormat, wgpu::TextureUsages)> {
    let format = match class {
        naga::ImageClass::Sampled { kind: naga::ScalarKind::Uint, multi: false } => wgpu::TextureFormat::Rgba32Uint,
        naga::ImageClass::Sampled { kind: naga::ScalarKind::Float, multi: false } => wgpu::TextureFormat::Rgba16Float,
        naga::ImageClass::Depth { multi: false } => wgpu::TextureFormat::Depth32Float,
        naga::ImageClass::Storage { format: naga::StorageFormat::Rgba16Float, .. } => {
            return Some((wgpu::TextureFormat::Rgba16Float, wgpu::TextureUsages::STORAGE_BINDING));
        }
        _ => return None,
    };
    Some((format, wgpu::TextureUsages::TEXTURE_BINDING))
}

/// Creates the pipeline on a device and dispatches zero workgroups, so that the driver compiles it.
fn dispatch_nothing(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    source: &ShaderSource,
    constants: &[(&str, f64)],
) -> Result<(), SkipReason> {
    let mut bindings = bindings(source)?;
    bindings.sort_by_key(|binding| (binding.group, binding.binding));
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let pipeline = super::pipelines::make_compute_pipeline(device, source, constants);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(source.name) });
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        for of_group in bindings.chunk_by(|a, b| a.group == b.group) {
            let resources: Vec<Resource> = of_group.iter().map(|binding| Resource::new(device, binding.kind)).collect();
            let entries: Vec<_> = of_group
                .iter()
                .zip(&resources)
                .map(|(binding, resource)| wgpu::BindGroupEntry {
                    binding: binding.binding,
                    resource: resource.as_binding(),
                })
                .collect();
            let group = of_group[0].group;
            let layout = pipeline.get_bind_group_layout(group);
            let descriptor = wgpu::BindGroupDescriptor { label: Some(source.name), layout: &layout, entries: &entries };
            pass.set_bind_group(group, &device.create_bind_group(&descriptor), &[]);
        }
        pass.dispatch_workgroups(0, 0, 0);
    }
    let submission_index = queue.submit([encoder.finish()]);
    if let Some(error) = pollster::block_on(scope.pop()) {
        return Err(SkipReason::Driver(error.to_string()));
    }
    let wait = wgpu::PollType::Wait { submission_index: Some(submission_index), timeout: None };
    device.poll(wait).map(|_| ()).map_err(|error| SkipReason::Driver(error.to_string()))
}

/// A resource for a binding.
enum Resource {
    Buffer(wgpu::Buffer),
    Texture(wgpu::TextureView),
    Sampler(wgpu::Sampler),
}

impl Resource {
    fn new(device: &wgpu::Device, kind: BindingKind) -> Self {
        match kind {
            BindingKind::Buffer { usage, bytes } => Self::Buffer(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("compile ahead"),
                size: bytes,
                usage,
                mapped_at_creation: false,
            })),
            BindingKind::Texture { format, dimension, usage } => {
                let texture = device.create_texture(&wgpu::TextureDescriptor {
                    label: Some("compile ahead"),
                    size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage,
                    view_formats: &[],
                });
                let descriptor = wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() };
                Self::Texture(texture.create_view(&descriptor))
            }
            BindingKind::Sampler => Self::Sampler(device.create_sampler(&wgpu::SamplerDescriptor::default())),
        }
    }

    fn as_binding(&self) -> wgpu::BindingResource<'_> {
        match self {
            Self::Buffer(buffer) => buffer.as_entire_binding(),
            Self::Texture(view) => wgpu::BindingResource::TextureView(view),
            Self::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "an unexpected error fails the test")]
mod tests {
    use super::*;
    use crate::gpu::{Gpu, GpuOptions};

    const DOUBLES: &str = "
        struct Parameters { factor: f32, unused: array<vec4<f32>, 8192> }
        @group(0) @binding(0) var<uniform> unread: vec4<f32>;
        @group(0) @binding(2) var<storage, read> parameters: Parameters;
        @group(2) @binding(1) var<storage, read_write> values: array<f32>;
        override WIDTH: u32;
        @compute @workgroup_size(WIDTH) fn double(@builtin(local_invocation_index) i: u32) {
            values[i] *= parameters.factor;
        }";

    fn source(text: &str) -> ShaderSource {
        ShaderSource { name: "double", entry_point: "double", text: text.to_owned(), needs_u64: false }
    }

    #[test]
    fn only_what_an_entry_point_uses_is_bound() {
        let usage = wgpu::BufferUsages::STORAGE;
        let binding = |group, binding, bytes| Binding { group, binding, kind: BindingKind::Buffer { usage, bytes } };
        let expected = [binding(0, 2, 16 * 8193), binding(2, 1, LEAST_BUFFER_BYTES)];
        assert_eq!(bindings(&source(DOUBLES)).unwrap(), expected);
    }

    #[test]
    fn a_valid_shader_is_compiled_and_an_invalid_one_is_skipped() {
        let gpu = Gpu::open(&GpuOptions::default()).unwrap();
        let Some(ahead) = &gpu.compile_ahead else { return };
        let (device, queue) = ahead.open().unwrap();
        dispatch_nothing(&device, &queue, &source(DOUBLES), &[("WIDTH", 8.0)]).unwrap();
        let textures = "@group(0) @binding(0) var table: texture_2d<u32>;
            @group(0) @binding(1) var<storage, read_write> values: array<f32>;
            @group(0) @binding(2) var layers: texture_2d_array<f32>;
            @group(0) @binding(3) var depth: texture_depth_2d;
            @group(0) @binding(4) var smooth_texels: sampler;
            @group(0) @binding(5) var written: texture_storage_2d<rgba16float, write>;
            @compute @workgroup_size(1) fn double() {
                textureStore(written, vec2(0), vec4(1.0));
                values[0] = f32(textureLoad(table, vec2(0), 0).x) + textureLoad(depth, vec2(0), 0);
                values[1] = textureSampleLevel(layers, smooth_texels, vec2(0.5), 0, 0.0).x;
            }";
        dispatch_nothing(&device, &queue, &source(textures), &[]).unwrap();
        let volume = "@group(0) @binding(0) var picture: texture_3d<f32>;
            @group(0) @binding(1) var<storage, read_write> values: array<f32>;
            @compute @workgroup_size(1) fn double() { values[0] = textureLoad(picture, vec3(0), 0).x; }";
        let wrong = [
            (source(volume), "nor a flat texture"),
            (source("fn double() {"), "cannot be read"),
            (source("@compute @workgroup_size(1) fn other() {}"), "entry point"),
        ];
        for (source, words) in wrong {
            let reason = dispatch_nothing(&device, &queue, &source, &[]).unwrap_err().to_string();
            assert!(reason.contains(words), "{reason}");
        }
        let reason = dispatch_nothing(&device, &queue, &source(DOUBLES), &[("NO_SUCH", 1.0)]).unwrap_err();
        assert!(matches!(reason, SkipReason::Driver(_)), "{reason}");
    }
}
