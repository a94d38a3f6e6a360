//! Ground and air around an observer (`crate::scene::surroundings`), in front of bodies and asteroids. The extinction
//! of starlight is done by the star pass.
//!
//! Shader: `shaders/air/light.wgsl`; the f64 twin is `crate::reference::air::light`.

pub(crate) mod layout;
mod light;

use std::sync::Arc;

use self::light::{AirPass, Form, encode_tables};
use super::{
    point_grid::{GridSpacing, point_grids},
    targets::Targets,
    technique::{FrameInputs, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::{
    gpu::{Gpu, GrowingBuffer, filled_buffer},
    photometry::sky_light::{SkyLight, SkyTable},
    scene::{landscape::Landscape, surroundings::Horizon},
};

/// Grid spacing. Sky light is smooth over a degree and more. Near the horizon it is less smooth, but there thick air also makes it darker.
const SPACING: GridSpacing = GridSpacing { most_rad: 0.0125, most_px: 8 };

/// The pass and the buffers that it reads.
pub(super) struct Air {
    pass: AirPass,
    horizon: GrowingBuffer,
    tables: GrowingBuffer,
    landscape: GrowingBuffer,
    stand_in: wgpu::Buffer,
    held: Option<Horizon>,
    held_tables: Vec<Arc<SkyTable>>,
    held_air: Option<Arc<SkyLight>>,
    held_landscape: Option<Arc<Landscape>>,
}

impl Air {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            pass: AirPass::new(),
            horizon: GrowingBuffer::new("horizon", usage),
            tables: GrowingBuffer::new("sky light", usage),
            landscape: GrowingBuffer::new("landscape", usage),
            stand_in: filled_buffer(
                gpu,
                "no grids",
                &[crate::render::layout::PointGrid::default(); MAX_VIEWPORTS],
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM,
            ),
            held: None,
            held_tables: Vec::new(),
            held_air: None,
            held_landscape: None,
        }
    }
}

impl Air {
    /// Records the light added by the air at the points of the grids.
    fn record_points(&self, recording: &mut Recording<'_>) {
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let (Some(sky), Some(tables)) = (&plan.air.sky, self.tables.held()) else { return };
        let Some(grid) = recording.targets.air.clone() else { return };
        let points = recording.targets.grid_points(gpu);
        let buffers = [&recording.targets.viewports, tables, &grid.list, &points];
        let mut pass = begin_pass(recording.encoder, recording.timer, "air");
        self.pass.record_points(gpu, &mut pass, (sky, &plan.glare), &grid.grids, buffers);
    }
}

impl Technique for Air {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        let Some(surroundings) = &wish.objects.surroundings else { return Vec::new() };
        let has_landscape = surroundings.ground.as_ref().is_some_and(|ground| ground.landscape.is_some());
        let mut jobs = Vec::new();
        let has_budget = wish.forecast.draws_outputs_apart;
        let mut add = |from_grid, has_plain| {
            let form = Form { has_landscape, from_grid, has_plain };
            jobs.push(PipelineJob::new("air and ground", move || self.pass.pipeline(gpu, form)));
        };
        if !has_budget || wish.made.hdr || wish.made.hdr_stays {
            add(false, false);
        }
        if has_budget {
            wish.forecast.plain_forms().iter().for_each(|&has_plain| add(true, has_plain));
            jobs.push(PipelineJob::new("light of the sky", move || {
                self.pass.points_pipeline(gpu);
            }));
        }
        jobs
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(sky) = &frame.plan.air.sky else { return };
        if frame.plan.air.from_grid {
            targets.air = Some(targets.reserve_points(gpu, "air grids", point_grids(frame.plan, SPACING)));
        }
        if self.horizon.held().is_none() || self.held != sky.horizon {
            let horizon = sky.horizon.clone();
            self.horizon.upload(gpu, &horizon.clone().unwrap_or_default().sines());
            self.held = horizon;
        }
        let is_same = match (&self.held_landscape, &sky.landscape) {
            (Some(held), Some(landscape)) => Arc::ptr_eq(held, landscape),
            (None, None) => true,
            _ => false,
        };
        if !is_same || self.landscape.held().is_none() {
            let words = sky.landscape.as_ref().map_or_else(|| vec![0], |landscape| landscape.words());
            self.landscape.upload(gpu, &words);
            self.held_landscape.clone_from(&sky.landscape);
        }
        let tables: Vec<Arc<SkyTable>> = sky.sources.iter().map(|source| Arc::clone(&source.table)).collect();
        let are_same = tables.iter().zip(&self.held_tables).all(|(a, b)| Arc::ptr_eq(a, b));
        let air = sky.air.as_ref().map(|air| Arc::clone(&air.scattered));
        let is_same_air = air.as_ref().map(Arc::as_ptr) == self.held_air.as_ref().map(Arc::as_ptr);
        if !are_same || !is_same_air || tables.len() != self.held_tables.len() || self.tables.held().is_none() {
            let nodes = encode_tables(sky);
            // A binding must hold at least one item.
            self.tables.upload(gpu, if nodes.is_empty() { &[[0.0_f32; 4]] } else { &nodes[..] });
            self.held_tables = tables;
            self.held_air = air;
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        let (batch, index) = match phase {
            Phase::Points => return self.record_points(recording),
            Phase::Geometry(batch, index) => (batch, index),
            _ => return,
        };
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let targets = &*recording.targets;
        let (Some(sky), Some(geometry)) = (&plan.air.sky, &targets.batches[batch].geometry) else { return };
        let held = (self.horizon.held(), self.tables.held(), self.landscape.held());
        let (Some(horizon), Some(tables), Some(landscape)) = held else { return };
        let tile = &plan.views.batches[batch].tiles[index];
        let width = plan.views.viewports[tile.viewport].size()[0];
        let (grids, points) = match (&targets.air, targets.held_points()) {
            (Some(grid), Some(points)) => (&grid.list, points),
            _ => (&self.stand_in, &self.stand_in),
        };
        let tiles_of_batch = &targets.batches[batch].tiles;
        let (counters, plain) = (&targets.counters, targets.plain_list());
        let buffers =
            [&targets.viewports, tiles_of_batch, geometry, horizon, tables, landscape, grids, points, counters, plain];
        let form = Form {
            has_landscape: sky.landscape.is_some(),
            from_grid: targets.air.is_some(),
            has_plain: targets.plain.is_some(),
        };
        let mut pass = begin_pass(recording.encoder, recording.timer, "air");
        self.pass.record(gpu, &mut pass, (sky, &plan.glare), form, (index as u32, [width, tile.rows]), buffers);
    }

    fn release(&mut self) {
        self.horizon.release();
        self.tables.release();
        self.landscape.release();
        self.held = None;
        self.held_tables.clear();
        self.held_landscape = None;
    }
}
