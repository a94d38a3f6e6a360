//! What leaves the process: encodings of images, the files that `render` writes, and films.

mod encode;
mod exr_file;
mod files;
pub mod film;
mod jpeg;
mod reduce;
mod video;

pub use encode::{EncodeError, Encoding, encode};
pub use files::{OutputError, write_frame, write_frames};
pub use reduce::reduced;
pub use video::VideoEncoder;
