//! What meshes and impostors share: the lists that they draw, the formats that they draw onto, and their pipelines.

use crate::gpu::{Gpu, ShaderSource};

/// Lists of asteroids for one plane, as the passes that draw them bind them: `group` is group 0 of `shaders/asteroids/listed.wgsl`, whose
/// dynamic offset is the kind times `kind_stride`; `arguments` are five words per list.
pub(crate) struct AsteroidDraw<'a> {
    /// Bindings of the plane.
    pub group: &'a wgpu::BindGroup,
    /// Bytes between the kinds' uniforms.
    pub kind_stride: u32,
    /// Arguments of all lists.
    pub arguments: &'a wgpu::Buffer,
    /// First list of the plane.
    pub first_list: u64,
}

impl AsteroidDraw<'_> {
    /// Offset of a kind's arguments, bytes.
    pub(crate) fn arguments_at(&self, kind: u32) -> u64 {
        (self.first_list + u64::from(kind)) * ASTEROID_ARGUMENT_BYTES
    }
}

/// Bytes of the arguments of one draw.
pub(crate) const ASTEROID_ARGUMENT_BYTES: u64 = 20;

/// Format of what asteroids are drawn onto.
pub(crate) const ASTEROID_COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Format of their depth: greater is nearer.
pub(crate) const ASTEROID_DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Group 0 of every pass that draws asteroids.
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
                0 => uniform(false),
                1 => uniform(true),
                _ => storage,
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("asteroids"), entries: &entries })
}

/// A pipeline that draws asteroids.
pub(crate) struct AsteroidPipeline<'a> {
    /// Vertices and fragments.
    pub shaders: [&'a ShaderSource; 2],
    /// Values of the overridable constants of both.
    pub constants: &'a [(&'a str, f64)],
    /// Bind groups, the first that of [`asteroid_layout`]; `None`: those that the shaders imply.
    pub groups: Option<&'a [Option<&'a wgpu::BindGroupLayout>]>,
    /// Vertices.
    pub buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// What they make up.
    pub primitive: wgpu::PrimitiveState,
    /// Whether colour is written, or depth alone.
    pub colour: bool,
}

impl AsteroidPipeline<'_> {
    /// Makes it.
    pub(crate) fn make(self, gpu: &Gpu) -> wgpu::RenderPipeline {
        let Self { shaders: [vertex, fragment], constants, groups, buffers, primitive, colour } = self;
        let module = |source: &ShaderSource| {
            gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(source.name),
                source: wgpu::ShaderSource::Wgsl(source.text.as_str().into()),
            })
        };
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
                module: &module(vertex),
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
                module: &module(fragment),
                entry_point: Some(fragment.entry_point),
                compilation_options: options.clone(),
                targets: if colour { &targets } else { &[] },
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
