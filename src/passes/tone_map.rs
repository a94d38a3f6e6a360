//! The tone-mapping pass: luminance over display white to 8 bits, dithered. Shader: `shaders/tone_map.wgsl`; the f64 twin
//! is `crate::photometry::tone_map`.

use super::shared::{bind_buffers, operator_number};
use crate::{
    gpu::{self, Gpu, layout},
    plan::settings::ToneMapSettings,
};

/// The pass.
pub(crate) struct ToneMapPass {
    pipeline: wgpu::ComputePipeline,
}

/// Buffers of one batch.
pub(crate) struct ToneMapTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub luminances: &'a wgpu::Buffer,
    pub exposure: &'a wgpu::Buffer,
    pub display: &'a wgpu::Buffer,
    /// Pixels of the batch.
    pub plane_pixels: u32,
}

impl ToneMapPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline(&gpu::tone_map()) }
    }

    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        settings: &ToneMapSettings,
        target: &ToneMapTarget<'_>,
        grid: [u32; 3],
    ) {
        let parameters = layout::ToneMapParameters {
            tone_operator: operator_number(settings.operator),
            plane_pixels: target.plane_pixels,
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "tone map parameters", &parameters);
        let group = bind_buffers(
            gpu,
            &self.pipeline,
            0,
            &[
                (0, parameters.as_entire_binding()),
                (1, target.viewports.as_entire_binding()),
                (2, target.tiles.as_entire_binding()),
                (3, target.luminances.as_entire_binding()),
                (4, target.exposure.as_entire_binding()),
                (5, target.display.as_entire_binding()),
            ],
        );
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
