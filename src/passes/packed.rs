//! The published rasteriser: luminance and temperature as two halves of one word, with compare-exchange. Shaders:
//! `shaders/stars/packed.wgsl` (every star of the catalogue, once per view) and `shaders/stars/packed_sorted.wgsl` (on culled
//! and sorted stars). The f64 twin is `crate::reference::packed`.

use super::shared::{CatalogueDraw, StarDraw, StarTarget, bind_buffers, bind_items, dispatch_rows};
use crate::gpu::{self, Gpu, Shader, constants::workgroups::CATALOGUE_THREADS, layout};

/// The passes.
pub(crate) struct PackedPass {
    catalogue: wgpu::ComputePipeline,
    sorted: wgpu::ComputePipeline,
}

impl PackedPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let workgroup = if gpu.software { 8.0 } else { 64.0 };
        Self {
            catalogue: gpu.compute_pipeline(&Shader::new("stars/packed").source()),
            sorted: gpu
                .compute_pipeline_with(&Shader::new("stars/packed_sorted").source(), &[("WORKGROUP", workgroup)]),
        }
    }

    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    /// Records the published pass: all stars into every tile. `target.pixels` are the packed words.
    pub(crate) fn record_catalogue(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        camera_pc: [f32; 3],
        faintest_lx: f64,
        target: &StarTarget<'_>,
        tiles: u32,
        draws: &[CatalogueDraw<'_>],
    ) {
        pass.set_pipeline(&self.catalogue);
        for tile in 0..tiles {
            for draw in draws {
                let [columns, rows] = dispatch_rows(gpu, draw.count.div_ceil(CATALOGUE_THREADS));
                let parameters = layout::CatalogueParameters {
                    camera: camera_pc,
                    star_count: draw.count,
                    faintest_lx: faintest_lx as f32,
                    tile,
                    row_threads: columns * CATALOGUE_THREADS,
                    ..Default::default()
                };
                let parameters = gpu::uniform_buffer(gpu, "catalogue parameters", &parameters);
                let group = self.target_group(gpu, &self.catalogue, &parameters, target);
                let stars = bind_buffers(gpu, &self.catalogue, 1, &[(0, draw.stars.as_entire_binding())]);
                pass.set_bind_group(0, &group, &[]);
                pass.set_bind_group(1, &stars, &[]);
                pass.dispatch_workgroups(columns, rows, 1);
            }
        }
    }

    /// Records the same splat on the items of the visible chunks.
    pub(crate) fn record_sorted(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        faintest_lx: f64,
        target: &StarTarget<'_>,
        draws: &[StarDraw<'_>],
    ) {
        pass.set_pipeline(&self.sorted);
        for draw in draws {
            let [columns, rows] = dispatch_rows(gpu, draw.item_count);
            let parameters = layout::PackedParameters {
                faintest_lx: faintest_lx as f32,
                item_count: draw.item_count,
                items_per_row: columns,
                ..Default::default()
            };
            let parameters = gpu::uniform_buffer(gpu, "packed parameters", &parameters);
            let group = self.target_group(gpu, &self.sorted, &parameters, target);
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, &bind_items(gpu, &self.sorted, draw), &[]);
            pass.dispatch_workgroups(columns, rows, 1);
        }
    }

    fn target_group(
        &self,
        gpu: &Gpu,
        pipeline: &wgpu::ComputePipeline,
        parameters: &wgpu::Buffer,
        target: &StarTarget<'_>,
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
                (4, target.pixels.as_entire_binding()),
            ],
        )
    }
}
