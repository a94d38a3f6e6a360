//! The present pass: draws a tile of a picture into a texture that leaves the renderer. Shader:
//! `shaders/display/present.wgsl`; the f64 twin is `crate::photometry::tone_map`.
//!
//! No twin: photometry/tone_map.rs.

use crate::render::display_variant::{DisplayVariant, encode_display};
use crate::render::presentation::{PresentSource, present_source};
use crate::render::shader::Shader;
use crate::{
    gpu::{Gpu, LayoutOf, Stage, Variants},
    plan::{settings::ToneMapSettings, tiles::Tile},
    render::display::layout,
};

/// Returns the shader file that defines the written values.
fn file_of(source: PresentSource) -> &'static str {
    match source {
        PresentSource::Codes => "display/present_codes",
        PresentSource::Light => "display/present_light",
    }
}

/// Parameters compiled into a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PresentVariant {
    format: wgpu::TextureFormat,
    /// Tone mapping, used for light only: display codes are already tone-mapped.
    tone_map: DisplayVariant,
}

/// Pipelines of the present pass.
pub(crate) struct PresentPass {
    pipelines: Variants<PresentVariant, wgpu::RenderPipeline>,
}

/// A tile and the buffers of its batch.
pub(crate) struct PresentTile<'a> {
    pub tile: &'a Tile,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Pixels of the batch.
    pub plane_pixels: u32,
    /// The display image for codes, or the HDR image for light.
    pub pixels: &'a wgpu::Buffer,
    pub exposure: &'a wgpu::Buffer,
}

impl PresentPass {
    pub(crate) fn new() -> Self {
        Self { pipelines: Variants::new() }
    }

    /// Returns the pipeline for textures of a format; `None` if [`present_source`] does not support it.
    pub(crate) fn pipeline(
        &self,
        gpu: &Gpu,
        format: wgpu::TextureFormat,
        settings: &ToneMapSettings,
    ) -> Option<wgpu::RenderPipeline> {
        let source = present_source(format)?;
        let tone_map = match source {
            PresentSource::Codes => DisplayVariant::default(),
            PresentSource::Light => DisplayVariant::from_settings(settings),
        };
        let variant = PresentVariant { format, tone_map };
        Some(self.pipelines.get(variant, || {
            let constants = variant.tone_map.constants();
            let constants = if source == PresentSource::Light { &constants[..] } else { &[] };
            gpu.colour_pipeline(
                &Stage { source: &Shader::new("shared/whole_target").source(), constants: &[] },
                &Stage { source: &Shader::new("display/present").with("source", file_of(source)).source(), constants },
                wgpu::PrimitiveTopology::TriangleList,
                variant.format.into(),
            )
        }))
    }

    /// Records one tile into a target of `format`. Does nothing if [`present_source`] does not support it.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass<'_>,
        settings: &ToneMapSettings,
        format: wgpu::TextureFormat,
        target: &PresentTile<'_>,
    ) {
        let Some((source, pipeline)) = present_source(format).zip(self.pipeline(gpu, format, settings)) else { return };
        let parameters = layout::PresentParameters {
            plane_pixels: target.plane_pixels,
            first_pixel: target.tile.first_pixel,
            first_row: target.tile.first_row,
            width: target.width,
            shown: encode_display(settings),
        };
        let parameters = gpu.frame_uniform("present parameters", &parameters);
        let mut bindings = vec![(0, parameters.as_entire_binding()), (1, target.pixels.as_entire_binding())];
        if source == PresentSource::Light {
            bindings.push((2, target.exposure.as_entire_binding()));
        }
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &gpu.bind(LayoutOf::Render(&pipeline, 0), &bindings), &[]);
        pass.set_scissor_rect(0, target.tile.first_row, target.width, target.tile.rows);
        pass.draw(0..3, 0..1);
    }
}
