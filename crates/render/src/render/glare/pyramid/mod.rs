//! Records the published glare pyramids, viewport by viewport, each from its own finished picture.

mod passes;

use std::sync::OnceLock;

use self::passes::{GlarePyramidPass, PyramidFrame, PyramidTextures, PyramidTile};
use super::composite::{GlareCompositePass, GlareSource};
use crate::plan::tiles::MAX_TILES;
use crate::{
    gpu::{Gpu, GrowingBuffer},
    plan::{Plan, glare::pyramid::PyramidAxes, tiles::Tile},
    render::{
        glare::layout,
        targets::{BatchTargets, PictureTarget, Targets, tile_grid},
        technique::{PipelineJob, Recording, Wish, begin_pass},
    },
    view::Viewport,
};

/// Lazily created passes and textures of the pyramids.
pub(super) struct GlarePyramid {
    screen: OnceLock<GlarePyramidPass>,
    view: OnceLock<GlarePyramidPass>,
    composite: OnceLock<GlareCompositePass>,
    maximum: GrowingBuffer,
    /// One pyramid per picture size. The viewports of a frame use it one after the other.
    textures: Vec<([u32; 2], PyramidTextures)>,
}

/// Tile of the current viewport.
struct Place<'a> {
    batch: &'a BatchTargets,
    tile: &'a Tile,
    encoded: layout::Tile,
}

impl GlarePyramid {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            screen: OnceLock::new(),
            view: OnceLock::new(),
            composite: OnceLock::new(),
            maximum: GrowingBuffer::new("glare maximum", usage),
            textures: Vec::new(),
        }
    }

    /// Returns jobs that create the pipelines for the given axes.
    pub(super) fn pipelines<'a>(&'a self, wish: &Wish<'a>, axes: PyramidAxes) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        vec![
            PipelineJob::new("glare pyramid", move || {
                self.pass(gpu, axes);
            }),
            PipelineJob::new("glare", move || {
                self.composite(gpu);
            }),
        ]
    }

    fn pass(&self, gpu: &Gpu, axes: PyramidAxes) -> &GlarePyramidPass {
        let pass = match axes {
            PyramidAxes::Screen => &self.screen,
            PyramidAxes::View => &self.view,
        };
        pass.get_or_init(|| GlarePyramidPass::new(gpu, axes))
    }

    fn composite(&self, gpu: &Gpu) -> &GlareCompositePass {
        self.composite.get_or_init(|| GlareCompositePass::new(gpu, GlareSource::Pyramid, &[]))
    }

    /// Releases buffers and textures.
    pub(super) fn release(&mut self) {
        self.textures.clear();
        self.maximum.release();
    }

    /// Records the glare of a frame along the given axes.
    pub(super) fn record(&mut self, recording: &mut Recording<'_>, axes: PyramidAxes) {
        let gpu = recording.gpu;
        let frame = recording.frame;
        let viewports = &frame.plan.views.viewports;
        // Textures for each picture size.
        self.textures.retain(|(size, _)| viewports.iter().any(|viewport| viewport.size() == *size));
        for size in viewports.iter().map(Viewport::size) {
            if self.textures.iter().all(|(held, _)| *held != size) {
                self.textures.push((size, PyramidTextures::new(gpu, size)));
            }
        }
        let maximum = self.maximum.with_room(gpu, 16).clone();
        let maximum = &maximum;
        let (pyramid, composite) = (self.pass(gpu, axes), self.composite(gpu));
        // Brightest channel of the frame.
        recording.encoder.clear_buffer(maximum, 0, None);
        let targets = &*recording.targets;
        let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
        for batch in &targets.batches {
            pyramid.find_maximum(gpu, &mut pass, &targets.viewports, batch, maximum);
        }
        // Pyramid of each viewport, and its tiles.
        for (index, viewport) in viewports.iter().enumerate() {
            let Some((_, textures)) = self.textures.iter().find(|(size, _)| *size == viewport.size()) else { continue };
            let places = places_of(frame.plan, targets, index);
            let tiles: Vec<PyramidTile<'_>> = places
                .iter()
                .map(|Place { batch, encoded, .. }| PyramidTile {
                    tile: *encoded,
                    pixels: &batch.pixels,
                    plane_pixels: batch.plane_pixels,
                })
                .collect();
            let pyramid_frame = PyramidFrame {
                weights: frame.plan.glare.weights,
                viewports: &targets.viewports,
                maximum,
                viewport: index as u32,
                pixel_rad: viewport.projection.middle_pixel_rad(),
            };
            pyramid.record(gpu, &mut pass, &pyramid_frame, textures, &tiles);
            for Place { batch, tile, encoded } in places {
                let encoded = gpu.frame_uniform_list("tile", std::slice::from_ref(&encoded), MAX_TILES);
                let target = PictureTarget {
                    viewports: &targets.viewports,
                    tiles: &encoded,
                    pixels: &batch.pixels,
                    partial_sums: &targets.partial_sums,
                    plane_pixels: batch.plane_pixels,
                };
                let source_bindings = [
                    (0, wgpu::BindingResource::TextureView(textures.combined())),
                    (1, wgpu::BindingResource::Sampler(pyramid.bilinear())),
                    (2, maximum.as_entire_binding()),
                ];
                let fraction = frame.plan.glare.fraction;
                composite.record(gpu, &mut pass, fraction, &target, &source_bindings, tile_grid(tile, viewport));
            }
        }
    }
}

/// Returns the tiles of a viewport, from the top.
fn places_of<'a>(plan: &'a Plan, targets: &'a Targets, viewport: usize) -> Vec<Place<'a>> {
    let batches = plan.views.batches.iter().zip(&targets.batches);
    let places = batches.flat_map(|(planned, batch)| {
        let tiles = planned.tiles.iter().zip(&batch.encoded_tiles);
        tiles.map(move |(tile, encoded)| Place { batch, tile, encoded: *encoded })
    });
    places.filter(|place| place.tile.viewport == viewport).collect()
}
