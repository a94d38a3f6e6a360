//! Draws images into textures that leave the renderer, for example into a headset's swapchain.

use super::RenderError;
use crate::view::Rig;

/// Values that the present pass writes into a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PresentSource {
    /// Codes of the display image.
    Codes,
    /// Light of the HDR image, tone-mapped.
    Light,
}

/// Returns the values for a texture of the given format; `None` if images cannot be drawn into it.
pub(crate) fn present_source(format: wgpu::TextureFormat) -> Option<PresentSource> {
    match format {
        wgpu::TextureFormat::Rgba8UnormSrgb | wgpu::TextureFormat::Bgra8UnormSrgb => Some(PresentSource::Codes),
        wgpu::TextureFormat::Rgba16Float => Some(PresentSource::Light),
        _ => None,
    }
}

/// Formats supported by [`present_source`], for messages.
pub(crate) const PRESENT_FORMATS: &str = "Rgba8UnormSrgb, Bgra8UnormSrgb or Rgba16Float";

/// Texture that an image of the frame is drawn into.
#[derive(Clone, Copy, Debug)]
pub struct Presentation<'a> {
    /// Index of the image in [`Rig::viewports`].
    pub viewport: usize,
    /// One layer and mip level of a texture of the renderer's device, with the size of the image. Every pixel is
    /// written, with alpha 1.
    pub target: &'a wgpu::TextureView,
    /// Format of the texture view. `Rgba8UnormSrgb` and `Bgra8UnormSrgb` receive the bytes of the display image.
    /// `Rgba16Float` receives the linear result of the tone mapping, 0 to 1 from black to display white, rounded to the
    /// nearest half float without dithering.
    pub format: wgpu::TextureFormat,
}

impl Presentation<'_> {
    /// Whether the texture receives the bytes of the display image.
    pub(crate) fn shows_codes(&self) -> bool {
        present_source(self.format) == Some(PresentSource::Codes)
    }

    /// Whether the texture receives light.
    pub(crate) fn shows_light(&self) -> bool {
        present_source(self.format) == Some(PresentSource::Light)
    }
}

/// Checks that the images of a rig can be drawn into these textures.
pub(super) fn check_presentations(rig: &Rig, presentations: &[Presentation<'_>]) -> Result<(), RenderError> {
    let images: Vec<_> =
        rig.views().iter().flat_map(|view| view.images.iter().map(|image| (&view.name, image))).collect();
    for presentation in presentations {
        let Some((name, image)) = images.get(presentation.viewport) else {
            return Err(RenderError::NoSuchImage { viewport: presentation.viewport, images: images.len() });
        };
        if present_source(presentation.format).is_none() {
            return Err(RenderError::PresentationFormat { view: (*name).clone(), format: presentation.format });
        }
        let [width, height] = image.projection.mapping().size();
        let texture = presentation.target.texture();
        if (texture.width(), texture.height()) != (width, height) {
            return Err(RenderError::PresentationSize {
                view: (*name).clone(),
                texture: [texture.width(), texture.height()],
                image: [width, height],
            });
        }
    }
    Ok(())
}
