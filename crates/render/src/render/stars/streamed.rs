//! Leaves of a deep store that do not fit into the memory together. They are read, uploaded and drawn in turns.
//!
//! No shader: the star pass draws them.
//! No twin: the twin of the star pass has all stars.

use rayon::prelude::*;

use super::{
    items::{ItemBuffers, ItemSource, Items, StarDraw, push_pages},
    pages::PageBuffers,
    splat::StarPass,
};
use crate::{
    catalogue::deep::{
        DeepError,
        live::{DeepSky, PageKey, PageStar},
    },
    plan::{
        PlanError,
        stars::deep::{DeepPlan, VisiblePage},
    },
    render::{RenderError, technique::Recording},
};

/// Share of the device's memory that the stars of a turn may take; the rest is for gaps in the buffers.
const SHARE_OF_A_TURN: f64 = 0.8;

/// Buffers of a turn.
pub(super) struct StreamedPages {
    pages: PageBuffers,
    items: ItemBuffers,
    /// Reason why the frame lacks stars.
    problem: Option<String>,
}

/// Divides leaves into turns. A turn has at most this number of bytes, or a single leaf.
fn turns(sky: &DeepSky, keys: &[(PageKey, u64)], most_bytes: u64) -> Vec<Vec<(PageKey, u64)>> {
    let mut turns: Vec<Vec<(PageKey, u64)>> = Vec::new();
    let mut bytes = u64::MAX;
    for (key, viewports) in keys {
        let of_key = u64::from(key.stars(sky.store())) * size_of::<PageStar>() as u64;
        if bytes.saturating_add(of_key) > most_bytes {
            turns.push(Vec::new());
            bytes = 0;
        }
        bytes += of_key;
        turns.last_mut().expect("a turn").push((*key, *viewports));
    }
    turns
}

impl StreamedPages {
    pub(super) fn new() -> Self {
        Self { pages: PageBuffers::default(), items: ItemBuffers::new(), problem: None }
    }

    /// Begins a frame.
    pub(super) fn begin(&mut self) {
        self.problem = None;
    }

    /// Fails if stars of the frame could not be read.
    pub(super) fn result(&self) -> Result<(), RenderError> {
        self.problem.clone().map_or(Ok(()), |problem| Err(PlanError::DeepDamaged(problem).into()))
    }

    /// Draws the leaves of a plan into the sums of a batch. Everything that was recorded earlier is submitted.
    pub(super) fn record(&mut self, recording: &mut Recording<'_>, batch: usize, pass: &StarPass) {
        let deep = &recording.frame.plan.stars.deep;
        let Some(sky) = deep.sky.as_ref().filter(|_| !deep.streamed.is_empty()) else { return };
        let most_bytes = (SHARE_OF_A_TURN * deep.device_bytes as f64) as u64;
        for turn in turns(sky, &deep.streamed, most_bytes) {
            if let Err(problem) = self.draw(recording, batch, pass, (sky, &turn)) {
                self.problem = Some(problem);
                return;
            }
        }
        self.pages = PageBuffers::default();
    }

    fn draw(
        &mut self,
        recording: &mut Recording<'_>,
        batch: usize,
        star_pass: &StarPass,
        (sky, turn): (&DeepSky, &[(PageKey, u64)]),
    ) -> Result<(), String> {
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        // Draw the previous turn.
        let next = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("streamed stars") });
        let before = std::mem::replace(recording.encoder, next);
        let submitted = gpu.queue.submit([before.finish()]);
        // Read the stars on all cores meanwhile.
        let read = |(key, viewports): &(PageKey, u64)| {
            let page = sky.read(*key)?;
            let count = page.stars.len() as u32;
            Ok(VisiblePage { page, viewports: *viewports, count })
        };
        let visible = turn.par_iter().map(read).collect::<Result<Vec<_>, DeepError>>();
        let visible = visible.map_err(|error| error.to_string())?;
        // The buffers can be filled again only after the previous turn is drawn.
        gpu.wait(Some(submitted)).map_err(|error| error.to_string())?;
        // Upload and draw them.
        let turn = DeepPlan { visible, device_bytes: plan.stars.deep.device_bytes, ..DeepPlan::default() };
        let places = self.pages.hold(gpu, &turn);
        let mut items = Items::default();
        push_pages(&mut items, &turn.visible, &places, self.pages.segments(), &plan.views.batches);
        self.items.items.upload(gpu, &items.items);
        let Some(held) = self.items.items.held() else { return Ok(()) };
        let of_batch = items.runs.iter().filter(|run| run.batch == batch);
        let draws: Vec<StarDraw<'_>> = of_batch
            .filter_map(|run| {
                let ItemSource::Segment(segment) = run.source else { return None };
                Some(run.draw(self.pages.buffer(segment), held))
            })
            .collect();
        let Some(sums) = recording.targets.sums(batch, false) else { return Ok(()) };
        let descriptor = wgpu::ComputePassDescriptor { label: Some("streamed stars"), timestamp_writes: None };
        let mut pass = recording.encoder.begin_compute_pass(&descriptor);
        star_pass.record(gpu, &mut pass, (&plan.stars.ranges.main, false), plan, &sums, &draws);
        Ok(())
    }
}
