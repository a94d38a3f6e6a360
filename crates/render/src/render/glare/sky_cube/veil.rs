//! Glare of display images: the veil of bright sources is added to the sums together with the stars. The rest is
//! computed on a coarse grid of points and interpolated by the resolve pass. Shaders:
//! `shaders/glare/sky_cube/veil_*.wgsl`.
//!
//! The light of the map is smooth over some degrees, so grid points less than 1.5 degrees apart are sufficient. With the error budget of a display,
//! the veil of single sources is significant in only a few pixels. The only remaining pass over all pixels is the resolve pass.
//!
//! No twin: tests/gpu/glare/display_budget.rs checks that the error of the veil stays within a display image's budget.

use std::f64::consts::PI;

use super::{
    SkyCube, held_in_sums,
    map::Held,
    objects::{has_sources, points_of},
};
use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::{
    gpu::{Gpu, Variants, bind_in_order, dispatch_rows},
    plan::stars::range::FixedPoint,
    render::{
        constants::veil::EVERY_VIEWPORT,
        glare::layout,
        point_grid::{GridSpacing, dispatch_points, point_grids},
        shader::{rolled_loops, workgroup, workgroup_constant},
        tabulated::projecting,
        targets::{SmoothGrid, Targets, bind_sums, splatting},
        technique::{FrameInputs, Recording, begin_pass},
    },
    units::PARSEC_M,
};

/// The map is smooth over some degrees.
const SPACING: GridSpacing = GridSpacing { most_rad: 0.0246, most_px: 16 };

/// Sources with a longer reach than this count as wide, pixels.
const WIDE_PX: f64 = 8.0;

/// Pipelines of the veil.
pub(super) struct VeilPasses {
    /// One pipeline with and one without a kernel table.
    points: Variants<bool, wgpu::ComputePipeline>,
    splat: Variants<bool, wgpu::ComputePipeline>,
}

impl VeilPasses {
    pub(super) fn new() -> Self {
        Self { points: Variants::new(), splat: Variants::new() }
    }

    /// Returns the pass over points and the pass over sources.
    pub(super) fn pipelines(&self, gpu: &Gpu, tabulated: bool) -> [wgpu::ComputePipeline; 2] {
        let kernel_constant = ("TABULATED", f64::from(u8::from(tabulated)));
        let splat = self.splat.get(tabulated, || {
            let constants = [kernel_constant, workgroup_constant(gpu), rolled_loops(gpu)];
            gpu.compute_pipeline_with(&splatting(gpu, "glare/sky_cube/veil_splat"), &constants)
        });
        let points = self.points.get(tabulated, || {
            let constants = [kernel_constant, rolled_loops(gpu)];
            gpu.compute_pipeline_with(&projecting(gpu, "glare/sky_cube/veil_points").source(), &constants)
        });
        [points, splat]
    }
}

/// Data of a frame shared by all batches.
pub(super) struct VeilFrame {
    parameters: wgpu::Buffer,
    views: wgpu::Buffer,
    near: wgpu::Buffer,
    /// Index range of each viewport's own sources.
    near_of: Vec<std::ops::Range<u32>>,
}

impl VeilFrame {
    fn new(gpu: &Gpu, held: &Held, recording: &Recording<'_>) -> Self {
        let plan = recording.frame.plan;
        let camera_pc = plan.views.camera_pc - held.key.settings.place_pc;
        let mut near: Vec<layout::GlareSprite> = Vec::new();
        let mut near_of = Vec::new();
        let mut views = Vec::new();
        for (number, viewport) in plan.views.viewports.iter().enumerate() {
            let first = near.len() as u32;
            let eye_pc = camera_pc + viewport.eye_offset_m / PARSEC_M;
            let stars = held.sky.near_for(eye_pc, plan.views.motion, plan.air.sky.as_deref());
            near.extend(stars.into_iter().chain(points_of(plan, number)).map(|(direction, light)| {
                layout::GlareSprite {
                    direction: direction.as_vec3().to_array(),
                    inverse_squared: (1.0 / held.sky.soft.squared) as f32,
                    light: light.map(|channel| channel as f32),
                    whole: 1,
                }
            }));
            let own = first..near.len() as u32;
            views.push(held.view(viewport, own.clone()));
            near_of.push(own);
        }
        Self {
            parameters: gpu.frame_uniform("glare sky parameters", &held.parameters()),
            views: gpu.frame_uniform_list("glare views", &views, MAX_VIEWPORTS),
            near: gpu.frame_storage("near glare", &near),
            near_of,
        }
    }
}

impl SkyCube {
    /// Reserves grids of the smooth part of scattered light, over all pictures of a frame whose veil is in the sums. If the frame has plain blocks,
    /// this also reserves the grids for the glare of bodies.
    pub(in crate::render::glare) fn reserve_grids(gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let plan = frame.plan;
        targets.veil = Some(targets.reserve_points(gpu, "veil grids", point_grids(plan, SPACING)));
        if plan.plain_blocks.is_some() && has_sources(plan) {
            targets.near =
                Some(targets.reserve_points(gpu, "grids of the glare of bodies", point_grids(plan, SPACING)));
        }
    }

    /// Records the smooth part of all pictures.
    pub(super) fn record_veil_points(&mut self, recording: &mut Recording<'_>) {
        let Self { veil, held, veil_frame, .. } = self;
        let held = held_in_sums(held, recording.frame.series);
        let gpu = recording.gpu;
        let [points, _] = veil.get_or_init(VeilPasses::new).pipelines(gpu, held.inverse_square.is_none());
        let frame = veil_frame.insert(VeilFrame::new(gpu, held, recording));
        let Some(grid) = recording.targets.veil.clone() else { unreachable!("the grid must have been reserved") };
        record_points(gpu, recording, &points, (held, frame), &grid);
    }

    /// Records the veil of single sources into the sums of a batch.
    pub(super) fn record_veil(&mut self, recording: &mut Recording<'_>, number: usize) {
        let Self { veil, held, veil_frame, .. } = self;
        let held = held_in_sums(held, recording.frame.series);
        let gpu = recording.gpu;
        let [_, splat] = veil.get_or_init(VeilPasses::new).pipelines(gpu, held.inverse_square.is_none());
        let Some(frame) = veil_frame.as_ref() else { unreachable!("points must be recorded before the sums") };
        record_sources(gpu, recording, &splat, (held, frame), number);
    }
}

fn record_points(
    gpu: &Gpu,
    recording: &mut Recording<'_>,
    pipeline: &wgpu::ComputePipeline,
    (held, frame): (&Held, &VeilFrame),
    grid: &SmoothGrid,
) {
    let fraction = recording.frame.plan.glare.fraction as f32;
    let parameters = gpu.frame_uniform("veil parameters", &layout::VeilParameters { fraction, ..Default::default() });
    let points = recording.targets.grid_points(gpu);
    let buffers = [
        &parameters,
        &frame.parameters,
        &recording.targets.viewports,
        &grid.list,
        &frame.views,
        &held.map,
        &frame.near,
        &held.kernel_table,
        &points,
    ];
    let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
    pass.set_pipeline(pipeline);
    gpu.bind_tables(&mut pass, pipeline);
    pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
    dispatch_points(&mut pass, &grid.grids);
}

fn record_sources(
    gpu: &Gpu,
    recording: &mut Recording<'_>,
    pipeline: &wgpu::ComputePipeline,
    (held, frame): (&Held, &VeilFrame),
    number: usize,
) {
    let plan = recording.frame.plan;
    let tiles = plan.views.batches[number].tiles.len() as u32;
    // All invocations of a workgroup share each source that covers many pixels.
    let pixel_rad =
        plan.views.viewports.iter().map(|viewport| viewport.projection.middle_pixel_rad()).fold(PI, f64::min);
    let wide = held.chords.partition_point(|chord| *chord > WIDE_PX * pixel_rad) as u32;
    let group = workgroup(gpu);
    let sky_ranges = [(0..wide, group), (wide..held.chords.len() as u32, 1)];
    let sky_sources =
        sky_ranges.into_iter().map(|(range, shared_by)| (&held.sprites, range, EVERY_VIEWPORT, shared_by));
    let own = frame.near_of.iter().cloned().zip(0..);
    let own = own.map(|(range, viewport)| (&frame.near, range, viewport, group));
    let sources: Vec<_> = sky_sources.chain(own).filter(|(_, range, ..)| !range.is_empty()).collect();
    for (range, bright) in [(Some(plan.stars.ranges.main), false), (plan.stars.ranges.bright, true)] {
        let (Some(range), Some(sums)) = (range, recording.targets.sums(number, bright)) else { continue };
        let FixedPoint { units_per_lx, faintest_lx, brightest_lx } = range;
        let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
        pass.set_pipeline(pipeline);
        gpu.bind_tables(&mut pass, pipeline);
        for (sprites, numbers, viewport, shared_by) in &sources {
            let count = numbers.end - numbers.start;
            let [groups_per_row, rows] = dispatch_rows(gpu, (count * shared_by).div_ceil(group));
            let parameters = layout::VeilSplatParameters {
                units_per_lx: (units_per_lx * plan.glare.fraction) as f32,
                faintest_lx: faintest_lx as f32,
                brightest_lx: brightest_lx.min(f64::from(f32::MAX)) as f32,
                first: numbers.start,
                count,
                per_row: groups_per_row * group / shared_by,
                viewport: *viewport,
                shared_by: *shared_by,
            };
            let parameters = gpu.frame_uniform("veil source parameters", &parameters);
            pass.set_bind_group(0, &bind_sums(gpu, pipeline, &parameters, &sums, &[]), &[]);
            let buffers = [&frame.parameters, &frame.views, sprites, &held.kernel_table];
            pass.set_bind_group(1, &bind_in_order(gpu, pipeline, 1, &buffers), &[]);
            pass.dispatch_workgroups(groups_per_row, rows, tiles);
        }
    }
}
