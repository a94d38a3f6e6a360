//! The star pass: splats every visible star in illuminance, in fixed point. Shader: `shaders/stars.wgsl`; the f64 twin is
//! `crate::reference::stars`.

use super::shared::{StarDraw, StarTarget, bind_buffers, bind_items, dispatch_rows};
use crate::{
    catalogue::packed::{TEMPERATURE_STEPS, temperature_of_step_k},
    gpu::{self, Gpu, layout},
    photometry::blackbody::rec709_in_gamut,
    plan::range::FixedPoint,
};

/// Stars per workgroup at most.
pub(crate) const ITEM_STARS: u32 = 256;
/// Counter of sums that overflowed.
pub(crate) const OVERFLOW_COUNTER: usize = 0;
/// First of the counters of stars drawn, one per view.
pub(crate) const FIRST_VIEW_COUNTER: usize = 1;

/// The pass.
pub(crate) struct StarPass {
    pipeline: wgpu::ComputePipeline,
    colours: wgpu::Buffer,
}

/// The table of colours that star passes read.
fn colour_table(gpu: &Gpu) -> wgpu::Buffer {
    let colours: Vec<[f32; 4]> = (0..TEMPERATURE_STEPS)
        .map(|step| {
            let [r, g, b] = rec709_in_gamut(temperature_of_step_k(step)).map(|channel| channel as f32);
            [r, g, b, 0.0]
        })
        .collect();
    gpu::storage_buffer(gpu, "star colours", &colours)
}

impl StarPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let workgroup = if gpu.software { 8.0 } else { 64.0 };
        Self {
            pipeline: gpu.compute_pipeline_with(&gpu::stars(gpu.wide_accumulator), &[("WORKGROUP", workgroup)]),
            colours: colour_table(gpu),
        }
    }

    /// Colours of luminance 1 for every step of temperature.
    pub(crate) fn colours(&self) -> &wgpu::Buffer {
        &self.colours
    }

    /// Records the draws of one range of brightness into one batch.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        range: &FixedPoint,
        target: &StarTarget<'_>,
        high_words: &wgpu::Buffer,
        draws: &[StarDraw<'_>],
    ) {
        pass.set_pipeline(&self.pipeline);
        for draw in draws {
            let [items_per_row, rows] = dispatch_rows(gpu, draw.item_count);
            let parameters = layout::StarParameters {
                units_per_lx: range.units_per_lx as f32,
                faintest_lx: range.faintest_lx as f32,
                brightest_lx: range.brightest_lx as f32,
                item_count: draw.item_count,
                items_per_row,
                ..Default::default()
            };
            let parameters = gpu::uniform_buffer(gpu, "star parameters", &parameters);
            let target_group = bind_buffers(
                gpu,
                &self.pipeline,
                0,
                &[
                    (0, parameters.as_entire_binding()),
                    (1, target.viewports.as_entire_binding()),
                    (2, target.tiles.as_entire_binding()),
                    (3, target.counters.as_entire_binding()),
                    (4, target.pixels.as_entire_binding()),
                    (5, self.colours.as_entire_binding()),
                    (6, high_words.as_entire_binding()),
                ],
            );
            pass.set_bind_group(0, &target_group, &[]);
            pass.set_bind_group(1, &bind_items(gpu, &self.pipeline, draw), &[]);
            pass.dispatch_workgroups(items_per_row, rows, 1);
        }
    }
}
