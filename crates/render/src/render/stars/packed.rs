//! The published rasteriser: packs luminance and temperature into one word as two half floats, and updates it by compare-exchange.
//!
//! Shaders: `shaders/stars/packed.wgsl` (every star of the catalogue, once per view) and
//! `shaders/stars/packed_sorted.wgsl` (culled and sorted stars). The f64 twin is `crate::reference::stars::packed`.

use std::sync::OnceLock;

use super::luminance::{LuminanceInputs, LuminancePass, LuminanceSource};
use super::{
    catalogue_buffers::{CatalogueBuffers, CatalogueDraw},
    items::{StarDraw, bind_items},
};
use crate::render::constants::workgroups::CATALOGUE_THREADS;
use crate::{
    gpu::{Gpu, GrowingBuffer, bind_buffers, dispatch_rows},
    render::{
        shader::workgroup_constant,
        stars::layout,
        tabulated::projecting,
        targets::{PictureTarget, Sums, Targets},
    },
};

/// Size of a packed pixel, bytes: two half floats.
const PACKED_BYTES: u64 = 4;

/// Lazily created passes, and buffers of the rasteriser.
pub(super) struct Packed {
    pass: PackedPass,
    resolve: OnceLock<LuminancePass>,
    words: GrowingBuffer,
}

/// Inputs of the rasteriser.
pub(super) struct PackedFrame<'a> {
    pub camera_pc: [f32; 3],
    pub faintest_lx: f64,
    /// Number of tiles of the batch.
    pub tiles: u32,
    /// Draws that culling left.
    pub visible: &'a [StarDraw<'a>],
    /// All stars, to draw instead of `visible`.
    pub catalogue: Option<&'a CatalogueBuffers>,
}

impl Packed {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            pass: PackedPass::default(),
            resolve: OnceLock::new(),
            words: GrowingBuffer::new("packed pixels", usage),
        }
    }

    pub(super) fn release(&mut self) {
        self.words.release();
    }

    /// Creates the pipelines of one of the two forms in advance.
    pub(super) fn prepare(&self, gpu: &Gpu, reads_catalogue: bool) {
        if reads_catalogue {
            self.pass.catalogue(gpu);
        } else {
            self.pass.sorted(gpu);
        }
        self.resolve_pass(gpu);
    }

    fn resolve_pass(&self, gpu: &Gpu) -> &LuminancePass {
        self.resolve.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::Packed))
    }

    /// Returns the words of a batch, cleared.
    pub(super) fn clear_words(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, pixels: u64) -> wgpu::Buffer {
        let words = self.words.with_room(gpu, pixels * PACKED_BYTES).clone();
        encoder.clear_buffer(&words, 0, Some((pixels * PACKED_BYTES).next_multiple_of(4)));
        words
    }

    /// Records the rasteriser into the words of a batch.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        frame: &PackedFrame<'_>,
        words: &wgpu::Buffer,
        targets: &Targets,
        batch: usize,
    ) {
        let packed = &self.pass;
        let Some(sums) = targets.sums(batch, false) else { return };
        let target = Sums { low_words: words.as_entire_buffer_binding(), ..sums };
        match frame.catalogue {
            Some(catalogue) => {
                let draws = catalogue.draws();
                let PackedFrame { camera_pc, faintest_lx, tiles, .. } = *frame;
                let all = WholeCatalogue { camera_pc, faintest_lx, tiles, draws: &draws };
                packed.record_catalogue(gpu, pass, &all, &target);
            }
            None => packed.record_sorted(gpu, pass, frame.faintest_lx, &target, frame.visible),
        }
    }

    /// Records the full-screen pass that converts temperatures to colours.
    pub(super) fn resolve(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        words: &wgpu::Buffer,
        colours: &wgpu::Buffer,
        target: &PictureTarget<'_>,
        grid: [u32; 3],
    ) {
        let resolve = self.resolve_pass(gpu);
        let source_bindings = [(0, words.as_entire_binding()), (1, colours.as_entire_binding())];
        let inputs = LuminanceInputs { scale: 1.0, numbers: [0, 0], source_bindings: &source_bindings };
        resolve.record(gpu, pass, &inputs, target, grid);
    }
}

/// Pipelines of the rasteriser, each created at first use.
#[derive(Default)]
struct PackedPass {
    catalogue: OnceLock<wgpu::ComputePipeline>,
    sorted: OnceLock<wgpu::ComputePipeline>,
}

/// All stars of a catalogue, drawn into every tile.
struct WholeCatalogue<'a> {
    pub camera_pc: [f32; 3],
    pub faintest_lx: f64,
    /// Number of tiles of the batch.
    pub tiles: u32,
    pub draws: &'a [CatalogueDraw<'a>],
}

impl PackedPass {
    fn catalogue(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.catalogue.get_or_init(|| gpu.compute_pipeline(&projecting(gpu, "stars/packed").source()))
    }

    fn sorted(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.sorted.get_or_init(|| {
            gpu.compute_pipeline_with(&projecting(gpu, "stars/packed_sorted").source(), &[workgroup_constant(gpu)])
        })
    }

    /// Records the published pass, which draws all stars into every tile. `target.low_words` holds the packed words.
    fn record_catalogue(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        all: &WholeCatalogue<'_>,
        target: &Sums<'_>,
    ) {
        let pipeline = self.catalogue(gpu);
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        for tile in 0..all.tiles {
            for draw in all.draws {
                let [columns, rows] = dispatch_rows(gpu, draw.count.div_ceil(CATALOGUE_THREADS));
                let parameters = layout::CatalogueParameters {
                    camera: all.camera_pc,
                    star_count: draw.count,
                    faintest_lx: all.faintest_lx as f32,
                    tile,
                    row_threads: columns * CATALOGUE_THREADS,
                    ..Default::default()
                };
                let parameters = gpu.frame_uniform("catalogue parameters", &parameters);
                let group = self.target_group(gpu, pipeline, &parameters, target);
                let stars = bind_buffers(gpu, pipeline, 1, &[(0, draw.stars.as_entire_binding())]);
                pass.set_bind_group(0, &group, &[]);
                pass.set_bind_group(1, &stars, &[]);
                pass.dispatch_workgroups(columns, rows, 1);
            }
        }
    }

    /// Records the same splat for the items of the visible chunks.
    fn record_sorted(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        faintest_lx: f64,
        target: &Sums<'_>,
        draws: &[StarDraw<'_>],
    ) {
        let pipeline = self.sorted(gpu);
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        for draw in draws {
            let [columns, rows] = dispatch_rows(gpu, draw.item_count);
            let parameters = layout::PackedParameters {
                faintest_lx: faintest_lx as f32,
                item_count: draw.item_count,
                items_per_row: columns,
                ..Default::default()
            };
            let parameters = gpu.frame_uniform("packed parameters", &parameters);
            let group = self.target_group(gpu, pipeline, &parameters, target);
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, &bind_items(gpu, pipeline, draw), &[]);
            pass.dispatch_workgroups(columns, rows, 1);
        }
    }

    fn target_group(
        &self,
        gpu: &Gpu,
        pipeline: &wgpu::ComputePipeline,
        parameters: &wgpu::Buffer,
        target: &Sums<'_>,
    ) -> wgpu::BindGroup {
        bind_buffers(
            gpu,
            pipeline,
            0,
            &[
                (0, parameters.as_entire_binding()),
                (1, target.viewports.as_entire_binding()),
                (2, target.tiles.as_entire_binding()),
                (3, target.counters.as_entire_binding()),
                (4, wgpu::BindingResource::Buffer(target.low_words.clone())),
            ],
        )
    }
}
