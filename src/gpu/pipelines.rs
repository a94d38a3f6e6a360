//! Pipelines of the graphics stages.

use std::sync::atomic::Ordering;

use super::{Gpu, ShaderSource};

/// A shader of a stage, with values for its overridable constants.
pub(crate) struct Stage<'a> {
    pub source: &'a ShaderSource,
    pub constants: &'a [(&'a str, f64)],
}

impl Gpu {
    /// A render pipeline, counted.
    pub(crate) fn render_pipeline(&self, descriptor: &wgpu::RenderPipelineDescriptor<'_>) -> wgpu::RenderPipeline {
        self.counters.pipelines.fetch_add(1, Ordering::Relaxed);
        self.device.create_render_pipeline(descriptor)
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
