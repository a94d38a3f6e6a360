//! The present pass: a tile of a picture into a texture that leaves the renderer. Shader: `shaders/display/present.wgsl`; the f64 twin is
//! `crate::photometry::tone_map`.

use super::variant::{DisplayVariant, encode_display};
use crate::render::shader::Shader;
use crate::{
    gpu::{self, Gpu, Stage, Variants, bind_to},
    plan::{settings::ToneMapSettings, tiles::Tile},
    render::display::layout,
};

/// What the present pass writes into a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PresentSource {
    /// The codes of the display image.
    Codes,
    /// Light of the HDR image.
    Light,
}

impl PresentSource {
    fn file(self) -> &'static str {
        match self {
            Self::Codes => "display/present_codes",
            Self::Light => "display/present_light",
        }
    }
}

/// What a texture of that format is given; `None`: it cannot be drawn into.
pub(crate) fn present_source(format: wgpu::TextureFormat) -> Option<PresentSource> {
    match format {
        wgpu::TextureFormat::Rgba8UnormSrgb | wgpu::TextureFormat::Bgra8UnormSrgb => Some(PresentSource::Codes),
        wgpu::TextureFormat::Rgba16Float => Some(PresentSource::Light),
        _ => None,
    }
}

/// The formats that [`present_source`] knows, for messages.
pub(crate) const PRESENT_FORMATS: &str = "Rgba8UnormSrgb, Bgra8UnormSrgb and Rgba16Float";

/// What is compiled into a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PresentVariant {
    format: wgpu::TextureFormat,
    /// Of light alone: codes are what the tone mapping has left.
    shown: DisplayVariant,
}

/// The pass.
pub(crate) struct PresentPass {
    pipelines: Variants<PresentVariant, wgpu::RenderPipeline>,
}

/// A tile, and the buffers of its batch.
pub(crate) struct PresentTile<'a> {
    pub tile: &'a Tile,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Pixels of the batch.
    pub plane_pixels: u32,
    /// The display image for codes, the HDR image for light.
    pub pixels: &'a wgpu::Buffer,
    pub exposure: &'a wgpu::Buffer,
}

impl PresentPass {
    pub(crate) fn new() -> Self {
        Self { pipelines: Variants::new() }
    }

    /// The pipeline into textures of that format; `None`: [`present_source`] knows no such format.
    pub(crate) fn pipeline(
        &self,
        gpu: &Gpu,
        format: wgpu::TextureFormat,
        settings: &ToneMapSettings,
    ) -> Option<wgpu::RenderPipeline> {
        let source = present_source(format)?;
        let shown = match source {
            PresentSource::Codes => DisplayVariant::default(),
            PresentSource::Light => DisplayVariant::of(settings),
        };
        let variant = PresentVariant { format, shown };
        Some(self.pipelines.get(variant, || {
            let constants = variant.shown.constants();
            let constants = if source == PresentSource::Light { &constants[..] } else { &[] };
            gpu.colour_pipeline(
                &Stage { source: &Shader::new("display/present_corner").source(), constants: &[] },
                &Stage { source: &Shader::new("display/present").with("source", source.file()).source(), constants },
                wgpu::PrimitiveTopology::TriangleList,
                variant.format.into(),
            )
        }))
    }

    /// Records one tile into a target of that format; nothing where [`present_source`] knows no such format.
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
        let parameters = gpu::uniform_buffer(gpu, "present parameters", &parameters);
        let mut bindings = vec![(0, parameters.as_entire_binding()), (1, target.pixels.as_entire_binding())];
        if source == PresentSource::Light {
            bindings.push((2, target.exposure.as_entire_binding()));
        }
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bind_to(gpu, &pipeline.get_bind_group_layout(0), &bindings), &[]);
        pass.set_scissor_rect(0, target.tile.first_row, target.width, target.tile.rows);
        pass.draw(0..3, 0..1);
    }
}
