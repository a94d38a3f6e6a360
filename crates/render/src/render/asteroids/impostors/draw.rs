//! Draws each asteroid impostor as one square that is textured from an atlas and has depth.
//!
//! Shaders: `shaders/asteroids/impostors/draw*.wgsl`; the f64 twin is `crate::reference::asteroids::impostors`.
//!
//! No twin: reference/asteroids/impostors/picture.rs.

use crate::render::{
    constants::{asteroid_lists::IMPOSTOR_VERTICES, impostors},
    shader::Shader,
};
use crate::{
    gpu::{Gpu, LayoutOf},
    plan::asteroids::ImpostorMethod,
    render::asteroids::raster::{AsteroidDraw, AsteroidPipeline},
};

/// Vertices of a square, as a triangle strip.
pub(crate) const CORNERS: u32 = IMPOSTOR_VERTICES;

/// Draw pass of one method. Clones share its pipeline.
#[derive(Clone)]
pub(crate) struct AsteroidImpostorPass {
    pipeline: wgpu::RenderPipeline,
    atlas_layout: wgpu::BindGroupLayout,
}

/// Source of the asteroids to draw: a WGSL file that defines `slot_of`, `load_asteroid`, `clip_from_view` and `faded`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AsteroidSource {
    /// The lists written by culling.
    Lists,
    /// A buffer of single asteroids, to test impostors in isolation.
    Given,
}

impl AsteroidSource {
    fn file(self) -> &'static str {
        match self {
            Self::Lists => "asteroids/listed",
            Self::Given => "asteroids/impostors/given",
        }
    }
}

/// Returns the number of a method in the shaders; `None` for methods without impostors.
fn number_of(method: ImpostorMethod) -> Option<f64> {
    match method.chosen() {
        ImpostorMethod::EulerAtlas => Some(impostors::METHOD_EULER.into()),
        ImpostorMethod::Octahedral => Some(impostors::METHOD_OCTAHEDRAL.into()),
        // Splats have a separate pass. Drawn as squares, they look like `octahedral_blend`.
        ImpostorMethod::OctahedralBlend | ImpostorMethod::OctahedralSplat => Some(impostors::METHOD_BLEND.into()),
        ImpostorMethod::Auto | ImpostorMethod::None => None,
    }
}

impl AsteroidImpostorPass {
    /// Creates the pass of a method for asteroids from `source`, whose group 0 has the layout `source_layout`. Returns
    /// `None` for methods without impostors.
    pub(crate) fn new(
        gpu: &Gpu,
        source: AsteroidSource,
        source_layout: &wgpu::BindGroupLayout,
        method: ImpostorMethod,
    ) -> Option<Self> {
        let constants = [("METHOD", number_of(method)?)];
        let shader = |file| Shader::new(file).with("source", source.file()).source();
        let shaders = [&shader("asteroids/impostors/draw"), &shader("asteroids/impostors/draw_shade")];
        let atlas_layout = atlas_layout(gpu);
        let groups = [Some(source_layout), Some(&atlas_layout)];
        let primitive = wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleStrip, ..Default::default() };
        let pipeline = AsteroidPipeline {
            shaders,
            constants: &constants,
            groups: Some(&groups),
            buffers: &[],
            primitive,
            colour: true,
        };
        Some(Self { pipeline: pipeline.make(gpu), atlas_layout })
    }

    /// Creates bind group 1 from the bindings of an atlas (`super::atlas`).
    pub(crate) fn atlas_group(&self, gpu: &Gpu, bindings: &[(u32, wgpu::BindingResource<'_>)]) -> wgpu::BindGroup {
        gpu.bind_once(LayoutOf::Own(&self.atlas_layout), bindings)
    }

    /// Sets pipeline and bind groups (`offsets`: dynamic offsets of group 0). The caller then draws [`CORNERS`]
    /// vertices, one instance per asteroid.
    pub(crate) fn begin(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        source: &wgpu::BindGroup,
        offsets: &[u32],
        atlas: &wgpu::BindGroup,
    ) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, source, offsets);
        pass.set_bind_group(1, atlas, &[]);
    }

    /// Records the draw of one impostor list, which culling wrote, onto one plane.
    pub(crate) fn record(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        draw: &AsteroidDraw<'_>,
        kind: u32,
        atlas: &wgpu::BindGroup,
    ) {
        self.begin(pass, draw.group, &[kind * draw.kind_stride], atlas);
        pass.draw_indirect(draw.arguments, draw.arguments_at(kind));
    }
}

/// Returns the layout of group 1: the atlas of `shaders/asteroids/impostors/atlas.wgsl`.
fn atlas_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let texture = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2Array,
        multisampled: false,
    };
    let kinds = [
        (wgpu::ShaderStages::VERTEX_FRAGMENT, buffer(wgpu::BufferBindingType::Uniform)),
        (wgpu::ShaderStages::VERTEX, buffer(wgpu::BufferBindingType::Storage { read_only: true })),
        (wgpu::ShaderStages::FRAGMENT, texture),
        (wgpu::ShaderStages::FRAGMENT, texture),
        (wgpu::ShaderStages::FRAGMENT, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
    ];
    let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..)
        .zip(kinds)
        .map(|(binding, (visibility, ty))| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("impostor atlas"), entries: &entries })
}
