//! Interface between windows and their host: the daemon, or the program itself.

use std::sync::Arc;

use super::statistics::WindowFigures;
use crate::{
    photometry::tone_map::ToneMapSettings,
    render::{Frame, FrameImage},
};

/// An image of a frame.
#[derive(Clone, Debug)]
pub struct ShownImage {
    /// The frame.
    pub frame: Arc<Frame>,
    /// Index of the image in the frame.
    pub image: usize,
    /// Tone mapping of the image, for windows with more than 8 bits.
    pub tone_map: ToneMapSettings,
}

impl ShownImage {
    /// Returns the image.
    pub fn image(&self) -> &FrameImage {
        &self.frame.images[self.image]
    }
}

/// Content of a window.
#[derive(Clone, Debug)]
pub enum WindowImage {
    /// A new image.
    Image(ShownImage),
    /// The previous content.
    AsBefore,
    /// The window is black, because its view no longer exists.
    NoView,
    /// The window is black until the next image.
    Black,
}

/// Content of all windows at the same time.
#[derive(Clone, Debug)]
pub struct WindowFrame {
    /// One entry for each window, in their order.
    pub images: Vec<WindowImage>,
}

/// Next action of the presenting thread.
#[derive(Clone, Debug)]
pub enum Next {
    /// A frame.
    Frame(WindowFrame),
    /// Nothing for now: a frame is being drawn.
    Drawing,
    /// Nothing for now: the displayed frame is still current.
    Unchanged,
    /// Prepare a frame under a number: upload it, wait for the device and acquire the next textures of the surfaces, then call [`Host::prepared`].
    Prepare(u64, WindowFrame),
    /// Present the prepared frame of this number.
    Present(u64),
    /// Do not present the prepared frame of this number.
    Discard(u64),
    /// Close the windows.
    End,
}

/// Command that the user gives with a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Toggle test patterns in the views of all windows.
    TestPattern,
    /// Quit.
    Quit,
}

/// Host of the windows.
pub trait Host: Send + Sync {
    /// Returns the next action; `shown` states which windows are visible. May wait for a frame for at most a tenth of a
    /// second.
    fn next(&self, shown: &[bool]) -> Next;

    /// Called when a frame of [`Next::Prepare`] is prepared, or (`false`) when the device was lost in the process. Must not block.
    fn prepared(&self, _number: u64, _is_ready: bool) {}

    /// Called on the presenting thread when it begins.
    fn presenting_began(&self) {}

    /// Called when the presenting thread has ended, possibly by a panic. No further frames are prepared. Must not block.
    fn presenting_ended(&self) {}

    /// Receives a command. Must not block.
    fn command(&self, command: Command);

    /// Receives the statistics of all windows after each change. Must not block.
    fn figures(&self, figures: Vec<WindowFigures>);
}
