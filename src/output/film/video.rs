//! Encodes a film's files as a video with an installed `ffmpeg`.

use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, Stdio};

use super::super::OutputError;
use super::error::FilmError;
use super::frames::FrameRange;
use crate::files::{beside_with_suffix, folder_of};

/// Supported containers, by file extension.
const EXTENSIONS: [&str; 3] = ["mp4", "mkv", "mov"];
/// Number of the last lines of ffmpeg's output that an error contains.
const MESSAGE_LINES: usize = 12;

/// An `ffmpeg` that can encode H.264.
#[derive(Debug)]
pub struct Ffmpeg(());

/// Checks that a file name identifies the container and that its folder exists.
///
/// # Errors
///
/// A description with the valid values.
pub fn check_video_file(file: &Path) -> Result<(), String> {
    let extension = file.extension().and_then(OsStr::to_str).unwrap_or_default();
    if !EXTENSIONS.contains(&extension) {
        let allowed = EXTENSIONS.join(", .");
        return Err(format!(
            "--video {}: the extension selects the container and must be one of .{allowed}",
            file.display()
        ));
    }
    let folder = folder_of(file);
    if !folder.is_dir() {
        return Err(format!("--video {}: the folder {} does not exist", file.display(), folder.display()));
    }
    Ok(())
}

impl Ffmpeg {
    /// Looks for `ffmpeg` in the executable search path.
    ///
    /// # Errors
    ///
    /// ffmpeg is missing, or lacks libx264.
    pub fn find() -> Result<Self, FilmError> {
        let mut command = Command::new("ffmpeg");
        let listed = command.args(["-hide_banner", "-encoders"]).stdin(Stdio::null()).output();
        match listed {
            Ok(listed) if String::from_utf8_lossy(&listed.stdout).contains("libx264") => Ok(Self(())),
            Ok(_) => Err(FilmError::NoFfmpeg { problem: "which the installed ffmpeg lacks".to_owned() }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Err(FilmError::NoFfmpeg { problem: "but ffmpeg is not installed".to_owned() })
            }
            Err(error) => Err(FilmError::NoFfmpeg { problem: format!("but ffmpeg cannot be run: {error}") }),
        }
    }

    /// Encodes the files `<stem>_<number>.png` of a range in `folder` as a video in Rec. 709. The file is written
    /// atomically.
    ///
    /// # Errors
    ///
    /// `ffmpeg` fails, or the file cannot be written.
    pub fn encode(&self, folder: &Path, stem: &str, range: FrameRange, fps: f64, file: &Path) -> Result<(), FilmError> {
        let write = |source: io::Error| OutputError::Write { path: file.to_owned(), source };
        let extension = file.extension().and_then(OsStr::to_str).unwrap_or_default();
        let temporary = beside_with_suffix(file, &format!(".{extension}")).map_err(write)?;
        let target: PathBuf = absolute(temporary.path()).map_err(write)?;
        // Run ffmpeg inside the folder: otherwise a `%` in the folder's name would be part of the pattern of file names.
        let mut command = Command::new("ffmpeg");
        command.current_dir(folder).stdin(Stdio::null());
        command.args(["-hide_banner", "-loglevel", "error", "-y", "-framerate", &fps.to_string()]);
        command.args(["-start_number", &range.first.to_string(), "-i", &format!("{stem}_%05d.png")]);
        command.args(["-frames:v", &range.count().to_string(), "-c:v", "libx264", "-crf", "16"]);
        command.args(["-vf", "scale=out_color_matrix=bt709:out_range=tv", "-pix_fmt", "yuv420p"]);
        command.args(["-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709"]);
        command.args(["-color_range", "tv"]).arg(&target);
        let output = command
            .output()
            .map_err(|error| FilmError::Ffmpeg { status: error.to_string(), messages: String::new() })?;
        if !output.status.success() {
            let messages = String::from_utf8_lossy(&output.stderr);
            let lines: Vec<&str> = messages.lines().collect();
            let messages = lines[lines.len().saturating_sub(MESSAGE_LINES)..].join("\n");
            return Err(FilmError::Ffmpeg { status: output.status.to_string(), messages });
        }
        // Sync the file that now has that name, because ffmpeg may have replaced the open file. Windows synchronises
        // only files that are open for writing.
        std::fs::File::options().write(true).open(&target).and_then(|video| video.sync_all()).map_err(write)?;
        temporary.persist(file).map_err(|error| write(error.error))?;
        Ok(())
    }
}
