//! Errors of rendering.

use super::{asteroids::impostors::atlas::ImpostorAtlasError, presentation::PRESENT_FORMATS};
use crate::{gpu::GpuError, plan::PlanError};

/// Reason why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The frame cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Fixed-point sums overflowed. Units are chosen to prevent this. If it happens nevertheless, the frame fails and
    /// is not displayed.
    #[error("{0} fixed-point sums overflowed")]
    Overflow(u32),
    /// An impostor atlas cannot be made.
    #[error(transparent)]
    Impostors(#[from] Box<ImpostorAtlasError>),
    /// The number of entries that state the buffers to read back differs from the number of views.
    #[error("buffers to read back are given for {given} views, but the rig has {views}")]
    WantedCount {
        /// Number of entries passed in.
        given: usize,
        /// Number of views.
        views: usize,
    },
    /// A presentation refers to an image that does not exist.
    #[error("cannot present image {viewport}: the views have only {images} images in all")]
    NoSuchImage {
        /// Index of the image.
        viewport: usize,
        /// Number of images.
        images: usize,
    },
    /// The size of a texture differs from that of its image.
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
    /// Images cannot be drawn into the format of a texture.
    #[error(
        "view `{view}`: images cannot be drawn into a texture of format {format:?}; it must be one of {PRESENT_FORMATS}"
    )]
    PresentationFormat {
        /// The view's name.
        view: String,
        /// The texture's format.
        format: wgpu::TextureFormat,
    },
    /// Another frame was begun before this one was finished.
    #[error("the frame was discarded because another one was begun before it was finished")]
    Abandoned,
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
