//! Films: numbered frames along a path, each a function of its number alone, so that any of them can be drawn anywhere, in any order, and again.
//!
//! [`FilmTracks`] says what a path asks of a frame, [`FilmFolder`] which frames are there and whether they are of the same film,
//! [`with_writer`] encodes and writes behind the drawing, [`Ffmpeg`] makes a video of the files, [`blur`] adds the light of several moments,
//! and [`Recording`] makes a path of what a daemon has shown.

pub mod blur;
mod error;
mod folder;
mod frames;
mod images;
mod path;
mod recording;
mod spline;
mod video;
mod writer;

pub use error::FilmError;
pub use folder::{FilmFolder, FilmRecord};
pub use frames::{FrameRange, MOST_FRAMES, Shard, file_name, stems};
pub use images::{FilmFormat, ImageWords, encode_image};
pub use path::{FilmTracks, check_with};
pub use recording::{RecordedPath, Recording, SeenScene};
pub use video::{Ffmpeg, check_video_file};
pub use writer::{FilmWriter, FrameFile, Written, with_writer};
