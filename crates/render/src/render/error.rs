//! Why a frame cannot be drawn.

use super::{asteroids::impostors::atlas::ImpostorAtlasError, presentation::PRESENT_FORMATS};
use crate::{gpu::GpuError, plan::PlanError};

/// Why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The frame cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Fixed-point sums overflowed. Units are chosen so that this cannot happen; it is reported, never shown.
    #[error("{0} fixed-point sums overflowed")]
    Overflow(u32),
    /// An atlas of impostors cannot be made.
    #[error(transparent)]
    Impostors(#[from] Box<ImpostorAtlasError>),
    /// There must be one choice of buffers per view.
    #[error("{given} choices of buffers for {views} views")]
    WantedCount {
        /// How many were given.
        given: usize,
        /// How many views there are.
        views: usize,
    },
    /// A texture is to be drawn into whose image there is not.
    #[error("presentation of image {viewport}: the views have {images} images in all")]
    NoSuchImage {
        /// Index of the image.
        viewport: usize,
        /// How many there are.
        images: usize,
    },
    /// A texture is not as large as its image.
    #[error(
        "view `{view}`: an image of {} x {} pixels cannot be drawn into a texture of {} x {}",
        image[0], image[1], texture[0], texture[1]
    )]
    PresentationSize {
        /// The view's name.
        view: String,
        /// Width and height of the texture, pixels.
        texture: [u32; 2],
        /// Width and height of the image, pixels.
        image: [u32; 2],
    },
    /// A texture has a format that images cannot be drawn into.
    #[error("view `{view}`: images cannot be drawn into textures of format {format:?}: allowed are {PRESENT_FORMATS}")]
    PresentationFormat {
        /// The view's name.
        view: String,
        /// The texture's format.
        format: wgpu::TextureFormat,
    },
    /// Another frame was begun before this one was finished.
    #[error("the frame was thrown away: another one was begun before it was finished")]
    Abandoned,
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
