//! Output: encodings of images, the files of `render`, and films.

mod encode;
mod exr_file;
mod files;
pub mod film;
mod jpeg;
mod packing;
pub mod provenance;
mod reduce;
mod video;
mod window_images;

#[cfg(feature = "cli")]
pub(crate) use encode::png_of;
pub use encode::{EncodeError, Encoding, encode};
pub use files::{OutputError, check_folder, write_frame, write_frames};
pub use packing::pack;
pub use reduce::reduced;
pub use video::VideoEncoder;
