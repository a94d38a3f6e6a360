//! Plain blocks of images (`crate::plan::plain_blocks`): adds the smooth lights of a frame at the points of one grid per picture, and marks the
//! blocks that are not plain. Passes over pixels read the marks: `shaders/shared/plain_block.wgsl`.
//!
//! Shaders: `shaders/plain_blocks/`.
//!
//! No twin: tests/gpu/display_poses.rs compares display images with exact ones.

pub(crate) mod layout;

use std::sync::OnceLock;

use super::{
    constants::{
        plain_blocks::{NO_POINTS, SKY_CELL_ENTRIES},
        workgroups::VEIL_SIDE,
    },
    display_variant::{DisplayVariant, encode_display},
    layout::{AirAbove, PlainGrid},
    point_grid::{GridSpacing, dispatch_points, point_grids},
    tabulated::projecting,
    targets::{PlainGrids, SmoothGrid, Targets},
    technique::{FrameInputs, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::{
    gpu::{Gpu, Variants, bind_in_order},
    photometry::exposure::white_luminance_cd_m2,
    plan::{
        budget::ErrorBudget,
        plain_blocks::{PLAIN_BLOCK_PX, SHARE_OF_BUDGET},
        settings::ToneMapSettings,
        stars::cull::MAX_VIEWPORTS,
    },
};

/// Relative error of the inverse solid angle that a plain block of a display image may have.
const MOST_SOLID_ANGLE_ERROR: f32 = 5e-4;
/// The same for an HDR image, whose sums of starlight are exact to 1e-4.
const MOST_SOLID_ANGLE_ERROR_HDR: f32 = 3e-5;

/// Pipelines of the two passes.
pub(super) struct PlainBlocks {
    gather: OnceLock<wgpu::ComputePipeline>,
    /// Variants that judge display images, and the one that judges HDR images.
    mark: Variants<Option<DisplayVariant>, wgpu::ComputePipeline>,
}

impl PlainBlocks {
    pub(super) fn new() -> Self {
        Self { gather: OnceLock::new(), mark: Variants::new() }
    }

    fn gather(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.gather.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "plain_blocks/gather").source()))
    }

    /// Returns the pipeline that judges display images with this tone mapping, or HDR images.
    fn mark(&self, gpu: &Gpu, tone_map: Option<&ToneMapSettings>) -> wgpu::ComputePipeline {
        // Only differences of codes are judged, so short codes serve any budget.
        let variant = tone_map.map(|tone_map| DisplayVariant::from_settings(tone_map).with_short_codes(true));
        self.mark.get(variant, || {
            let judges = [("JUDGES_CODES", f64::from(u8::from(variant.is_some())))];
            let constants = [&judges[..], &variant.unwrap_or_default().constants()].concat();
            gpu.compute_pipeline_with(&projecting(gpu, "plain_blocks/mark").source(), &constants)
        })
    }
}

impl Technique for PlainBlocks {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let (gpu, tone_map) = (wish.gpu, &wish.forecast.tone_map);
        let job = || {
            PipelineJob::new("plain blocks", move || {
                self.gather(gpu);
                self.mark(gpu, Some(tone_map))
            })
        };
        wish.forecast.plain_forms().contains(&true).then(job).into_iter().collect()
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(plain) = &frame.plan.plain_blocks else { return };
        let spacing = GridSpacing { most_rad: 1.0, most_px: PLAIN_BLOCK_PX };
        let own = targets.reserve_points(gpu, "plain grids", point_grids(frame.plan, spacing));
        let mut reserve = |label, entries| {
            let (mut grids, count) = point_grids(frame.plan, spacing);
            grids.iter_mut().for_each(|grid| grid.first *= entries);
            targets.reserve_points(gpu, label, (grids, entries * count))
        };
        let sky = reserve("directions of plain grids", 2);
        let reads_faint_map = frame.plan.smooth_light.map.is_some();
        let faint = reads_faint_map.then(|| reserve("faint light of plain grids", SKY_CELL_ENTRIES));
        let parts = [
            targets.veil.as_ref(),
            targets.air.as_ref(),
            targets.diffuse.as_ref().and_then(|diffuse| diffuse.smooth.as_ref()),
            targets.near.as_ref(),
            targets.diffuse.as_ref().and_then(|diffuse| diffuse.rough.as_ref()),
            Some(&sky),
            faint.as_ref(),
        ];
        let first_of =
            |part: Option<&SmoothGrid>, viewport: usize| part.map_or(NO_POINTS, |part| part.grids[viewport].first);
        let grids: Vec<PlainGrid> = own
            .grids
            .iter()
            .zip(&frame.plan.views.viewports)
            .enumerate()
            .map(|(number, (grid, viewport))| {
                let [veil, air, diffuse, near, rough, sky, faint] = parts.map(|part| first_of(part, number));
                let [block_columns, block_rows] = viewport.size().map(|side| side.div_ceil(PLAIN_BLOCK_PX));
                PlainGrid {
                    first: if plain.spacings[number].is_some() { grid.first } else { NO_POINTS },
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
                    rough,
                    sky,
                    spacing_rad: grid.spacing_rad,
                    spacing_log2: grid.spacing_log2,
                    faint,
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
        let tone_map = &plan.display.tone_map;
        // Returns the error that a block may have, and the form that judges it.
        let (most_error, floor_cd_m2, white_cd_m2, judged) = match (plain.budget, plan.exposure.known_ev100) {
            (ErrorBudget::Hdr { relative, floor_cd_m2 }, _) => (relative, floor_cd_m2, 1.0, None),
            (ErrorBudget::Codes(codes), Some(ev100)) => (codes, 0.0, white_luminance_cd_m2(ev100), Some(tone_map)),
            (ErrorBudget::Codes(_), None) => unreachable!("plain blocks of display images need a known exposure"),
        };
        let most_solid_angle_error = if judged.is_some() { MOST_SOLID_ANGLE_ERROR } else { MOST_SOLID_ANGLE_ERROR_HDR };
        let (gather, mark) = (self.gather(gpu), &self.mark(gpu, judged));
        let ground = plan.air.sky.as_ref().and_then(|sky| sky.highest_ground_sine());
        let (faint_map, texels) = recording.targets.faint_map();
        let parameters = layout::PlainParameters {
            air: AirAbove::from_sky(plan.air.sky.as_deref()),
            shown: encode_display(tone_map),
            faint_map,
            display_per_cd_m2: (1.0 / white_cd_m2) as f32,
            most_error: (SHARE_OF_BUDGET * most_error) as f32,
            floor_cd_m2: (SHARE_OF_BUDGET * floor_cd_m2) as f32,
            most_solid_angle_error,
            // Without ground, the sky above the horizon is mirrored there.
            ground_sine: ground.unwrap_or(0.0) as f32,
            reads_faint_map: u32::from(plan.smooth_light.map.is_some()),
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("plain parameters", &parameters);
        let (viewports, counters) = (&recording.targets.viewports, &recording.targets.counters);
        let mut pass = begin_pass(recording.encoder, recording.timer, "plain blocks");
        pass.set_pipeline(gather);
        gpu.bind_tables(&mut pass, gather);
        pass.set_bind_group(0, &bind_in_order(gpu, gather, 0, &[&parameters, viewports, &list, &points]), &[]);
        dispatch_points(&mut pass, &own.grids);
        pass.set_pipeline(mark);
        gpu.bind_tables(&mut pass, mark);
        pass.set_bind_group(
            0,
            &bind_in_order(gpu, mark, 0, &[&parameters, viewports, &list, &points, counters, texels]),
            &[],
        );
        let most = |side: fn(&PlainGrid) -> u32| grids.iter().map(side).max().unwrap_or(0).div_ceil(VEIL_SIDE);
        pass.dispatch_workgroups(most(|grid| grid.block_columns), most(|grid| grid.block_rows), grids.len() as u32);
    }

    fn release(&mut self) {}
}
