//! Films: numbered frames along a path. A frame depends only on its number, so frames can be drawn on any machine, in
//! any order, and again.
//!
//! [`FilmTracks`] computes the values of a path at each frame, [`FilmFolder`] knows which frames exist and whether they belong to the same film,
//! [`film_status`] checks the files of a film, [`with_writer`] encodes and writes in the background, [`Ffmpeg`] makes a video of the files, [`blur`]
//! adds the light of several moments, and [`Recording`] makes a path from the observed camera and scene of a daemon.

pub mod blur;
mod checksums;
mod error;
mod folder;
mod frames;
mod images;
mod path;
mod recording;
mod spline;
mod status;
mod video;
mod writer;

pub use error::FilmError;
pub use folder::{FilmFolder, FilmRecord};
pub use frames::{FrameRange, MOST_FRAMES, Shard, file_name, stems};
pub use images::{FilmFormat, ImageWords, encode_image};
pub use path::{FilmTracks, check_with};
pub use recording::{ObservedScene, RecordedPath, Recording};
pub use status::{Fault, FaultyFile, FilmStatus, film_status, recorded_checksums, remove_file};
pub use video::{Ffmpeg, check_video_file};
pub use writer::{FilmWriter, FrameFile, Written, with_writer};
