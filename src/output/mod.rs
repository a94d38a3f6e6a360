//! What leaves the process: encodings of images, and the files that `render` writes.

mod encode;
mod files;
mod jpeg;
mod reduce;
mod video;

pub use encode::{EncodeError, Encoding, encode};
pub use files::{OutputError, write_frame, write_frames};
pub use reduce::reduced;
pub use video::VideoEncoder;
