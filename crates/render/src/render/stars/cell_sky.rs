//! The procedural sky, computed per pixel in the resolve pass. Shader: `shaders/stars/cell_sky.wgsl`; the f64 twin is
//! `crate::reference::stars::cell_sky`.

use std::sync::OnceLock;

use super::luminance::{LuminanceInputs, LuminancePass, LuminanceSource};
use crate::plan::tiles::MAX_TILES;
use crate::{
    gpu::Gpu,
    plan::{settings::CellSkySettings, stars::cell_sky::CellSkyPlan},
    render::{
        stars::layout,
        targets::{PictureTarget, tile_grid},
        technique::{Recording, begin_pass},
    },
};

/// Lazily created pass.
pub(super) struct CellSky {
    resolve: OnceLock<LuminancePass>,
}

impl CellSky {
    pub(super) fn new() -> Self {
        Self { resolve: OnceLock::new() }
    }

    /// Returns the pass, which is created at the first call.
    pub(super) fn pass(&self, gpu: &Gpu) -> &LuminancePass {
        self.resolve.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::CellSky))
    }

    /// Records the tiles of a batch one by one, since the size of a pixel depends on the viewport. Brightness is
    /// relative: 1 is the white of the configured exposure.
    pub(super) fn record_batch(&self, recording: &mut Recording<'_>, number: usize) {
        let (gpu, frame) = (recording.gpu, recording.frame);
        let resolve = self.pass(gpu);
        let Some(CellSkyPlan { settings, unit_cd_m2 }) = frame.plan.stars.cell_sky else { return };
        let CellSkySettings { cells, layers, radius_px, seed } = settings;
        let scale = unit_cd_m2 as f32;
        let batch = &recording.targets.batches[number];
        for (tile, encoded) in frame.plan.views.batches[number].tiles.iter().zip(&batch.encoded_tiles) {
            let viewport = &frame.plan.views.viewports[tile.viewport];
            let parameters = layout::CellSkyParameters {
                pixel_rad: viewport.projection.middle_pixel_rad() as f32,
                radius_px: radius_px as f32,
                cells,
                layers,
                seed,
                ..Default::default()
            };
            let parameters = gpu.frame_uniform("cell sky", &parameters);
            let encoded = gpu.frame_uniform_list("tile", std::slice::from_ref(encoded), MAX_TILES);
            let target = PictureTarget { tiles: &encoded, ..recording.targets.picture(number) };
            let source_bindings = [(0, parameters.as_entire_binding())];
            let inputs = LuminanceInputs { scale, numbers: [0, 0], source_bindings: &source_bindings };
            let mut pass = begin_pass(recording.encoder, recording.timer, "stars");
            resolve.record(gpu, &mut pass, &inputs, &target, tile_grid(tile, viewport));
        }
    }
}
