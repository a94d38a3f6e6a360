//! The pass that adds air and ground to one tile.

use std::{f64::consts::FRAC_PI_2, sync::OnceLock};

use glam::DVec2;

use super::layout;
use crate::{
    gpu::{Gpu, Variants, bind_in_order},
    photometry::atmosphere::Air,
    plan::GlarePlan,
    render::{
        constants::workgroups::{AIR_ROWS, RAY_SIDE},
        layout::PointGrid,
        point_grid::dispatch_points,
        tabulated::projecting,
    },
    scene::surroundings::LocalSky,
};

/// Margin above the highest ground, as a sine. Pixels that show ground are at most this large.
const NEAR_GROUND: f64 = 0.1;

/// Pipelines of the pass.
pub(super) struct AirPass {
    /// One pipeline per form.
    pipelines: Variants<Form, wgpu::ComputePipeline>,
    points: OnceLock<wgpu::ComputePipeline>,
}

/// Form (pipeline variant) of the pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Form {
    /// Whether the ground has a picture.
    pub has_landscape: bool,
    /// Whether the light added by the air is interpolated between points of a grid: in display images with an error
    /// budget.
    pub from_grid: bool,
    /// Whether the frame has plain blocks. Their grid already contains the light of the air.
    pub has_plain: bool,
}

fn encode(sky: &LocalSky, glare: &GlarePlan, tile: u32) -> layout::AirParameters {
    let f32s = |values: [f64; 3]| values.map(|value| value as f32);
    let axis = |row: usize| sky.horizon_from_world.row(row).as_vec3().to_array();
    let mut sources = [layout::AirSource::default(); 2];
    for (encoded, source) in sources.iter_mut().zip(&sky.sources) {
        let local = sky.horizon_from_world * source.direction;
        let heading = DVec2::new(-local.z, local.x).normalize_or(DVec2::X);
        *encoded = layout::AirSource {
            direction: source.direction.as_vec3().to_array(),
            light: f32s(source.light_lx),
            heading: heading.as_vec2().to_array(),
            ..Default::default()
        };
    }
    let air_values = |value: &dyn Fn(&Air) -> [f64; 3]| sky.air.as_ref().map_or([0.0; 3], value);
    let lowest_rad = sky.air.as_ref().map_or(0.0, |air| air.scattered.lowest_rad());
    layout::AirParameters {
        tile,
        has_air: u32::from(sky.air.is_some()),
        has_ground: u32::from(sky.horizon.is_some()),
        source_count: sky.sources.len() as u32,
        east: axis(0),
        light_share: glare.share_of_smooth_surfaces() as f32,
        zenith: axis(1),
        is_flat: u32::from(sky.horizon.as_ref().is_none_or(|horizon| horizon.is_flat())),
        south: axis(2),
        above_ground: sky.highest_ground_sine().map_or(-1.0, |sine| (sine + NEAR_GROUND) as f32),
        extinction: f32s(air_values(&|air| air.extinction_log2())),
        lowest: lowest_rad as f32,
        glow: f32s(air_values(&|air| air.glow_cd_m2)),
        per_rad: (FRAC_PI_2 - lowest_rad).recip() as f32,
        ground: f32s(sky.ground_cd_m2),
        landscape_azimuth: sky.landscape.as_ref().map_or(0.0, |landscape| landscape.middle_rad() as f32),
        white: f32s(sky.white_cd_m2),
        level_sine: sky.horizon.as_ref().map_or(0.0, |horizon| horizon.level_rad().sin() as f32),
        landscape_size: sky.landscape.as_ref().map_or([0; 2], |landscape| landscape.size()),
        sources,
        ..Default::default()
    }
}

/// Returns the tables of the night sky and of scattering for a sky's sources, in the layout that the shader reads.
pub(super) fn encode_tables(sky: &LocalSky) -> Vec<[f32; 4]> {
    let nodes = sky.sources.iter().flat_map(|source| source.table.smooth.iter().chain(&source.table.aerosol));
    let night = sky.air.iter().flat_map(|air| air.scattered.night());
    night.chain(nodes).map(|[r, g, b]| [*r as f32, *g as f32, *b as f32, 0.0]).collect()
}

impl AirPass {
    pub(super) fn new() -> Self {
        Self { pipelines: Variants::new(), points: OnceLock::new() }
    }

    /// Returns the pipeline of a form. The first call creates it.
    pub(super) fn pipeline(&self, gpu: &Gpu, form: Form) -> wgpu::ComputePipeline {
        self.pipelines.get(form, || {
            let constants =
                [("HAS_LANDSCAPE", form.has_landscape), ("FROM_GRID", form.from_grid), ("HAS_PLAIN", form.has_plain)];
            let constants = constants.map(|(name, value)| (name, f64::from(u8::from(value))));
            gpu.compute_pipeline_with(&projecting(gpu, "air/light").source(), &constants)
        })
    }

    /// Returns the pipeline over the points of grids.
    pub(super) fn points_pipeline(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.points.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "air/points").source()))
    }

    /// Records the evaluation of the air's light at the points of the grids of all pictures. Buffers: viewports,
    /// tables, grids, points.
    pub(super) fn record_points(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        (sky, glare): (&LocalSky, &GlarePlan),
        grids: &[PointGrid],
        [viewports, tables, grid_buffer, points]: [&wgpu::Buffer; 4],
    ) {
        let parameters = gpu.frame_uniform("air parameters", &encode(sky, glare, 0));
        let pipeline = self.points_pipeline(gpu);
        let buffers = [&parameters, viewports, grid_buffer, tables, points];
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
        dispatch_points(pass, grids);
    }

    /// Records one tile, given its number in its batch and its size in pixels. Buffers: viewports, tiles, geometry,
    /// horizon, tables, landscape, grids, grid points, counters, grids of plain blocks.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        (sky, glare): (&LocalSky, &GlarePlan),
        form: Form,
        (tile, [width, rows]): (u32, [u32; 2]),
        buffers: [&wgpu::Buffer; 10],
    ) {
        let parameters = gpu.frame_uniform("air parameters", &encode(sky, glare, tile));
        let buffers: Vec<&wgpu::Buffer> = std::iter::once(&parameters).chain(buffers).collect();
        let pipeline = &self.pipeline(gpu, form);
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
        pass.dispatch_workgroups(width.div_ceil(RAY_SIDE), rows.div_ceil(RAY_SIDE * AIR_ROWS), 1);
    }
}
