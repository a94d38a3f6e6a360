//! Recording the published star methods: they leave luminance instead of illuminance, most of them from every star in the
//! order of the catalogue, and a resolve pass of their own brings it where the other passes read it.

use std::sync::{Arc, OnceLock};

use super::catalogue_buffers::CatalogueBuffers;
use crate::{
    catalogue::chunks::StarSet,
    gpu::{self, Gpu, GrowingBuffer, layout},
    passes::{
        luminance::{LuminancePass, LuminanceSource},
        packed::PackedPass,
        shared::{CatalogueDraw, PictureTarget, StarDraw, StarTarget},
    },
    photometry::exposure::white_luminance_cd_m2,
    plan::settings::{CellSkySettings, RenderSettings, StarMethod},
    view::Viewport,
};

/// Bytes of a packed pixel: two halves.
const PACKED_BYTES: u64 = 4;

/// Passes and buffers of the published methods, made when they are first asked for.
pub(super) struct Published {
    packed: OnceLock<PackedPass>,
    packed_resolve: OnceLock<LuminancePass>,
    packed_pixels: GrowingBuffer,
    cell_sky: OnceLock<LuminancePass>,
    pub(super) catalogue: Option<CatalogueBuffers>,
}

/// What the published rasteriser reads and where it draws.
pub(super) struct PackedFrame<'a> {
    pub method: StarMethod,
    pub camera_pc: [f32; 3],
    pub faintest_lx: f64,
    /// Tiles of the batch.
    pub tiles: u32,
    pub draws: &'a [StarDraw<'a>],
    /// Colours by temperature.
    pub colours: &'a wgpu::Buffer,
    pub grid: [u32; 3],
}

impl Published {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            packed: OnceLock::new(),
            packed_resolve: OnceLock::new(),
            packed_pixels: GrowingBuffer::new("packed pixels", usage),
            cell_sky: OnceLock::new(),
            catalogue: None,
        }
    }

    /// Forgets everything that belongs to a scene or a size.
    pub(super) fn forget_buffers(&mut self) {
        self.catalogue = None;
        self.packed_pixels.release();
    }

    /// Holds the catalogue of a scene, in an order, where the method reads it.
    pub(super) fn hold_catalogue(&mut self, gpu: &Gpu, method: StarMethod, set: &Arc<StarSet>, order: Option<u64>) {
        if method.reads_catalogue() && self.catalogue.as_ref().is_none_or(|catalogue| !catalogue.holds(set, order)) {
            self.catalogue = None;
            self.catalogue = Some(CatalogueBuffers::new(gpu, set.clone(), order));
        }
    }

    /// The words of a batch, cleared.
    pub(super) fn packed_words(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, pixels: u64) -> wgpu::Buffer {
        let words = self.packed_pixels.with_room(gpu, pixels * PACKED_BYTES).clone();
        encoder.clear_buffer(&words, 0, Some((pixels * PACKED_BYTES).next_multiple_of(4)));
        words
    }

    /// Records the rasteriser; `target.pixels` are the words of the batch.
    pub(super) fn record_packed(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        frame: &PackedFrame<'_>,
        target: &StarTarget<'_>,
    ) {
        let packed = self.packed.get_or_init(|| PackedPass::new(gpu));
        if frame.method.reads_catalogue() {
            let segments = self.catalogue.as_ref().map_or(&[][..], |catalogue| &catalogue.segments);
            let draws: Vec<CatalogueDraw<'_>> =
                segments.iter().map(|(stars, count)| CatalogueDraw { stars, count: *count }).collect();
            packed.record_catalogue(gpu, pass, frame.camera_pc, frame.faintest_lx, target, frame.tiles, &draws);
        } else {
            packed.record_sorted(gpu, pass, frame.faintest_lx, target, frame.draws);
        }
    }

    /// Records its full-screen pass, which makes colours of temperatures.
    pub(super) fn resolve_packed(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        frame: &PackedFrame<'_>,
        words: &wgpu::Buffer,
        target: &PictureTarget<'_>,
    ) {
        let resolve = self.packed_resolve.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::Packed));
        let of_source = [(0, words.as_entire_binding()), (1, frame.colours.as_entire_binding())];
        resolve.record(gpu, pass, 1.0, [0, 0], target, &of_source, frame.grid);
    }

    /// Records one tile of the procedural sky. Its brightness is relative: 1 is the white of the configured exposure.
    pub(super) fn resolve_cell_sky(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        settings: &RenderSettings,
        viewport: &Viewport,
        target: &PictureTarget<'_>,
        grid: [u32; 3],
    ) {
        let CellSkySettings { cells, layers, radius_px, seed } = settings.stars.cell_sky;
        let parameters = layout::CellSkyParameters {
            pixel_rad: viewport.projection.middle_pixel_rad() as f32,
            radius_px: radius_px as f32,
            cells,
            layers,
            seed,
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "cell sky", &parameters);
        let resolve = self.cell_sky.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::CellSky));
        let white_cd_m2 = white_luminance_cd_m2(settings.exposure.ev100) as f32;
        resolve.record(gpu, pass, white_cd_m2, [0, 0], target, &[(0, parameters.as_entire_binding())], grid);
    }
}
