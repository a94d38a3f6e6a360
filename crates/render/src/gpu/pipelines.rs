//! Pipelines: how they are made and counted, and how those that depend on settings are kept.
//!
//! Making one takes milliseconds to seconds: the driver compiles the shader then, or (software drivers) when it first runs. They may be made on
//! several threads at once.

use std::{
    sync::{Arc, Mutex, OnceLock, PoisonError, atomic::Ordering},
    time::Instant,
};

use super::{Gpu, ShaderSource};

/// Pipelines of one pass, by what is compiled into them. Each is made when it is first asked for, by one thread; others that ask for the same
/// one meanwhile wait for it.
pub(crate) struct Variants<K, P> {
    made: Mutex<Vec<(K, Arc<OnceLock<P>>)>>,
}

impl<K: PartialEq, P: Clone> Variants<K, P> {
    /// None yet.
    pub(crate) fn new() -> Self {
        Self { made: Mutex::new(Vec::new()) }
    }

    /// The one for `key`, which `make` makes if it is the first time. What is returned is a handle.
    pub(crate) fn get(&self, key: K, make: impl FnOnce() -> P) -> P {
        let cell = {
            // Nothing can panic while the lock is held, so what is poisoned is whole.
            let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
            match made.iter().find(|(of, _)| *of == key) {
                Some((_, cell)) => Arc::clone(cell),
                None => {
                    let cell = Arc::new(OnceLock::new());
                    made.push((key, Arc::clone(&cell)));
                    cell
                }
            }
        };
        cell.get_or_init(make).clone()
    }
}

/// A shader of a stage, with values for its overridable constants.
pub(crate) struct Stage<'a> {
    pub source: &'a ShaderSource,
    pub constants: &'a [(&'a str, f64)],
}

/// A compute pipeline with the layout that its shader implies, and values for the shader's overridable constants.
pub(super) fn make_compute_pipeline(
    device: &wgpu::Device,
    source: &ShaderSource,
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(source.name),
        source: wgpu::ShaderSource::Wgsl(source.text.as_str().into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(source.name),
        layout: None,
        module: &module,
        entry_point: Some(source.entry_point),
        compilation_options: wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false },
        cache: None,
    })
}

impl Gpu {
    /// Makes a pipeline: counts it, and tells how long it took.
    fn timed<P>(&self, name: &str, make: impl FnOnce() -> P) -> P {
        let start = Instant::now();
        let pipeline = make();
        self.counters.pipelines.fetch_add(1, Ordering::Relaxed);
        tracing::debug!("made the pipeline {name} in {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
        pipeline
    }

    /// A render pipeline of that description.
    pub(crate) fn render_pipeline(&self, descriptor: &wgpu::RenderPipelineDescriptor<'_>) -> wgpu::RenderPipeline {
        self.timed(descriptor.label.unwrap_or_default(), || self.device.create_render_pipeline(descriptor))
    }

    /// A compute pipeline with the layout that its shader implies.
    pub(crate) fn compute_pipeline(&self, source: &ShaderSource) -> wgpu::ComputePipeline {
        self.compute_pipeline_with(source, &[])
    }

    /// The same with values for the shader's overridable constants.
    pub(crate) fn compute_pipeline_with(
        &self,
        source: &ShaderSource,
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        let pipeline = self.timed(source.name, || make_compute_pipeline(&self.device, source, constants));
        if let Some(ahead) = &self.compile_ahead {
            ahead.compile(source, constants);
        }
        pipeline
    }

    /// Runs `make`; on a software driver the compute shaders of all pipelines that it makes are compiled meanwhile, by the threads that make them.
    pub(crate) fn compiling_ahead(&self, make: impl FnOnce()) {
        match &self.compile_ahead {
            Some(ahead) => ahead.during(make),
            None => make(),
        }
    }

    /// A pipeline onto one colour target, without depth and vertex buffers, with the layout that its shaders imply.
    pub(crate) fn colour_pipeline(
        &self,
        vertex: &Stage<'_>,
        fragment: &Stage<'_>,
        topology: wgpu::PrimitiveTopology,
        target: wgpu::ColorTargetState,
    ) -> wgpu::RenderPipeline {
        let module = |stage: &Stage<'_>| {
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(stage.source.name),
                source: wgpu::ShaderSource::Wgsl(stage.source.text.as_str().into()),
            })
        };
        let options =
            |constants| wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false };
        self.render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment.source.name),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module(vertex),
                entry_point: Some(vertex.source.entry_point),
                compilation_options: options(vertex.constants),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology, ..Default::default() },
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module(fragment),
                entry_point: Some(fragment.source.entry_point),
                compilation_options: options(fragment.constants),
                targets: &[Some(target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// A pipeline that adds what `fragment` gives to a target of [`Gpu::blend_format`].
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
