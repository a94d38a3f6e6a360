//! Encodes sources of glare that belong to one eye, and records the pass that scatters the light of bodies in display
//! images whose veil is in the sums. Shader: `shaders/glare/sky_cube/objects.wgsl`.
//!
//! No twin: reference/glare/sky_cube.rs, which adds the glare source by source.

use std::f64::consts::PI;

use super::{SkyCube, held_in_sums, map::Held, record::Variant};
use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::{
    gpu::{Gpu, Variants, bind_in_order},
    photometry::glare::GlareKernel,
    plan::{
        Plan,
        glare::objects::{ExtendedSource, PointOfLight, Source},
    },
    render::{
        constants::extended_sources::{IS_EXTENDED, SHARE_PARTS},
        glare::layout,
        point_grid::dispatch_points,
        shader::rolled_loops,
        tabulated::projecting,
        targets::{row_groups, workgroups},
        technique::{Recording, begin_pass},
    },
};

/// Distance from a source, in grid spacings, within which its glare is too steep for interpolation.
const SPACINGS_BESIDE: f32 = 3.0;

/// Returns the chord of an angle on the unit sphere.
fn chord(angle_rad: f64) -> f64 {
    2.0 * (0.5 * angle_rad.min(PI)).sin()
}

/// Encodes a source of one eye.
pub(super) fn encode_near((direction, light): PointOfLight, reach: f64, parts: u32) -> layout::GlareNear {
    layout::GlareNear {
        direction: direction.as_vec3().to_array(),
        reach: reach as f32,
        light: light.map(|channel| channel as f32),
        parts,
    }
}

/// Encodes an extended source of one eye. It is at least as wide as the kernel's core, so that its own image has a
/// width.
fn encode_extended(source: &ExtendedSource, kernel: &dyn GlareKernel) -> layout::GlareNear {
    let radius_rad = source.radius_rad.max(kernel.inner_rad());
    // The softened kernel omits the share of the kernel within the radius.
    let share = (kernel.share_within(radius_rad).clamp(0.0, 1.0) * f64::from(SHARE_PARTS)).round() as u32;
    encode_near((source.direction, source.light), chord(radius_rad).powi(2), IS_EXTENDED | share)
}

/// Returns the glare sources of each body for the eye of a viewport.
fn body_sources(plan: &Plan, viewport: usize) -> impl Iterator<Item = &Source> {
    plan.bodies.as_ref().and_then(|plan| plan.glare.get(viewport)).into_iter().flatten()
}

/// Returns the bodies that are points for an eye. Their veil is computed like that of stars.
pub(super) fn points_of(plan: &Plan, viewport: usize) -> impl Iterator<Item = PointOfLight> {
    body_sources(plan, viewport).filter(|source| source.parts.is_empty()).map(|source| source.whole)
}

/// Returns the sources of glare from bodies and asteroid fields for the eye of a viewport. Those of [`points_of`] are included only if `with_points`
/// is true.
pub(super) fn object_sources(
    plan: &Plan,
    viewport: usize,
    kernel: &dyn GlareKernel,
    with_points: bool,
) -> Vec<layout::GlareNear> {
    let mut near = Vec::new();
    for source in body_sources(plan, viewport).filter(|source| with_points || !source.parts.is_empty()) {
        near.push(encode_near(source.whole, chord(source.reach_rad), source.parts.len() as u32));
        let soft = chord(source.soft_rad).powi(2);
        near.extend(source.parts.iter().map(|part| encode_near(*part, soft, 0)));
    }
    let extended = plan.glare.extended_sources.get(viewport);
    near.extend(extended.into_iter().flatten().map(|source| encode_extended(source, kernel)));
    near
}

/// Whether bodies or fields scatter light in an eye, apart from those of [`points_of`].
pub(super) fn has_sources(plan: &Plan) -> bool {
    let has_bodies = |viewport| body_sources(plan, viewport).any(|source| !source.parts.is_empty());
    (0..plan.views.viewports.len()).any(has_bodies)
        || plan.glare.extended_sources.iter().any(|sources| !sources.is_empty())
}

/// Pipelines of the pass, by form.
pub(super) type ObjectPasses = Variants<(Variant, bool), wgpu::ComputePipeline>;

/// Returns the pipeline of a form, which skips plain blocks if the frame has any.
pub(super) fn pipeline(passes: &ObjectPasses, gpu: &Gpu, variant: Variant, has_plain: bool) -> wgpu::ComputePipeline {
    passes.get((variant, has_plain), || {
        let own = [("ROW_GROUPS", f64::from(row_groups(gpu))), ("HAS_PLAIN", f64::from(u8::from(has_plain)))];
        let constants = [&variant.constants(gpu)[..], &own].concat();
        gpu.compute_pipeline_with(&projecting(gpu, "glare/sky_cube/objects").source(), &constants)
    })
}

/// Returns the pipeline of the pass over points, with or without a kernel table.
pub(super) fn points_pipeline(
    passes: &Variants<bool, wgpu::ComputePipeline>,
    gpu: &Gpu,
    tabulated: bool,
) -> wgpu::ComputePipeline {
    passes.get(tabulated, || {
        let constants = [("TABULATED", f64::from(u8::from(tabulated))), rolled_loops(gpu)];
        gpu.compute_pipeline_with(&projecting(gpu, "glare/sky_cube/near_points").source(), &constants)
    })
}

/// Glare sources and view parameters of every viewport of a frame.
pub(super) struct ObjectFrame {
    near: wgpu::Buffer,
    views: wgpu::Buffer,
}

impl ObjectFrame {
    fn new(gpu: &Gpu, held: &Held, plan: &Plan) -> Self {
        let mut near: Vec<layout::GlareNear> = Vec::new();
        let view = |(number, viewport)| {
            let first = near.len() as u32;
            near.extend(object_sources(plan, number, &*held.key.kernel, false));
            held.view(viewport, first..near.len() as u32)
        };
        let views: Vec<layout::GlareView> = plan.views.viewports.iter().enumerate().map(view).collect();
        Self {
            near: gpu.frame_storage("near glare", &near),
            views: gpu.frame_uniform_list("glare views", &views, MAX_VIEWPORTS),
        }
    }
}

impl SkyCube {
    /// Records the glare of bodies at the points of the grids of plain blocks.
    pub(super) fn record_near_points(&mut self, recording: &mut Recording<'_>) {
        let Self { near_points, held, object_frame, .. } = self;
        let held = held_in_sums(held, recording.frame.series);
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let frame_buffers = object_frame.insert(ObjectFrame::new(gpu, held, plan));
        let Some(grid) = recording.targets.near.clone() else { return };
        let parameters = layout::NearPointParameters {
            fraction: plan.glare.fraction as f32,
            spacings_beside: SPACINGS_BESIDE,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("near point parameters", &parameters);
        let sky_parameters = gpu.frame_uniform("glare sky parameters", &held.parameters());
        let pipeline = points_pipeline(near_points, gpu, held.inverse_square.is_none());
        let points = recording.targets.grid_points(gpu);
        let buffers = [
            &parameters,
            &sky_parameters,
            &recording.targets.viewports,
            &grid.list,
            &frame_buffers.views,
            &frame_buffers.near,
            &held.kernel_table,
            &points,
        ];
        let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
        pass.set_pipeline(&pipeline);
        gpu.bind_tables(&mut pass, &pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, &pipeline, 0, &buffers), &[]);
        dispatch_points(&mut pass, &grid.grids);
    }

    /// Records the pass over the surfaces of a batch.
    pub(super) fn record_objects(&mut self, recording: &mut Recording<'_>, number: usize) {
        let Some(geometry) = recording.targets.batches[number].geometry.clone() else { return };
        let Self { objects, held, object_frame, .. } = self;
        let held = held_in_sums(held, recording.frame.series);
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let Some(frame_buffers) = object_frame.as_ref() else {
            unreachable!("points must be recorded before surfaces")
        };
        let variant = Variant::new(&plan.glare.map, &plan.views.all_viewports);
        let pipeline = pipeline(objects, gpu, variant, recording.targets.plain.is_some());
        let fraction = plan.glare.fraction as f32;
        let parameters = layout::ObjectGlareParameters { fraction, ..Default::default() };
        let parameters = gpu.frame_uniform("object glare parameters", &parameters);
        let sky_parameters = gpu.frame_uniform("glare sky parameters", &held.parameters());
        let points = recording.targets.grid_points(gpu);
        let targets = &*recording.targets;
        let tiles = &targets.batches[number].tiles;
        let plain = targets.plain_list();
        let over_pixels = [&parameters, &targets.viewports, tiles, &geometry, &targets.counters, plain, &points];
        let source_buffers = [&sky_parameters, &frame_buffers.views, &frame_buffers.near, &held.kernel_table];
        let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
        pass.set_pipeline(&pipeline);
        gpu.bind_tables(&mut pass, &pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, &pipeline, 0, &over_pixels), &[]);
        pass.set_bind_group(1, &bind_in_order(gpu, &pipeline, 1, &source_buffers), &[]);
        let [columns, rows, tiles] = workgroups(recording.targets.batches[number].grid, row_groups(gpu));
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}
