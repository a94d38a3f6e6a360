//! Room for frames on their way to a client, where the view becomes larger or smaller meanwhile.
//!
//! What a call may take is held before it begins, by the view as it is then. A frame that is larger, since the geometry of the view was changed, takes the
//! rest when it is there, or is refused.

use tonic::Status;

use super::{clients::Held, order::Order, slot::RenderedFrame};

impl Order {
    /// The room that a frame takes beyond what was held for the view as it was.
    pub(super) fn more_room(&self, rendered: &RenderedFrame) -> Result<Held, Status> {
        self.more_room_of(pixels_of(self, rendered))
    }

    fn more_room_of(&self, pixels: u64) -> Result<Held, Status> {
        self.client.hold_more_output(self.most_bytes(), self.form.most_bytes(pixels))
    }
}

fn pixels_of(order: &Order, rendered: &RenderedFrame) -> u64 {
    rendered.images_of(order.view).map(|image| u64::from(image.width) * u64::from(image.height)).sum()
}

/// What a stream holds beyond what it has begun with.
pub(super) struct Room {
    /// Of the frames that it is for.
    pixels: u64,
    more: Option<Held>,
}

impl Room {
    /// That of the view as it is.
    pub(super) fn new(order: &Order) -> Self {
        Self { pixels: order.pixels, more: None }
    }

    /// Makes room for a frame.
    pub(super) fn fit(&mut self, order: &Order, rendered: &RenderedFrame) -> Result<(), Status> {
        let pixels = pixels_of(order, rendered);
        if pixels != self.pixels {
            // What was held for frames of another size is given back first.
            self.more = None;
            self.more = Some(order.more_room_of(pixels)?);
            self.pixels = pixels;
        }
        Ok(())
    }
}
