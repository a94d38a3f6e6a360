//! Draws asteroid meshes: one indirect draw per mesh and plane, with the list written by culling. Shaders:
//! `shaders/asteroids/mesh*.wgsl`.

use super::raster::{AsteroidDraw, AsteroidPipeline};
use crate::gpu::Gpu;
use crate::render::shader::Shader;

/// Draw pass of meshes.
pub(crate) struct AsteroidMeshPass {
    pipeline: wgpu::RenderPipeline,
}

/// Vertex of a mesh: position (mean radii), normal, factor on the albedo.
pub(crate) type MeshVertex = [f32; 7];

impl AsteroidMeshPass {
    /// Creates the pass; `group` is the layout of group 0.
    pub(crate) fn new(gpu: &Gpu, group: &wgpu::BindGroupLayout) -> Self {
        let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32];
        let buffer = wgpu::VertexBufferLayout {
            array_stride: size_of::<MeshVertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &attributes,
        };
        let primitive = wgpu::PrimitiveState {
            front_face: wgpu::FrontFace::Ccw,
            cull_mode: Some(wgpu::Face::Back),
            ..Default::default()
        };
        let shaders = [&Shader::new("asteroids/mesh").source(), &Shader::new("asteroids/mesh_shade").source()];
        let (groups, buffers) = ([Some(group)], [Some(buffer)]);
        let pipeline = AsteroidPipeline {
            shaders,
            constants: &[],
            groups: Some(&groups),
            buffers: &buffers,
            primitive,
            colour: true,
        };
        Self { pipeline: pipeline.make(gpu) }
    }

    /// Records the draws of all meshes onto one plane.
    pub(crate) fn record(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        draw: &AsteroidDraw<'_>,
        vertices: &wgpu::Buffer,
        indices: &wgpu::Buffer,
        mesh_kinds: u32,
    ) {
        pass.set_pipeline(&self.pipeline);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        for kind in 0..mesh_kinds {
            pass.set_bind_group(0, draw.group, &[kind * draw.kind_stride]);
            pass.draw_indexed_indirect(draw.arguments, draw.arguments_at(kind));
        }
    }
}
