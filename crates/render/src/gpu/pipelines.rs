//! Creates and counts pipelines, and caches variants that depend on settings.
//!
//! Creation takes milliseconds to seconds: the driver compiles the shader then, or (software drivers) when it first runs. Several threads may
//! create pipelines at the same time.

use std::{
    borrow::Cow,
    sync::{Arc, Mutex, OnceLock, PoisonError, atomic::Ordering},
    time::Instant,
};

use super::{
    Gpu, ShaderSource,
    compile_ahead::{CollectedShaders, CompileAhead},
    frame_pool::Counters,
};

/// Pipelines of one pass, keyed by the settings that are compiled into them. The first request for a pipeline creates it; requests of other threads
/// for the same one wait.
pub(crate) struct Variants<K, P> {
    made: Mutex<Vec<(K, Arc<OnceLock<P>>)>>,
}

impl<K: PartialEq, P: Clone> Variants<K, P> {
    pub(crate) fn new() -> Self {
        Self { made: Mutex::new(Vec::new()) }
    }

    /// Returns a handle of the pipeline for `key`. The first call creates it with `make`.
    pub(crate) fn get(&self, key: K, make: impl FnOnce() -> P) -> P {
        self.cell(key).get_or_init(make).clone()
    }

    /// Returns a job that creates the pipeline for `key` with `make`, unless it exists. Another thread can run the job while this thread draws.
    pub(crate) fn job(&self, key: K, make: impl FnOnce() -> P + Send + 'static) -> impl FnOnce() + Send + 'static
    where
        P: Send + Sync + 'static,
    {
        let cell = self.cell(key);
        move || {
            cell.get_or_init(make);
        }
    }

    fn cell(&self, key: K) -> Arc<OnceLock<P>> {
        // No code panics while it holds the lock, so the list is consistent even if the lock is poisoned.
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        match made.iter().find(|(existing, _)| *existing == key) {
            Some((_, cell)) => Arc::clone(cell),
            None => {
                let cell = Arc::new(OnceLock::new());
                made.push((key, Arc::clone(&cell)));
                cell
            }
        }
    }
}

/// A shader of a stage, with values for its overridable constants.
pub(crate) struct Stage<'a> {
    pub source: &'a ShaderSource,
    pub constants: &'a [(&'a str, f64)],
}

fn shader_module(device: &wgpu::Device, source: &ShaderSource) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(source.name),
        source: wgpu::ShaderSource::Wgsl(source.text.as_str().into()),
    })
}

/// Creates a compute pipeline with the layout of its shader and values for the shader's overridable constants.
pub(super) fn make_compute_pipeline(
    device: &wgpu::Device,
    source: &ShaderSource,
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = shader_module(device, source);
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(source.name),
        layout: None,
        module: &module,
        entry_point: Some(source.entry_point),
        compilation_options: wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false },
        cache: None,
    })
}

/// Returns the form of a shader that suits the adapter.
fn suited(source: &ShaderSource, software: bool) -> Cow<'_, ShaderSource> {
    if software { Cow::Owned(source.for_software()) } else { Cow::Borrowed(source) }
}

/// Creates and counts a pipeline, and logs the time.
fn timed<P>(counters: &Counters, name: &str, make: impl FnOnce() -> P) -> P {
    let start = Instant::now();
    let pipeline = make();
    counters.pipelines.fetch_add(1, Ordering::Relaxed);
    tracing::debug!("created the pipeline {name} in {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    pipeline
}

/// Creates compute pipelines of a device. It can be used on a thread that does not draw.
#[derive(Clone)]
pub(crate) struct ComputePipelines {
    device: wgpu::Device,
    software: bool,
    counters: Arc<Counters>,
    compile_ahead: Option<Arc<CompileAhead>>,
}

impl ComputePipelines {
    /// Creates a pipeline with the layout of its shader, and values for the shader's overridable constants.
    pub(crate) fn create(&self, source: &ShaderSource, constants: &[(&str, f64)]) -> wgpu::ComputePipeline {
        let source = &*suited(source, self.software);
        let pipeline = timed(&self.counters, source.name, || make_compute_pipeline(&self.device, source, constants));
        if let Some(ahead) = &self.compile_ahead {
            ahead.compile(source, constants);
        }
        pipeline
    }
}

impl Gpu {
    /// Creates the module of a shader, in the form that suits the adapter.
    pub(crate) fn shader_module(&self, source: &ShaderSource) -> wgpu::ShaderModule {
        shader_module(&self.device, &suited(source, self.software))
    }

    /// Creates a render pipeline.
    pub(crate) fn render_pipeline(&self, descriptor: &wgpu::RenderPipelineDescriptor<'_>) -> wgpu::RenderPipeline {
        let name = descriptor.label.unwrap_or_default();
        timed(&self.counters, name, || self.device.create_render_pipeline(descriptor))
    }

    /// Returns a factory for compute pipelines of this device.
    pub(crate) fn compute_pipelines(&self) -> ComputePipelines {
        ComputePipelines {
            device: self.device.clone(),
            software: self.software,
            counters: Arc::clone(&self.counters),
            compile_ahead: self.compile_ahead.clone(),
        }
    }

    /// Creates a compute pipeline with the layout of its shader.
    pub(crate) fn compute_pipeline(&self, source: &ShaderSource) -> wgpu::ComputePipeline {
        self.compute_pipeline_with(source, &[])
    }

    /// Creates a compute pipeline with values for the shader's overridable constants.
    pub(crate) fn compute_pipeline_with(
        &self,
        source: &ShaderSource,
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        self.compute_pipelines().create(source, constants)
    }

    /// Runs `make`. On a software driver, the threads that create pipelines also compile their compute shaders.
    pub(crate) fn compiling_ahead(&self, make: impl FnOnce()) {
        match &self.compile_ahead {
            Some(ahead) => ahead.during(make),
            None => make(),
        }
    }

    /// From now on, collects the compute shaders of created pipelines, if the driver compiles them when they first run.
    pub(crate) fn collect_shaders(&self) {
        if let Some(ahead) = &self.compile_ahead {
            ahead.collect();
        }
    }

    /// Returns the shaders that were collected.
    pub(crate) fn collected_shaders(&self) -> Option<CollectedShaders> {
        self.compile_ahead.as_ref()?.take_collected()
    }

    /// Creates a pipeline with one colour target, without depth and vertex buffers. Its layout is that of its shaders.
    pub(crate) fn colour_pipeline(
        &self,
        vertex: &Stage<'_>,
        fragment: &Stage<'_>,
        topology: wgpu::PrimitiveTopology,
        target: wgpu::ColorTargetState,
    ) -> wgpu::RenderPipeline {
        let options =
            |constants| wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false };
        self.render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment.source.name),
            layout: None,
            vertex: wgpu::VertexState {
                module: &self.shader_module(vertex.source),
                entry_point: Some(vertex.source.entry_point),
                compilation_options: options(vertex.constants),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology, ..Default::default() },
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &self.shader_module(fragment.source),
                entry_point: Some(fragment.source.entry_point),
                compilation_options: options(fragment.constants),
                targets: &[Some(target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// Creates a pipeline that adds the results of `fragment` to a target of [`Gpu::blend_format`].
    pub(crate) fn blending_pipeline(
        &self,
        vertex: &ShaderSource,
        constants: &[(&str, f64)],
        fragment: &ShaderSource,
        topology: wgpu::PrimitiveTopology,
    ) -> wgpu::RenderPipeline {
        let add = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let target = wgpu::ColorTargetState {
            format: self.blend_format,
            blend: Some(wgpu::BlendState { color: add, alpha: add }),
            write_mask: wgpu::ColorWrites::COLOR,
        };
        let vertex = Stage { source: vertex, constants };
        self.colour_pipeline(&vertex, &Stage { source: fragment, constants: &[] }, topology, target)
    }
}
