//! Splats asteroids drawn as points, like stars. Shader: `shaders/asteroids/points.wgsl`.
//!
//! No twin: photometry/reflection.rs, which has closed forms.

use crate::{
    gpu::{Gpu, bind_in_order, dispatch_rows},
    plan::stars::range::FixedPoint,
    render::{
        asteroids::layout,
        shader::{kernel_constant, rolled_loops, workgroup_constant},
        targets::{Sums, bind_occlusion, bind_sums, splatting_shader},
    },
};

/// Pipeline of the point pass.
#[derive(Clone)]
pub(crate) struct AsteroidPointPass {
    pipeline: wgpu::ComputePipeline,
}

/// Asteroid buffers that the pass reads, and the buffer of counts.
pub(crate) struct AsteroidPoints<'a> {
    pub items: &'a wgpu::Buffer,
    /// Number of groups.
    pub count: u32,
    pub instances: &'a wgpu::Buffer,
    pub fields: &'a wgpu::Buffer,
    pub views: &'a wgpu::Buffer,
    /// Tables of pictures and shapes.
    pub tables: &'a wgpu::Buffer,
    /// First of their counters: see [`crate::render::targets::POINT_COUNTERS`].
    pub first_drawn: u32,
}

impl AsteroidPointPass {
    /// Returns a function that creates the pass, with or without the round kernel of stars.
    pub(crate) fn make(gpu: &Gpu, has_round_kernel: bool) -> impl FnOnce() -> Self + Send + 'static {
        let constants =
            [workgroup_constant(gpu), ("HAS_GEOMETRY", 1.0), kernel_constant(has_round_kernel), rolled_loops(gpu)];
        let (pipelines, shader) = (gpu.compute_pipelines(), splatting_shader(gpu, "asteroids/points"));
        move || Self { pipeline: pipelines.create(&shader.source(), &constants) }
    }

    /// Records the points of all groups into one batch of `tiles` tiles.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        range: &FixedPoint,
        sums: &Sums<'_>,
        tiles: u32,
        points: &AsteroidPoints<'_>,
    ) {
        let [row, rows] = dispatch_rows(gpu, points.count);
        let parameters = layout::AsteroidPointParameters {
            units_per_lx: range.units_per_lx as f32,
            items: points.count,
            row,
            tiles,
            first_drawn: points.first_drawn,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("asteroid points", &parameters);
        let items = [(5, points.items.as_entire_binding())];
        let asteroids = [points.instances, points.fields, points.views, points.tables];
        pass.set_pipeline(&self.pipeline);
        gpu.bind_tables(pass, &self.pipeline);
        pass.set_bind_group(0, &bind_sums(gpu, &self.pipeline, &parameters, sums, &items), &[]);
        pass.set_bind_group(1, &bind_in_order(gpu, &self.pipeline, 1, &asteroids), &[]);
        pass.set_bind_group(2, &bind_occlusion(gpu, &self.pipeline, &sums.occlusion), &[]);
        pass.dispatch_workgroups(row, rows, 1);
    }
}
