//! The overlay pass. Shader: `shaders/overlay/draw.wgsl`.

use crate::{
    gpu::{Gpu, GrowingBuffer, bind_in_order, dispatch_rows},
    render::{overlay::layout, tabulated::projecting},
};

/// Blocks of one batch, with their last bind group.
pub(super) struct BatchBlocks {
    parameters: GrowingBuffer,
    blocks: GrowingBuffer,
    /// Number of blocks.
    pub count: u32,
    bound: Option<(Vec<wgpu::Buffer>, wgpu::BindGroup)>,
}

impl BatchBlocks {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::COPY_DST;
        Self {
            parameters: GrowingBuffer::new("overlay parameters", usage | wgpu::BufferUsages::UNIFORM),
            blocks: GrowingBuffer::new("overlay blocks", usage | wgpu::BufferUsages::STORAGE),
            count: 0,
            bound: None,
        }
    }

    pub(super) fn upload(&mut self, gpu: &Gpu, blocks: &[layout::OverlayBlock]) {
        self.count = blocks.len() as u32;
        self.parameters.upload(gpu, &[layout::OverlayParameters { blocks: self.count, ..Default::default() }]);
        self.blocks.upload(gpu, blocks);
    }
}

/// The pass, for images with or without bodies.
pub(super) struct OverlayPass {
    pipeline: wgpu::ComputePipeline,
    pub has_geometry: bool,
}

impl OverlayPass {
    pub(super) fn new(gpu: &Gpu, has_geometry: bool) -> Self {
        let constants = [("HAS_GEOMETRY", f64::from(u8::from(has_geometry)))];
        Self {
            pipeline: gpu.compute_pipeline_with(&projecting(gpu, "overlay/draw").source(), &constants),
            has_geometry,
        }
    }

    /// Draws the blocks of a batch. `buffers`: viewports, tiles, display image, geometry, items, texels, entries.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        blocks: &mut BatchBlocks,
        buffers: &[&wgpu::Buffer; 7],
    ) {
        let (Some(parameters), Some(block_buffer)) = (blocks.parameters.held(), blocks.blocks.held()) else { return };
        let all: Vec<wgpu::Buffer> =
            [&[parameters][..], &buffers[..], &[block_buffer]].concat().into_iter().cloned().collect();
        if blocks.bound.as_ref().is_none_or(|(bound, _)| *bound != all) {
            let group = bind_in_order(gpu, &self.pipeline, 0, &all.iter().collect::<Vec<_>>());
            blocks.bound = Some((all, group));
        }
        let Some((_, group)) = &blocks.bound else { return };
        let [columns, rows] = dispatch_rows(gpu, blocks.count);
        pass.set_pipeline(&self.pipeline);
        gpu.bind_tables(pass, &self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(columns, rows, 1);
    }
}
