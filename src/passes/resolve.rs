//! The resolve pass: fixed-point illuminance becomes luminance by the pixel's solid angle. Shader: `shaders/resolve.wgsl`;
//! the f64 twin is `crate::reference::stars`, which divides at its end.

use super::shared::bind_buffers;
use crate::{
    gpu::{self, Gpu, layout},
    plan::range::Ranges,
};

/// The pass.
pub(crate) struct ResolvePass {
    pipeline: wgpu::ComputePipeline,
    /// Stands in for the bright sums where there are none.
    nothing: wgpu::Buffer,
}

/// Buffers of one batch.
pub(crate) struct ResolveTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub pixels: &'a wgpu::Buffer,
    pub bright_pixels: Option<&'a wgpu::Buffer>,
    pub partial_sums: &'a wgpu::Buffer,
}

impl ResolvePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            pipeline: gpu.compute_pipeline(&gpu::resolve(gpu.wide_accumulator)),
            nothing: gpu::storage_buffer(gpu, "no bright sums", &[[0_u32; 4]]),
        }
    }

    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        ranges: &Ranges,
        target: &ResolveTarget<'_>,
        grid: [u32; 3],
    ) {
        let parameters = layout::ResolveParameters {
            lx_per_unit: (1.0 / ranges.main.units_per_lx) as f32,
            lx_per_bright_unit: ranges.bright.map_or(0.0, |bright| (1.0 / bright.units_per_lx) as f32),
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "resolve parameters", &parameters);
        let group = bind_buffers(
            gpu,
            &self.pipeline,
            0,
            &[
                (0, parameters.as_entire_binding()),
                (1, target.viewports.as_entire_binding()),
                (2, target.tiles.as_entire_binding()),
                (3, target.pixels.as_entire_binding()),
                (4, target.partial_sums.as_entire_binding()),
                (5, target.bright_pixels.unwrap_or(&self.nothing).as_entire_binding()),
            ],
        );
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
