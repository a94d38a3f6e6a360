//! The ground and the air around an observer (`crate::scene::surroundings`), over what bodies and asteroids show. What air takes of the light of stars is the star pass's own business.
//! Shader: `shaders/air/light.wgsl`; the f64 twin is `crate::reference::air::light`.

pub(crate) mod layout;
mod light;

use std::sync::{Arc, OnceLock};

use self::light::{AirPass, encode_tables};
use super::{
    targets::Targets,
    technique::{FrameInputs, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::{
    gpu::{Gpu, GrowingBuffer},
    photometry::sky_light::SkyTable,
    scene::{landscape::Landscape, surroundings::Horizon},
};

/// The pass, made when it is first asked for, and the horizon.
pub(super) struct Air {
    pass: OnceLock<AirPass>,
    horizon: GrowingBuffer,
    tables: GrowingBuffer,
    landscape: GrowingBuffer,
    held: Option<Horizon>,
    held_tables: Vec<Arc<SkyTable>>,
    held_landscape: Option<Arc<Landscape>>,
}

impl Air {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            pass: OnceLock::new(),
            horizon: GrowingBuffer::new("horizon", usage),
            tables: GrowingBuffer::new("sky light", usage),
            landscape: GrowingBuffer::new("landscape", usage),
            held: None,
            held_tables: Vec::new(),
            held_landscape: None,
        }
    }

    fn pass(&self, gpu: &Gpu) -> &AirPass {
        self.pass.get_or_init(|| AirPass::new(gpu))
    }
}

impl Technique for Air {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        if wish.objects.surroundings.is_none() {
            return Vec::new();
        }
        vec![PipelineJob::new("air and ground", move || {
            self.pass(gpu);
        })]
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, _targets: &mut Targets) {
        let Some(sky) = &frame.plan.local_sky else { return };
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
        if !are_same || tables.len() != self.held_tables.len() || self.tables.held().is_none() {
            let nodes = encode_tables(sky);
            // Bindings must hold one item at least.
            self.tables.upload(gpu, if nodes.is_empty() { &[[0.0_f32; 4]] } else { &nodes[..] });
            self.held_tables = tables;
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        let Phase::Geometry(batch, index) = phase else { return };
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let targets = &*recording.targets;
        let (Some(sky), Some(geometry)) = (&plan.local_sky, &targets.batches[batch].geometry) else { return };
        let held = (self.horizon.held(), self.tables.held(), self.landscape.held());
        let (Some(horizon), Some(tables), Some(landscape)) = held else { return };
        let tile = &plan.batches[batch].tiles[index];
        let width = plan.viewports[tile.viewport].size()[0];
        let buffers = [&targets.viewports, &targets.batches[batch].tiles, geometry, horizon, tables, landscape];
        let mut pass = begin_pass(recording.encoder, recording.timer, "air");
        self.pass(gpu).record(gpu, &mut pass, sky, &plan.glare, (index as u32, [width, tile.rows]), buffers);
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
