//! Overlays: lines and text drawn over display images after tone mapping. They are not drawn onto HDR images, or onto textures that contain light
//! instead of display codes.
//!
//! The plan (`crate::plan::overlay`) holds the items in pixels and the blocks of pixels that they touch. It is uploaded
//! when it differs from the plan of the last frame; an unchanged plan creates and uploads nothing.

mod draw;
pub(super) mod layout;

use std::sync::Arc;

use self::draw::{BatchBlocks, OverlayPass};
use super::{
    RenderError,
    constants::overlay as constants,
    targets::Targets,
    technique::{FrameInputs, Holding, Phase, Recording, Technique, begin_pass},
};
use crate::{
    gpu::{Gpu, GrowingBuffer},
    plan::overlay::{Item, OverlayPlan, Shape, blocks::BLOCK_PX},
};

/// Buffers of overlays; empty without overlays.
pub(super) struct Overlay {
    pass: Option<OverlayPass>,
    /// Plan in the buffers.
    plan: Option<Arc<OverlayPlan>>,
    /// Batches to whose tiles the blocks were assigned.
    batches: Vec<crate::plan::tiles::Batch>,
    items: GrowingBuffer,
    texels: GrowingBuffer,
    entries: GrowingBuffer,
    blocks: Vec<BatchBlocks>,
}

impl Overlay {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            pass: None,
            plan: None,
            batches: Vec::new(),
            items: GrowingBuffer::new("overlay items", usage),
            texels: GrowingBuffer::new("overlay texels", usage),
            entries: GrowingBuffer::new("overlay entries", usage),
            blocks: Vec::new(),
        }
    }

    fn upload(&mut self, gpu: &Gpu, plan: &Arc<OverlayPlan>, batches: &[crate::plan::tiles::Batch]) {
        let same_plan = self.plan.as_ref().is_some_and(|held| Arc::ptr_eq(held, plan));
        if same_plan && self.batches == batches {
            return;
        }
        let items: Vec<layout::OverlayItem> = plan.items.iter().map(encode_item).collect();
        self.items.upload(gpu, &items);
        self.entries.upload(gpu, &plan.entries);
        let mut texels = plan.texels.clone();
        texels.resize(texels.len().next_multiple_of(4), 0);
        self.texels.upload(gpu, &texels);
        self.blocks.truncate(batches.len());
        self.blocks.resize_with(batches.len(), BatchBlocks::new);
        for (held, batch) in self.blocks.iter_mut().zip(batches) {
            held.upload(gpu, &blocks_of(plan, batch));
        }
        self.plan = Some(Arc::clone(plan));
        self.batches = batches.to_vec();
    }
}

/// Returns the blocks of a batch. A block shared by two tiles is listed twice.
fn blocks_of(plan: &OverlayPlan, batch: &crate::plan::tiles::Batch) -> Vec<layout::OverlayBlock> {
    let mut blocks = Vec::new();
    for (number, tile) in batch.tiles.iter().enumerate() {
        let rows = tile.first_row..tile.first_row + tile.rows;
        let in_tile = plan.blocks.iter().filter(|block| {
            let top = block.corner[1];
            block.viewport as usize == tile.viewport && top < rows.end && top + BLOCK_PX > rows.start
        });
        blocks.extend(in_tile.map(|block| layout::OverlayBlock {
            corner: block.corner,
            tile: number as u32,
            first_entry: block.first_entry,
            entries: block.entries,
            ..Default::default()
        }));
    }
    blocks
}

fn encode_item(item: &Item) -> layout::OverlayItem {
    let [red, green, blue] = item.ink.colour.0.map(u32::from);
    let near = |nearness: f64| nearness.min(f64::from(constants::NEAREST)) as f32;
    let corners = |from: [i32; 2], to: [i32; 2]| (from.map(|side| side as f32), to.map(|side| side as f32));
    let mut encoded = layout::OverlayItem {
        nearness: [constants::NEAREST; 2],
        opacity: item.ink.opacity as f32,
        colour: red | green << 8 | blue << 16,
        stroke: item.stroke,
        ..Default::default()
    };
    match item.shape {
        Shape::Line { from, to, half_width_px, nearness } => {
            (encoded.begin, encoded.end) = (from.as_vec2().to_array(), to.as_vec2().to_array());
            encoded.half_width_px = half_width_px as f32;
            encoded.nearness = nearness.map(near);
            encoded.shape = constants::SHAPE_LINE;
        }
        Shape::Box { from, to, checkered } => {
            (encoded.begin, encoded.end) = corners(from, to);
            encoded.shape = if checkered { constants::SHAPE_CHECKERS } else { constants::SHAPE_BOX };
        }
        Shape::Glyph { from, size, first_texel, nearness } => {
            (encoded.begin, encoded.end) = corners(from, [from[0] + size[0] as i32, from[1] + size[1] as i32]);
            encoded.nearness = [near(nearness); 2];
            encoded.first_texel = first_texel;
            encoded.shape = constants::SHAPE_GLYPH;
        }
        Shape::Picture { from, to, header, nearness } => {
            (encoded.begin, encoded.end) = corners(from, to);
            encoded.nearness = [near(nearness); 2];
            encoded.first_texel = header;
            encoded.shape = constants::SHAPE_PICTURE;
        }
    }
    encoded
}

impl Technique for Overlay {
    fn hold(&mut self, holding: &Holding<'_>) -> Result<(), RenderError> {
        if holding.scene.objects.overlay.is_empty() {
            self.release();
            return Ok(());
        }
        let has_geometry = !holding.scene.objects.is_empty();
        if self.pass.as_ref().is_none_or(|pass| pass.has_geometry != has_geometry) {
            self.pass = Some(OverlayPass::new(holding.gpu, has_geometry));
        }
        Ok(())
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, _targets: &mut Targets) {
        if let Some(plan) = &frame.plan.overlay {
            self.upload(gpu, plan, &frame.plan.views.batches);
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        if phase != Phase::Overlay || recording.frame.plan.overlay.is_none() {
            return;
        }
        let Some(overlay_pass) = &self.pass else { return };
        let (Some(items), Some(texels), Some(entries)) = (self.items.held(), self.texels.held(), self.entries.held())
        else {
            return;
        };
        let Recording { gpu, encoder, timer, targets, .. } = recording;
        for (number, blocks) in self.blocks.iter_mut().enumerate() {
            let Some(display) = &targets.batches[number].display else { continue };
            if blocks.count == 0 {
                continue;
            }
            let batch = &targets.batches[number];
            let occlusion = targets.occlusion(number);
            let buffers = [&targets.viewports, &batch.tiles, display, occlusion.geometry, items, texels, entries];
            let mut pass = begin_pass(encoder, timer, "overlay");
            overlay_pass.record(gpu, &mut pass, blocks, &buffers);
        }
    }

    fn release(&mut self) {
        *self = Self::new();
    }
}
