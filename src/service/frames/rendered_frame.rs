//! A finished frame with its times.

use std::{sync::Arc, time::SystemTime};

use super::{image_encoding::EncodedImages, schedule::Revisions};
use crate::{
    render::{Frame, FrameImage},
    scene::Camera,
    service::scene::{camera::Horizontal, views::ViewId},
};

/// A frame with its times.
#[derive(Debug)]
pub(crate) struct RenderedFrame {
    /// The frame, with the images of all requested views.
    pub(crate) frame: Arc<Frame>,
    /// The views of the images, which refer to them by index.
    pub(crate) views: Arc<[ViewId]>,
    /// Camera of the frame; for a headset: the origin of the room.
    pub(crate) camera: Camera,
    /// Direction of the camera for the scene's observer; `None` without one, and for a headset.
    pub(crate) horizontal: Option<Horizontal>,
    /// Time of the machine's clock at which the camera was set; for a headset: time at which the poses of the eyes were predicted.
    pub(crate) pose_time: SystemTime,
    /// Time of the machine's clock at which the frame was finished.
    pub(crate) render_time: SystemTime,
    /// Revisions of the content.
    pub(crate) shows: Revisions,
    /// Reductions of quality that were made to keep the frame time.
    pub(crate) given_up: GivenUp,
    /// Encoded images, shared by all equal requests.
    pub(crate) encoded: EncodedImages,
}

impl RenderedFrame {
    /// Returns the images of a view.
    pub(crate) fn images_of(&self, view: ViewId) -> impl Iterator<Item = &FrameImage> {
        let number = self.views.iter().position(|known| *known == view);
        self.frame.images.iter().filter(move |image| Some(image.view) == number)
    }

    /// Returns the same frame with black images.
    pub(crate) fn blackened(&self) -> Self {
        let mut frame = Frame::clone(&self.frame);
        for image in &mut frame.images {
            image
                .display
                .iter_mut()
                .flatten()
                .enumerate()
                .filter(|(byte, _)| byte % 4 != 3)
                .for_each(|(_, code)| *code = 0);
            image.hdr.iter_mut().flatten().for_each(|pixel| pixel[..3].fill(0.0));
        }
        Self {
            frame: Arc::new(frame),
            views: Arc::clone(&self.views),
            given_up: self.given_up.clone(),
            encoded: EncodedImages::default(),
            ..*self
        }
    }
}

/// Reductions of quality of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GivenUp {
    /// Quality level; 0: as configured.
    pub(crate) level: u32,
    /// Description of each reduction.
    pub(crate) what: Vec<String>,
}
