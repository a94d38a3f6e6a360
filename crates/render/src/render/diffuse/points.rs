//! The pass over the grid points of each picture. A display image with an error budget can interpolate light between grid points, because most of the
//! sky is smooth enough. The pass marks the other cells by the roughness stored in the map, and pixels in them read the light individually.
//!
//! Shader: `shaders/diffuse/points.wgsl`.
//!
//! No twin: tests/gpu/diffuse.rs compares display images with exact ones.

use std::sync::OnceLock;

use super::layout::DiffusePointParameters;
use crate::{
    catalogue::diffuse::{DiffuseSky, ROUGHNESS_TEXELS},
    gpu::{Gpu, bind_in_order},
    plan::{Plan, budget::ErrorBudget},
    render::{
        layout::{AirAbove, DiffuseLight, PointGrid},
        point_grid::{GridSpacing, dispatch_points, point_grids},
        tabulated::projecting,
        targets::SmoothGrid,
        technique::{Recording, begin_pass},
    },
};

/// Maximum distance between grid points, rad. The spacing of the map's roughness values is a second limit.
const MOST_RAD: f64 = 0.0125;
/// Maximum distance between grid points, pixels.
const MOST_PX: u32 = 8;
/// Allowed roughness, relative to the error budget, at the spacing to which the roughness values refer. Measurements show that the error of
/// interpolated light is at most a third of the roughness, for both axes together.
const ROUGHNESS_OF_BUDGET: f64 = 1.5;

/// Pipeline of the pass.
pub(super) struct DiffusePoints {
    pipeline: OnceLock<wgpu::ComputePipeline>,
}

/// Returns the spacing of the roughness values of a map, rad.
fn roughness_spacing_rad(sky: Option<&DiffuseSky>) -> f64 {
    sky.map_or(MOST_RAD, |sky| 2.0 * f64::from(ROUGHNESS_TEXELS) * sky.pictures().texel_rad())
}

/// Returns the grids over the pictures of a plan, and their number of points.
pub(super) fn grids(plan: &Plan, sky: Option<&DiffuseSky>) -> (Vec<PointGrid>, u32) {
    let most_rad = MOST_RAD.min(roughness_spacing_rad(sky));
    point_grids(plan, GridSpacing { most_rad, most_px: MOST_PX })
}

impl DiffusePoints {
    pub(super) fn new() -> Self {
        Self { pipeline: OnceLock::new() }
    }

    pub(super) fn pipeline(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.pipeline.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "diffuse/points").source()))
    }

    /// Records the pass over two grids: that of all diffuse light and that of its rough part. `step_cd_m2` is the error that the plan allows for the
    /// light. Buffers: texels, roughness.
    pub(super) fn record(
        &self,
        recording: &mut Recording<'_>,
        (sky, light, step_cd_m2): (Option<&DiffuseSky>, DiffuseLight, f64),
        (grid, rough): (&SmoothGrid, Option<&SmoothGrid>),
        [texels, roughness]: [&wgpu::Buffer; 2],
    ) {
        let gpu = recording.gpu;
        let plan: &Plan = recording.frame.plan;
        let relative = match plan.display.budget {
            Some(ErrorBudget::Hdr { relative, .. }) => relative,
            _ => 0.0,
        };
        let parameters = DiffusePointParameters {
            light,
            air: AirAbove::from_sky(plan.air.sky.as_deref()),
            // Roughness grows with the square of the distance.
            most_rough: (ROUGHNESS_OF_BUDGET * step_cd_m2 * roughness_spacing_rad(sky).powi(2)) as f32,
            most_rough_per_cd_m2: (ROUGHNESS_OF_BUDGET * relative * roughness_spacing_rad(sky).powi(2)) as f32,
            rough_points: rough.map_or(0, |rough| rough.grids[0].first - grid.grids[0].first),
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("diffuse points", &parameters);
        let points = recording.targets.grid_points(gpu);
        let pipeline = self.pipeline(gpu);
        let viewports = &recording.targets.viewports;
        let buffers = [&parameters, viewports, &grid.list, texels, roughness, &points];
        let mut pass = begin_pass(recording.encoder, recording.timer, "diffuse light");
        pass.set_pipeline(pipeline);
        gpu.bind_tables(&mut pass, pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
        dispatch_points(&mut pass, &grid.grids);
    }
}
