//! The point pass: splats points of light other than stars, like stars. Shader: `shaders/bodies/points.wgsl`.
//!
//! No twin: reference/stars/splat.rs, which has the same splat.

use crate::render::constants::workgroups::POINT_THREADS;
use crate::{
    gpu::{Gpu, bind_buffers, dispatch_rows},
    plan::stars::range::FixedPoint,
    render::{
        bodies::layout,
        shader::{kernel_constant, rolled_loops},
        targets::{Sums, bind_occlusion, bind_sums, splatting},
    },
};

/// Pipeline of the point pass.
#[derive(Clone)]
pub(crate) struct PointPass {
    pipeline: wgpu::ComputePipeline,
}

impl PointPass {
    /// Creates the pass, with or without the round kernel of stars.
    pub(crate) fn new(gpu: &Gpu, has_round_kernel: bool) -> Self {
        let constants = [("HAS_GEOMETRY", 1.0), kernel_constant(has_round_kernel), rolled_loops(gpu)];
        Self { pipeline: gpu.compute_pipeline_with(&splatting(gpu, "bodies/points"), &constants) }
    }

    /// Records `count` points into the sums of one batch.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        range: &FixedPoint,
        sums: &Sums<'_>,
        (points, count): (&wgpu::Buffer, u32),
    ) {
        let [columns, rows] = dispatch_rows(gpu, count.div_ceil(POINT_THREADS));
        let parameters = layout::PointParameters {
            units_per_lx: range.units_per_lx as f32,
            count,
            per_row: columns * POINT_THREADS,
            faintest_lx: range.faintest_lx as f32,
            brightest_lx: range.brightest_lx.min(f64::from(f32::MAX)) as f32,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("point parameters", &parameters);
        pass.set_pipeline(&self.pipeline);
        gpu.bind_tables(pass, &self.pipeline);
        pass.set_bind_group(0, &bind_sums(gpu, &self.pipeline, &parameters, sums, &[]), &[]);
        let points = [(0, points.as_entire_binding())];
        pass.set_bind_group(1, &bind_buffers(gpu, &self.pipeline, 1, &points), &[]);
        pass.set_bind_group(2, &bind_occlusion(gpu, &self.pipeline, &sums.occlusion), &[]);
        pass.dispatch_workgroups(columns, rows, 1);
    }
}
