//! Videos of a film's files, by an installed `ffmpeg`.

use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, Stdio};

use super::super::OutputError;
use super::error::FilmError;
use super::frames::FrameRange;
use crate::files::folder_of;

/// Containers, by the extension of the file.
const EXTENSIONS: [&str; 3] = ["mp4", "mkv", "mov"];
/// Lines of what ffmpeg says that an error repeats.
const TOLD_LINES: usize = 12;

/// An `ffmpeg` that can encode H.264.
#[derive(Debug)]
pub struct Ffmpeg(());

/// Refuses a file whose name does not tell the container, or whose folder is not there.
///
/// # Errors
///
/// What is wrong and what is allowed.
pub fn check_video_file(file: &Path) -> Result<(), String> {
    let extension = file.extension().and_then(OsStr::to_str).unwrap_or_default();
    if !EXTENSIONS.contains(&extension) {
        let allowed = EXTENSIONS.join(", .");
        return Err(format!("--video {}: the extension tells the container: allowed are .{allowed}", file.display()));
    }
    let folder = folder_of(file);
    if !folder.is_dir() {
        return Err(format!("--video {}: there is no folder {}", file.display(), folder.display()));
    }
    Ok(())
}

impl Ffmpeg {
    /// Looks for `ffmpeg` on the path of the system.
    ///
    /// # Errors
    ///
    /// There is none, or it does not have libx264.
    pub fn find() -> Result<Self, FilmError> {
        let mut command = Command::new("ffmpeg");
        let listed = command.args(["-hide_banner", "-encoders"]).stdin(Stdio::null()).output();
        match listed {
            Ok(listed) if String::from_utf8_lossy(&listed.stdout).contains("libx264") => Ok(Self(())),
            Ok(_) => Err(FilmError::NoFfmpeg { problem: "and the ffmpeg here does not list it".to_owned() }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Err(FilmError::NoFfmpeg { problem: "and there is no ffmpeg here".to_owned() })
            }
            Err(error) => Err(FilmError::NoFfmpeg { problem: format!("and ffmpeg cannot be run: {error}") }),
        }
    }

    /// Encodes the files `<stem>_<number>.png` of a range in `folder` as a video in Rec. 709. The file appears whole or not at all.
    ///
    /// # Errors
    ///
    /// `ffmpeg` fails, or the file cannot be written.
    pub fn encode(&self, folder: &Path, stem: &str, range: FrameRange, fps: f64, file: &Path) -> Result<(), FilmError> {
        let write = |source: io::Error| OutputError::Write { path: file.to_owned(), source };
        let extension = file.extension().and_then(OsStr::to_str).unwrap_or_default();
        let mut builder = tempfile::Builder::new();
        let suffix = format!(".{extension}");
        builder.prefix(".steradian-").suffix(&suffix);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let temporary = builder.tempfile_in(folder_of(file)).map_err(write)?;
        let target: PathBuf = absolute(temporary.path()).map_err(write)?;
        // The folder's own name may have a `%`, which would be part of the pattern: so ffmpeg runs inside of it.
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
            let told = lines[lines.len().saturating_sub(TOLD_LINES)..].join("\n");
            return Err(FilmError::Ffmpeg { status: output.status.to_string(), messages: told });
        }
        // Whatever was written under the name, not the file that was open before.
        std::fs::File::open(&target).and_then(|video| video.sync_all()).map_err(write)?;
        temporary.persist(file).map_err(|error| write(error.error))?;
        Ok(())
    }
}
