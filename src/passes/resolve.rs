//! The resolve pass: fixed-point illuminance becomes luminance by the pixel's solid angle, and display values where the
//! exposure is known before. Shader: `shaders/resolve.wgsl`; the f64 twin is `crate::reference::stars`, which divides at
//! its end.

use super::shared::{bind_buffers, operator_number};
use crate::{
    gpu::{self, Gpu, layout},
    photometry::exposure::white_luminance_cd_m2,
    plan::{range::Ranges, settings::ToneMapOperator},
};

/// What a batch's resolve pass writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ResolveOutputs {
    /// Luminance and solid angle, in the place of the sums.
    pub hdr: bool,
    /// The display image.
    pub display: bool,
}

/// The pass.
pub(crate) struct ResolvePass {
    /// HDR alone, display alone, both, none.
    pipelines: [(ResolveOutputs, wgpu::ComputePipeline); 4],
    /// Stands in for the bright sums where there are none.
    no_bright: wgpu::Buffer,
    /// Stands in for the display image where it is not written.
    no_display: wgpu::Buffer,
}

/// Buffers of one batch.
pub(crate) struct ResolveTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub pixels: &'a wgpu::Buffer,
    pub bright_pixels: Option<&'a wgpu::Buffer>,
    pub partial_sums: &'a wgpu::Buffer,
    pub display: Option<&'a wgpu::Buffer>,
    /// Pixels of the batch.
    pub plane_pixels: u32,
}

impl ResolvePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let source = gpu::resolve(gpu.wide_accumulator);
        let pipelines = [(true, false), (false, true), (true, true), (false, false)].map(|(hdr, display)| {
            let constants = [("WRITE_HDR", f64::from(u8::from(hdr))), ("WRITE_DISPLAY", f64::from(u8::from(display)))];
            (ResolveOutputs { hdr, display }, gpu.compute_pipeline_with(&source, &constants))
        });
        Self {
            pipelines,
            no_bright: gpu::storage_buffer(gpu, "no bright sums", &[[0_u32; 4]]),
            no_display: gpu::storage_buffer(gpu, "no display", &[0_u32]),
        }
    }

    /// Records the pass. `known_ev100` is the exposure of the display image, which is written if it is given together with
    /// its buffer.
    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        ranges: &Ranges,
        hdr: bool,
        known_ev100: Option<f64>,
        operator: ToneMapOperator,
        target: &ResolveTarget<'_>,
        grid: [u32; 3],
    ) {
        let outputs = ResolveOutputs { hdr, display: known_ev100.is_some() && target.display.is_some() };
        let parameters = layout::ResolveParameters {
            lx_per_unit: (1.0 / ranges.main.units_per_lx) as f32,
            lx_per_bright_unit: ranges.bright.map_or(0.0, |bright| (1.0 / bright.units_per_lx) as f32),
            display_per_cd_m2: known_ev100.map_or(0.0, |ev100| (1.0 / white_luminance_cd_m2(ev100)) as f32),
            tone_operator: operator_number(operator),
            plane_pixels: target.plane_pixels,
            ..Default::default()
        };
        let parameters = gpu::uniform_buffer(gpu, "resolve parameters", &parameters);
        let (_, pipeline) =
            self.pipelines.iter().find(|(of, _)| *of == outputs).expect("there is a pipeline for every combination");
        let mut buffers = vec![
            (0, parameters.as_entire_binding()),
            (1, target.viewports.as_entire_binding()),
            (2, target.tiles.as_entire_binding()),
            (3, target.pixels.as_entire_binding()),
            (4, target.partial_sums.as_entire_binding()),
            (5, target.bright_pixels.unwrap_or(&self.no_bright).as_entire_binding()),
        ];
        buffers.push((6, target.display.unwrap_or(&self.no_display).as_entire_binding()));
        let group = bind_buffers(gpu, pipeline, 0, &buffers);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
