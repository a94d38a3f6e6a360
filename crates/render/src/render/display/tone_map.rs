//! The tone-mapping pass: converts luminance to 8-bit display values. Shader: `shaders/display/tone_map.wgsl`; the f64
//! twin is `crate::photometry::tone_map`.
//!
//! No twin: photometry/tone_map.rs.

use crate::render::display_variant::{DisplayVariant, encode_display};
use crate::render::shader::Shader;
use crate::{
    gpu::{Gpu, Variants, bind_buffers},
    plan::settings::ToneMapSettings,
    render::{display::layout, targets::PictureTarget},
};

/// Pipelines of the tone-mapping pass.
pub(crate) struct ToneMapPass {
    pipelines: Variants<DisplayVariant, wgpu::ComputePipeline>,
}

impl ToneMapPass {
    pub(crate) fn new() -> Self {
        Self { pipelines: Variants::new() }
    }

    /// Returns the pipeline for these settings. `has_short_codes`: see [`DisplayVariant::with_short_codes`].
    pub(crate) fn pipeline(
        &self,
        gpu: &Gpu,
        settings: &ToneMapSettings,
        has_short_codes: bool,
    ) -> wgpu::ComputePipeline {
        let variant = DisplayVariant::from_settings(settings).with_short_codes(has_short_codes);
        let make = || gpu.compute_pipeline_with(&Shader::new("display/tone_map").source(), &variant.constants());
        self.pipelines.get(variant, make)
    }

    /// Records the pass from a picture to a display image. The settings have the flag of [`Self::pipeline`].
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        (settings, has_short_codes): (&ToneMapSettings, bool),
        picture: &PictureTarget<'_>,
        (exposure, display): (&wgpu::Buffer, &wgpu::Buffer),
        grid: [u32; 3],
    ) {
        let parameters = layout::ToneMapParameters {
            plane_pixels: picture.plane_pixels,
            shown: encode_display(settings),
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("tone map parameters", &parameters);
        let pipeline = &self.pipeline(gpu, settings, has_short_codes);
        let group = bind_buffers(
            gpu,
            pipeline,
            0,
            &[
                (0, parameters.as_entire_binding()),
                (1, picture.viewports.as_entire_binding()),
                (2, picture.tiles.as_entire_binding()),
                (3, picture.pixels.as_entire_binding()),
                (4, exposure.as_entire_binding()),
                (5, display.as_entire_binding()),
            ],
        );
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
