//! Errors of films.

use std::io;
use std::path::PathBuf;

use super::super::{OutputError, encode::EncodeError};
use crate::config::ConfigError;

/// Reason why a film cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// The path sets an invalid value for a frame.
    #[error("{origin}: frame {frame}: {problem}")]
    Frame {
        /// Path file.
        origin: String,
        /// Frame number.
        frame: u32,
        /// Description with the valid values.
        problem: String,
    },
    /// The path or the configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The folder holds another film.
    #[error("{}: {problem}: choose another folder for --out, or replace the existing film with --overwrite", folder.display())]
    OtherFilm {
        /// The folder.
        folder: PathBuf,
        /// Differences.
        problem: String,
    },
    /// The folder is not that of a film.
    #[error("{}: {problem}; the command `film` makes such folders", folder.display())]
    NotAFilm {
        /// The folder.
        folder: PathBuf,
        /// Description of the problem.
        problem: String,
    },
    /// The frames of a film cannot be drawn again from its record.
    #[error("{}: its frames cannot be drawn again: {problem}", folder.display())]
    Unrepeatable {
        /// The folder.
        folder: PathBuf,
        /// Reason.
        problem: String,
    },
    /// Files of frames are missing, damaged, or from another film.
    #[error("{}: {missing} files are missing, {damaged} damaged, {foreign} foreign; `film repair` draws their frames again", folder.display())]
    Faulty {
        /// The folder.
        folder: PathBuf,
        /// Number of missing files.
        missing: usize,
        /// Number of damaged files.
        damaged: usize,
        /// Number of files of another film.
        foreign: usize,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The folder cannot be read, or a file in it cannot be removed.
    #[error("cannot {action} {}: {source}", path.display())]
    Folder {
        /// Attempted action.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The images of a frame's moments cannot be added.
    #[error("motion blur: {0}")]
    Blur(EncodeError),
    /// The writer threads ended early.
    #[error("the threads that write files ended early")]
    Writers,
    /// No video can be encoded on this machine.
    #[error(
        "--video needs ffmpeg with the encoder libx264, {problem}: install it (Debian, Ubuntu: `apt install ffmpeg`; Fedora: `dnf install ffmpeg`)"
    )]
    NoFfmpeg {
        /// Result of the search for ffmpeg.
        problem: String,
    },
    /// `ffmpeg` failed.
    #[error("ffmpeg failed ({status}); the frames are written:\n{messages}")]
    Ffmpeg {
        /// Exit status.
        status: String,
        /// Last lines of its output.
        messages: String,
    },
    /// A signal ended the work.
    #[error("interrupted: {drawn} frames are written, {left} remain; the same command continues with them")]
    Interrupted {
        /// Number of frames that this run has written.
        drawn: usize,
        /// Number of frames that remain.
        left: usize,
    },
}
