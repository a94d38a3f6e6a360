//! Images in textures that leave the renderer, those of a headset's swapchain for example.

use super::RenderError;
use crate::view::Rig;

/// What the present pass writes into a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PresentSource {
    /// The codes of the display image.
    Codes,
    /// Light of the HDR image.
    Light,
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

/// A texture that an image of the frame is drawn into.
#[derive(Clone, Copy, Debug)]
pub struct Presentation<'a> {
    /// Which image: an index into [`Rig::viewports`].
    pub viewport: usize,
    /// One layer and level of a texture of the renderer's device, as large as the image. All of it is written, with alpha 1.
    pub target: &'a wgpu::TextureView,
    /// The view's format. `Rgba8UnormSrgb` and `Bgra8UnormSrgb` hold the bytes of the display image. `Rgba16Float` holds the linear
    /// values that the tone mapping gives, 0 to 1 for black to display white, rounded to the nearest half and not dithered.
    pub format: wgpu::TextureFormat,
}

impl Presentation<'_> {
    /// Whether it shows the bytes of the display image.
    pub(crate) fn shows_codes(&self) -> bool {
        present_source(self.format) == Some(PresentSource::Codes)
    }

    /// Whether it shows light.
    pub(crate) fn shows_light(&self) -> bool {
        present_source(self.format) == Some(PresentSource::Light)
    }
}

/// Whether the images of a rig can be drawn into these textures.
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
