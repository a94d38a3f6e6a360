//! Whom windows are opened for: the daemon, or the program itself.

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
    /// Which of its images.
    pub image: usize,
    /// Its tone mapping, for windows of more than 8 bits.
    pub tone_map: ToneMapSettings,
}

impl ShownImage {
    /// The image itself.
    pub fn image(&self) -> &FrameImage {
        &self.frame.images[self.image]
    }
}

/// What a window shows.
#[derive(Clone, Debug)]
pub enum WindowImage {
    /// An image.
    Image(ShownImage),
    /// What it has shown before.
    AsBefore,
    /// Nothing: its view is not there any more.
    NoView,
}

/// What windows show at the same time.
#[derive(Clone, Debug)]
pub struct WindowFrame {
    /// One entry for each window, in their order.
    pub images: Vec<WindowImage>,
}

/// What comes next.
#[derive(Clone, Debug)]
pub enum Next {
    /// A frame.
    Frame(WindowFrame),
    /// Nothing for now: a frame is drawn.
    Drawing,
    /// Nothing for now: the frame that is shown is still right.
    Unchanged,
    /// Windows are to close.
    End,
}

/// What somebody at a keyboard wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Test patterns in the views of all windows, or none any more.
    TestPattern,
    /// The end.
    Quit,
}

/// Whom windows are opened for.
pub trait Host: Send + Sync {
    /// What comes next, for windows of which `shown` says whether they are seen. May wait for a frame, a tenth of a second at most.
    fn next(&self, shown: &[bool]) -> Next;

    /// Takes a command. Must not wait.
    fn command(&self, command: Command);

    /// Takes the figures so far of all windows, whenever they have changed. Must not wait.
    fn figures(&self, figures: Vec<WindowFigures>);
}
