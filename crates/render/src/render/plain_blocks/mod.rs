//! Plain blocks of display images (`crate::plan::plain_blocks`): adds the smooth lights of a frame at the points of one grid per picture, and marks the
//! blocks that are not plain. Passes over pixels read the marks: `shaders/shared/plain_block.wgsl`.
//!
//! Shaders: `shaders/plain_blocks/`.
//!
//! No twin: compared with exact display images: tests/gpu/display_poses.rs.

pub(crate) mod layout;

use std::sync::OnceLock;

use super::{
    constants::{plain_blocks::NO_POINTS, workgroups::VEIL_SIDE},
    layout::PlainGrid,
    point_grid::{GridSpacing, dispatch_points, point_grids},
    tabulated::projecting,
    targets::{PlainGrids, SmoothGrid, Targets},
    technique::{FrameInputs, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::{
    gpu::{Gpu, bind_in_order},
    plan::{
        GRID_FROM_SINE, Plan,
        plain_blocks::{PLAIN_BLOCK_PX, PlainBlocksPlan},
        stars::cull::MAX_VIEWPORTS,
    },
};

/// Margin above the highest ground, pixels.
const PIXELS_ABOVE_GROUND: f64 = 2.0;

/// Pipelines of the two passes.
pub(super) struct PlainBlocks {
    gather: OnceLock<wgpu::ComputePipeline>,
    mark: OnceLock<wgpu::ComputePipeline>,
}

impl PlainBlocks {
    pub(super) fn new() -> Self {
        Self { gather: OnceLock::new(), mark: OnceLock::new() }
    }

    fn gather(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.gather.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "plain_blocks/gather").source()))
    }

    fn mark(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.mark.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "plain_blocks/mark").source()))
    }
}

/// Sine of the altitude from which on a block shows neither ground nor the air near the horizon.
fn least_sine(plan: &Plan, plain: &PlainBlocksPlan) -> f64 {
    let pixel_rad =
        plain.spacing_rad / f64::from(PLAIN_BLOCK_PX.min(plain.spacings_px.iter().copied().min().unwrap_or(1)));
    let ground = plan.air.sky.as_ref().and_then(|sky| sky.highest_ground_sine());
    ground.map_or(GRID_FROM_SINE, |sine| GRID_FROM_SINE.max(sine + PIXELS_ABOVE_GROUND * pixel_rad))
}

impl Technique for PlainBlocks {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        let job = || {
            PipelineJob::new("plain blocks", move || {
                self.gather(gpu);
                self.mark(gpu);
            })
        };
        wish.forecast.may_have_plain.then(job).into_iter().collect()
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(plain) = &frame.plan.plain_blocks else { return };
        let spacing = GridSpacing { most_rad: plain.spacing_rad, most_px: PLAIN_BLOCK_PX };
        let own = targets.reserve_points(gpu, "plain grids", point_grids(frame.plan, spacing));
        let parts = [
            targets.veil.as_ref(),
            targets.air.as_ref(),
            targets.diffuse.as_ref().and_then(|diffuse| diffuse.smooth.as_ref()),
            targets.near.as_ref(),
        ];
        let first_of =
            |part: Option<&SmoothGrid>, viewport: usize| part.map_or(NO_POINTS, |part| part.grids[viewport].first);
        let grids: Vec<PlainGrid> = own
            .grids
            .iter()
            .zip(&frame.plan.views.viewports)
            .enumerate()
            .map(|(number, (grid, viewport))| {
                let [veil, air, diffuse, near] = parts.map(|part| first_of(part, number));
                let [block_columns, block_rows] = viewport.size().map(|side| side.div_ceil(PLAIN_BLOCK_PX));
                PlainGrid {
                    first: grid.first,
                    columns: grid.columns,
                    rows: grid.rows,
                    spacing: grid.spacing,
                    veil,
                    air,
                    diffuse,
                    near,
                    first_flag: targets.plain_flags[number],
                    block_columns,
                    block_rows,
                    ..Default::default()
                }
            })
            .collect();
        let list = gpu.frame_uniform_list("plain grids", &grids, MAX_VIEWPORTS);
        targets.plain = Some(PlainGrids { grids, own, list });
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let (Phase::Points, Some(plain)) = (phase, &plan.plain_blocks) else { return };
        let Some(PlainGrids { grids, own, list }) = recording.targets.plain.clone() else { return };
        let points = recording.targets.grid_points(gpu);
        let (gather, mark) = (self.gather(gpu), self.mark(gpu));
        let parameters = layout::PlainParameters {
            most_error: plain.most_error_cd_m2 as f32,
            least_sine: least_sine(plan, plain) as f32,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("plain parameters", &parameters);
        let (viewports, counters) = (&recording.targets.viewports, &recording.targets.counters);
        let mut pass = begin_pass(recording.encoder, recording.timer, "plain blocks");
        pass.set_pipeline(gather);
        gpu.bind_tables(&mut pass, gather);
        pass.set_bind_group(0, &bind_in_order(gpu, gather, 0, &[viewports, &list, &points]), &[]);
        dispatch_points(&mut pass, &own.grids);
        pass.set_pipeline(mark);
        gpu.bind_tables(&mut pass, mark);
        pass.set_bind_group(0, &bind_in_order(gpu, mark, 0, &[&parameters, viewports, &list, &points, counters]), &[]);
        let most = |side: fn(&PlainGrid) -> u32| grids.iter().map(side).max().unwrap_or(0).div_ceil(VEIL_SIDE);
        pass.dispatch_workgroups(most(|grid| grid.block_columns), most(|grid| grid.block_rows), grids.len() as u32);
    }

    fn release(&mut self) {}
}
