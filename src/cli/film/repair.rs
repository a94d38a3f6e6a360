//! `film repair`: redraws the frames that are missing, damaged, or from another film.

use std::path::{Path, PathBuf};

use clap::Args;

use super::super::{CliError, inputs::Inputs, results};
use super::draw::Film;
use super::status;
use crate::config::FilmPath;
use crate::gpu::{Gpu, GpuOptions};
use crate::output::film::{FilmError, FilmFolder, FilmFormat, FilmRecord, FrameRange, recorded_checksums, remove_file};
use crate::render::Renderer;

/// Arguments of `film repair`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  steradian film repair film\n\n\
    Draws with the configuration and the path that film.json has, whether their files changed since or not. The catalogues and other files\n\
    that the configuration names must be those of the film, and so must adapter, driver and version of the program.")]
pub struct RepairArguments {
    /// Folder of a film.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Frames that the film must have: A..B excludes B, A..=B includes it. Default: those of all runs so far.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
}

/// Runs the command.
pub fn run(arguments: &RepairArguments, gpu: &GpuOptions) -> Result<(), CliError> {
    let RepairArguments { folder, frames } = arguments;
    let (held, status) = status::read(folder, *frames)?;
    status::report(folder, &held, &status)?;
    let to_draw = status.frames_to_draw();
    if let Some((first, last)) = to_draw.first().zip(to_draw.last()) {
        draw(folder, &held, &to_draw, FrameRange { first: *first, end: last + 1 }, gpu)?;
    }
    // Remove files of frames that are not in the film.
    let strays: Vec<&str> = status.faults.iter().filter(|file| !file.belongs).map(|file| file.file.as_str()).collect();
    for name in &strays {
        remove_file(folder, name)?;
        results::line(format!("removed {name}"))?;
    }
    results::line(format!("{}: {} frames drawn again, {} files removed", folder.display(), to_draw.len(), strays.len()))
}

/// Draws frames again, from the record of the film.
fn draw(
    folder: &Path,
    held: &FilmRecord,
    to_draw: &[u32],
    range: FrameRange,
    gpu: &GpuOptions,
) -> Result<(), CliError> {
    let unrepeatable = |problem: String| FilmError::Unrepeatable { folder: folder.to_owned(), problem };
    let origin = folder.join("film.json").display().to_string();
    let format = FilmFormat::from_name(&held.format)
        .ok_or_else(|| unrepeatable(format!("`{}` is not a format of this version", held.format)))?;
    if held.shutter.is_none() && held.blur != "none" {
        let problem = "an earlier version drew it with motion blur, which it did not record as numbers; repeat the command of the film";
        return Err(unrepeatable(problem.to_owned()).into());
    }
    let inputs = Inputs::of_record(&held.configuration, &held.files, &origin, None)?;
    let path = FilmPath::from_text(&held.path_toml, &origin).map_err(FilmError::from)?;
    let film = Film::new(inputs, path, format, held.shutter)?;
    let rig = film.check(range)?;
    let mut renderer = Renderer::new(Gpu::open(gpu)?);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &film.inputs.config.origin))?;
    let record = FilmRecord { frames: held.frames.clone(), ..film.record(&rig, &renderer)? };
    if record.digest != held.digest {
        let problem = format!(
            "this version of the program would draw a different film: the difference is in {}",
            record.differences(held)
        );
        return Err(unrepeatable(problem).into());
    }
    let before = recorded_checksums(folder)?;
    let open = FilmFolder::open(folder, &record, false)?;
    film.log_cost(&rig, to_draw.len(), to_draw.len());
    film.draw(&mut renderer, &open, &record, to_draw)?;
    // A frame that is drawn again must have the same bytes.
    let after = recorded_checksums(folder)?;
    let changed = after.iter().filter(|(name, sha256)| before.get(*name).is_some_and(|before| before != *sha256));
    for (name, _) in changed {
        tracing::warn!("{name}: its bytes differ from those of the first drawing");
    }
    Ok(())
}
