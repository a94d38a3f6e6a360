//! The pass over the points of a grid over each picture. Most of the sky is so smooth that a display image within its budget reads its light between points; cells where it is not, the pass tells by the
//! roughness that the map has there, and their pixels read it one by one. Shader: `shaders/diffuse/points.wgsl`.

use std::sync::OnceLock;

use super::layout::DiffusePointParameters;
use crate::{
    catalogue::diffuse::{DiffuseSky, ROUGHNESS_TEXELS},
    gpu::{Gpu, GrowingBuffer, bind_in_order},
    plan::Plan,
    render::{
        layout::{AirAbove, DiffuseLight},
        point_grid::{GridSpacing, dispatch_points, point_grids},
        tabulated::projecting,
        targets::SmoothGrid,
        technique::{Recording, begin_pass},
    },
};

/// Points stand no farther apart than this, rad, and than the roughness of a map tells.
const MOST_RAD: f64 = 0.0125;
/// Nor than so many pixels.
const MOST_PX: u32 = 8;
/// Roughness over the budget that is allowed where points stand as far apart as it is told for. Measured: light between them errs by a third of it at most, along both axes together.
const ROUGHNESS_OF_BUDGET: f64 = 1.5;

/// The pass, and what it writes.
pub(super) struct DiffusePoints {
    pipeline: OnceLock<wgpu::ComputePipeline>,
    points: GrowingBuffer,
}

impl DiffusePoints {
    pub(super) fn new() -> Self {
        Self { pipeline: OnceLock::new(), points: GrowingBuffer::new("diffuse points", wgpu::BufferUsages::STORAGE) }
    }

    pub(super) fn pipeline(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.pipeline.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "diffuse/points").source()))
    }

    /// Records the pass for a plan whose light may err by `step_cd_m2`. Buffers: texels, roughness.
    pub(super) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        (sky, light, step_cd_m2): (&DiffuseSky, DiffuseLight, f64),
        [texels, roughness]: [&wgpu::Buffer; 2],
    ) -> SmoothGrid {
        let gpu = recording.gpu;
        let plan: &Plan = recording.frame.plan;
        let of_map_rad = 2.0 * f64::from(ROUGHNESS_TEXELS) * sky.pictures().texel_rad();
        let most_rad = MOST_RAD.min(of_map_rad);
        let spacing = GridSpacing { most_rad, most_px: MOST_PX };
        let (grids, count) = point_grids(&plan.viewports, spacing);
        let parameters = DiffusePointParameters {
            light,
            air: AirAbove::of(plan.local_sky.as_deref()),
            // It grows with the square of the distance.
            most_rough: (ROUGHNESS_OF_BUDGET * step_cd_m2 * (of_map_rad / most_rad).powi(2)) as f32,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("diffuse points", &parameters);
        let points = self.points.with_room(gpu, 16 * u64::from(count)).clone();
        let smooth = SmoothGrid { grids: gpu.frame_storage("diffuse grids", &grids), points };
        let pipeline = self.pipeline(gpu);
        let viewports = &recording.targets.viewports;
        let buffers = [&parameters, viewports, &smooth.grids, texels, roughness, &smooth.points];
        let mut pass = begin_pass(recording.encoder, recording.timer, "diffuse light");
        pass.set_pipeline(pipeline);
        gpu.bind_tables(&mut pass, pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
        dispatch_points(&mut pass, &grids);
        drop(pass);
        smooth
    }

    pub(super) fn release(&mut self) {
        self.points.release();
    }
}
