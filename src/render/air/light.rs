//! The pass over a tile.

use glam::DVec2;

use super::layout;
use crate::{
    gpu::{Gpu, bind_in_order},
    photometry::atmosphere::Air,
    plan::GlarePlan,
    render::{constants::workgroups::RAY_SIDE, tabulated::projecting},
    scene::surroundings::LocalSky,
};

/// The pass.
pub(super) struct AirPass {
    pipeline: wgpu::ComputePipeline,
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
    let of_air = |of: &dyn Fn(&Air) -> [f64; 3]| sky.air.as_ref().map_or([0.0; 3], of);
    layout::AirParameters {
        tile,
        has_air: u32::from(sky.air.is_some()),
        has_ground: u32::from(sky.horizon.is_some()),
        source_count: sky.sources.len() as u32,
        east: axis(0),
        light_share: glare.share_of_smooth_light() as f32,
        zenith: axis(1),
        is_flat: u32::from(sky.horizon.as_ref().is_none_or(|horizon| horizon.is_flat())),
        south: axis(2),
        extinction: f32s(of_air(&|air| air.extinction_log2())),
        // Without what the first air mass takes, which the shader takes with the others.
        glow: f32s(of_air(&|air| {
            let log2 = air.extinction_log2();
            [0, 1, 2].map(|c| air.glow_cd_m2[c] * (-log2[c]).exp2())
        })),
        ground: f32s(sky.ground_cd_m2),
        landscape_azimuth: sky.landscape.as_ref().map_or(0.0, |landscape| landscape.middle_rad() as f32),
        white: f32s(sky.white_cd_m2),
        landscape_size: sky.landscape.as_ref().map_or([0; 2], |landscape| landscape.size()),
        sources,
        ..Default::default()
    }
}

/// The tables of a sky's sources, as the shader reads them.
pub(super) fn encode_tables(sky: &LocalSky) -> Vec<[f32; 4]> {
    let nodes = sky.sources.iter().flat_map(|source| source.table.smooth.iter().chain(&source.table.aerosol));
    nodes.map(|[r, g, b]| [*r as f32, *g as f32, *b as f32, 0.0]).collect()
}

impl AirPass {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline(&projecting(gpu, "air/light").source()) }
    }

    /// Records one tile: its number in its batch, and its size in pixels. Buffers: viewports, tiles, geometry, the horizon, tables, the landscape.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        sky: &LocalSky,
        glare: &GlarePlan,
        (tile, [width, rows]): (u32, [u32; 2]),
        [viewports, tiles, geometry, horizon, tables, landscape]: [&wgpu::Buffer; 6],
    ) {
        let parameters = gpu.frame_uniform("air parameters", &encode(sky, glare, tile));
        let buffers = [&parameters, viewports, tiles, geometry, horizon, tables, landscape];
        pass.set_pipeline(&self.pipeline);
        gpu.bind_tables(pass, &self.pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, &self.pipeline, 0, &buffers), &[]);
        pass.dispatch_workgroups(width.div_ceil(RAY_SIDE), rows.div_ceil(RAY_SIDE), 1);
    }
}
