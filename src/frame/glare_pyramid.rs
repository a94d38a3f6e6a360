//! Recording the published glare pyramids: viewport by viewport, each from its own finished picture.

use std::sync::OnceLock;

use super::{
    glare::{GlareBatch, GlareFrame},
    record::begin_pass,
};
use crate::{
    gpu::{Gpu, GpuTimer, GrowingBuffer, layout, storage_buffer},
    passes::{
        glare_composite::{GlareCompositePass, GlareSource},
        glare_pyramid::{GlarePyramidPass, PyramidFrame, PyramidTextures, PyramidTile},
        shared::{PictureTarget, pixel_grid},
    },
    plan::{glare_pyramid::PyramidAxes, tiles::Tile},
    view::Viewport,
};

/// Passes and textures of the pyramids, made when they are first asked for.
pub(super) struct GlarePyramid {
    screen: OnceLock<GlarePyramidPass>,
    view: OnceLock<GlarePyramidPass>,
    composite: OnceLock<GlareCompositePass>,
    maximum: GrowingBuffer,
    /// One pyramid for each size of a picture: viewports of a frame use it one after the other.
    textures: Vec<([u32; 2], PyramidTextures)>,
}

/// A tile of the viewport at hand.
struct Place<'a> {
    batch: &'a GlareBatch<'a>,
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

    /// Lets go of buffers and textures.
    pub(super) fn release(&mut self) {
        self.textures.clear();
        self.maximum.release();
    }

    /// Records the glare of a frame along these axes.
    pub(super) fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &GlareFrame<'_>,
        axes: PyramidAxes,
    ) {
        self.textures.retain(|(size, _)| frame.viewports.iter().any(|viewport| viewport.size() == *size));
        for size in frame.viewports.iter().map(Viewport::size) {
            if self.textures.iter().all(|(held, _)| *held != size) {
                self.textures.push((size, PyramidTextures::new(gpu, size)));
            }
        }
        let of_axes = match axes {
            PyramidAxes::Screen => &self.screen,
            PyramidAxes::View => &self.view,
        };
        let pyramid = of_axes.get_or_init(|| GlarePyramidPass::new(gpu, axes));
        let composite = self.composite.get_or_init(|| GlareCompositePass::new(gpu, GlareSource::Pyramid, &[]));
        let maximum = self.maximum.with_room(gpu, 16);
        encoder.clear_buffer(maximum, 0, None);
        let mut pass = begin_pass(encoder, timer, "glare");
        for batch in &frame.batches {
            let pixels = (&batch.pixels, batch.batch.pixels as u32);
            pyramid.find_maximum(gpu, &mut pass, frame.encoded_viewports, batch.tiles, pixels, maximum, batch.grid);
        }
        for (index, viewport) in frame.viewports.iter().enumerate() {
            let Some((_, textures)) = self.textures.iter().find(|(size, _)| *size == viewport.size()) else { continue };
            let places = places_of(frame, index);
            let tiles: Vec<PyramidTile<'_>> = places
                .iter()
                .map(|Place { batch, encoded, .. }| PyramidTile {
                    tile: *encoded,
                    pixels: &batch.pixels,
                    plane_pixels: batch.batch.pixels as u32,
                })
                .collect();
            let of_viewport = PyramidFrame {
                weights: frame.settings.weights,
                viewports: frame.encoded_viewports,
                maximum,
                viewport: index as u32,
                pixel_rad: viewport.projection.middle_pixel_rad(),
            };
            pyramid.record(gpu, &mut pass, &of_viewport, textures, &tiles);
            for Place { batch, tile, encoded } in places {
                let encoded = storage_buffer(gpu, "tile", std::slice::from_ref(&encoded));
                let target = PictureTarget {
                    viewports: frame.encoded_viewports,
                    tiles: &encoded,
                    pixels: &batch.pixels,
                    partial_sums: frame.partial_sums,
                    plane_pixels: batch.batch.pixels as u32,
                };
                let of_source = [
                    (0, wgpu::BindingResource::TextureView(textures.combined())),
                    (1, wgpu::BindingResource::Sampler(pyramid.bilinear())),
                    (2, maximum.as_entire_binding()),
                ];
                let grid = pixel_grid(std::slice::from_ref(tile), &[viewport.size()[0]]);
                composite.record(gpu, &mut pass, frame.fraction, &target, &of_source, grid);
            }
        }
    }
}

/// The tiles of a viewport, from the top.
fn places_of<'a>(frame: &'a GlareFrame<'_>, viewport: usize) -> Vec<Place<'a>> {
    let of_batch = |batch: &'a GlareBatch<'_>| {
        let tiles = batch.batch.tiles.iter().zip(batch.encoded_tiles);
        tiles.map(move |(tile, encoded)| Place { batch, tile, encoded: *encoded })
    };
    frame.batches.iter().flat_map(of_batch).filter(|place| place.tile.viewport == viewport).collect()
}
