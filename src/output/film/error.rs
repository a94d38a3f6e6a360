//! What can go wrong with a film.

use std::io;
use std::path::PathBuf;

use super::super::{OutputError, encode::EncodeError};
use crate::config::ConfigError;

/// Why a film is not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// What the path asks of a frame is not allowed.
    #[error("{origin}: frame {frame}: {problem}")]
    Frame {
        /// The file of the path.
        origin: String,
        /// The frame.
        frame: u32,
        /// What is wrong and what is allowed.
        problem: String,
    },
    /// The path or the configuration is refused.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The folder holds another film.
    #[error("{}: {problem}: take another folder for --out, or replace what is there with --overwrite", folder.display())]
    OtherFilm {
        /// The folder.
        folder: PathBuf,
        /// In what it differs.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The folder cannot be read, or its files not removed.
    #[error("cannot {what} {}: {source}", path.display())]
    Folder {
        /// What was tried.
        what: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The images of a frame's moments do not add up.
    #[error("motion blur: {0}")]
    Blur(EncodeError),
    /// The threads that write have ended early.
    #[error("the threads that write files have ended early")]
    Writers,
    /// No video can be encoded here.
    #[error(
        "--video needs ffmpeg with the encoder libx264, {problem}: install it (Debian, Ubuntu: `apt install ffmpeg`; Fedora: `dnf install ffmpeg`)"
    )]
    NoFfmpeg {
        /// What was found instead.
        problem: String,
    },
    /// `ffmpeg` has failed.
    #[error("ffmpeg has failed ({status}); the frames are written:\n{messages}")]
    Ffmpeg {
        /// How it has ended.
        status: String,
        /// The last of what it said.
        messages: String,
    },
    /// A signal has ended the work.
    #[error("interrupted: {drawn} frames are written, {left} are left; the same command goes on with them")]
    Interrupted {
        /// Frames that this run has written.
        drawn: usize,
        /// Frames that it has not.
        left: usize,
    },
}
