//! Bytes reserved for the frames of a call or stream when the view's size changes.
//!
//! A call reserves bytes for the view's size at its start. If a later change of the geometry makes a frame larger, the
//! difference is reserved when the frame arrives, or the frame is refused.

use tonic::Status;

use super::{image_encoding::ImageRequest, rendered_frame::RenderedFrame};
use crate::service::network::clients::Held;

impl ImageRequest {
    /// Reserves the bytes that a frame needs in excess of the reservation for the view's earlier size.
    pub(crate) fn reserve_more(&self, rendered: &RenderedFrame) -> Result<Held, Status> {
        self.reserve_for_pixels(pixels_of(self, rendered))
    }

    fn reserve_for_pixels(&self, pixels: u64) -> Result<Held, Status> {
        self.client.hold_more_output(self.most_bytes(), self.form.most_bytes(pixels))
    }
}

fn pixels_of(image_request: &ImageRequest, rendered: &RenderedFrame) -> u64 {
    rendered.images_of(image_request.view).map(|image| u64::from(image.width) * u64::from(image.height)).sum()
}

/// Reservation of a stream in excess of its initial one.
pub(crate) struct StreamBudget {
    /// Number of pixels of a frame for which bytes are reserved.
    pixels: u64,
    more: Option<Held>,
}

impl StreamBudget {
    /// Starts with the current size of the view.
    pub(crate) fn new(image_request: &ImageRequest) -> Self {
        Self { pixels: image_request.pixels, more: None }
    }

    /// Adjusts the reservation to a frame.
    pub(crate) fn fit(&mut self, image_request: &ImageRequest, rendered: &RenderedFrame) -> Result<(), Status> {
        let pixels = pixels_of(image_request, rendered);
        if pixels != self.pixels {
            // Release the reservation for the previous size first.
            self.more = None;
            self.more = Some(image_request.reserve_for_pixels(pixels)?);
            self.pixels = pixels;
        }
        Ok(())
    }
}
