//! Images of a frame that windows show. The daemon requests them, also if it is compiled without windows.

use crate::{config::WindowFormat, render::Wanted};

impl WindowFormat {
    /// Returns the image of a frame that a window shows; a test pattern exists only in display images.
    pub fn wanted(self, test_pattern: bool) -> Wanted {
        match self {
            Self::Srgb8 => Wanted::display(),
            Self::Rgb10 | Self::Hdr if test_pattern => Wanted::display(),
            Self::Rgb10 | Self::Hdr => Wanted::hdr(),
        }
    }
}
