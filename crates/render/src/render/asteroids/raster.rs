//! Code that meshes and impostors share: the lists they draw, the target formats, and their pipelines.
//!
//! No shader: code shared by mesh and impostors.
//! No twin: code shared by mesh and impostors.

use crate::gpu::{Gpu, ShaderSource};

/// Lists of asteroids for one plane. `group` is group 0 of `shaders/asteroids/listed.wgsl`; its dynamic offset is the
/// kind times `kind_stride`. `arguments` holds five words per list.
pub(crate) struct AsteroidDraw<'a> {
    /// Bind group of the plane.
    pub group: &'a wgpu::BindGroup,
    /// Stride between the uniforms of two kinds, bytes.
    pub kind_stride: u32,
    /// Indirect draw arguments of all lists.
    pub arguments: &'a wgpu::Buffer,
    /// Index of the plane's first list.
    pub first_list: u64,
}

impl AsteroidDraw<'_> {
    /// Returns the offset of a kind's arguments, bytes.
    pub(crate) fn arguments_at(&self, kind: u32) -> u64 {
        (self.first_list + u64::from(kind)) * ASTEROID_ARGUMENT_BYTES
    }
}

/// Size of the arguments of one draw, bytes.
pub(crate) const ASTEROID_ARGUMENT_BYTES: u64 = 20;

/// Colour format that asteroids are drawn in.
pub(crate) const ASTEROID_COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Depth format of asteroids: greater values are nearer.
pub(crate) const ASTEROID_DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Returns the layout of group 0 of every pass that draws asteroids.
pub(crate) fn asteroid_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let uniform = |dynamic: bool| wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: dynamic,
        min_binding_size: None,
    };
    let storage = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..8)
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: if binding == 0 { wgpu::ShaderStages::VERTEX_FRAGMENT } else { wgpu::ShaderStages::VERTEX },
            ty: match binding {
                0 | 3 => uniform(false),
                1 => uniform(true),
                _ => storage,
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("asteroids"), entries: &entries })
}

/// Description of a render pipeline that draws asteroids.
pub(crate) struct AsteroidPipeline<'a> {
    /// Vertex shader and fragment shader.
    pub shaders: [&'a ShaderSource; 2],
    /// Values of the overridable constants of both shaders.
    pub constants: &'a [(&'a str, f64)],
    /// Bind group layouts, the first from [`asteroid_layout`]; `None`: derived from the shaders.
    pub groups: Option<&'a [Option<&'a wgpu::BindGroupLayout>]>,
    /// Vertex buffer layouts.
    pub buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// Primitive state.
    pub primitive: wgpu::PrimitiveState,
    /// Whether colour is written in addition to depth.
    pub colour: bool,
}

impl AsteroidPipeline<'_> {
    /// Creates the pipeline.
    pub(crate) fn make(self, gpu: &Gpu) -> wgpu::RenderPipeline {
        let Self { shaders: [vertex, fragment], constants, groups, buffers, primitive, colour } = self;
        let targets = [Some(ASTEROID_COLOUR.into())];
        let options = wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false };
        let layout = groups.map(|groups| {
            gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(vertex.name),
                bind_group_layouts: groups,
                ..Default::default()
            })
        });
        gpu.render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment.name),
            layout: layout.as_ref(),
            vertex: wgpu::VertexState {
                module: &gpu.shader_module(vertex),
                entry_point: Some(vertex.entry_point),
                compilation_options: options.clone(),
                buffers,
            },
            primitive,
            depth_stencil: Some(wgpu::DepthStencilState {
                format: ASTEROID_DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &gpu.shader_module(fragment),
                entry_point: Some(fragment.entry_point),
                compilation_options: options.clone(),
                targets: if colour { &targets } else { &[] },
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
