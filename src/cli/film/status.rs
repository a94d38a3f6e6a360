//! `film status`: lists the frames that are missing, damaged, or from another film.

use std::path::{Path, PathBuf};

use clap::Args;

use super::super::progress::FileProgress;
use super::super::{CliError, inputs, results};
use crate::files;
use crate::output::film::{Fault, FilmError, FilmRecord, FilmStatus, FrameRange, film_status};

/// Arguments of `film status`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian film status film\n  \
    steradian film status film --frames 0..240 --json status.json\n\n\
    Reads every file of the film and compares it with its checksum in film.sha256. Exit code 1 if a file is missing, damaged or foreign.")]
pub struct StatusArguments {
    /// Folder of a film.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Frames that the film must have: A..B excludes B, A..=B includes it. Default: those of all runs so far.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
    /// Write the result as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &StatusArguments) -> Result<(), CliError> {
    let StatusArguments { folder, frames, json } = arguments;
    let (record, status) = read(folder, *frames)?;
    if let Some(path) = json {
        let text = serde_json::to_string_pretty(&status).map_err(CliError::Json)? + "\n";
        let failed = |source| CliError::WriteFile { path: path.clone(), source };
        files::write_whole(path, text.as_bytes()).map_err(failed)?;
    }
    report(folder, &record, &status)?;
    if status.faults.is_empty() {
        return Ok(());
    }
    let [missing, damaged, foreign] = FAULTS.map(|fault| status.count(fault));
    Err(FilmError::Faulty { folder: folder.clone(), missing, damaged, foreign }.into())
}

const FAULTS: [Fault; 3] = [Fault::Missing, Fault::Damaged, Fault::Foreign];

/// Reads all files of a film.
pub(super) fn read(folder: &Path, frames: Option<FrameRange>) -> Result<(FilmRecord, FilmStatus), CliError> {
    let progress = FileProgress::new();
    let status = film_status(folder, frames, &|done, total| progress.read(done, total));
    progress.finish();
    Ok(status?)
}

/// Prints faults, notes and totals.
pub(super) fn report(folder: &Path, record: &FilmRecord, status: &FilmStatus) -> Result<(), CliError> {
    for note in status.notes.iter().chain(&changed_sources(record)) {
        results::line(format!("note: {note}"))?;
    }
    for file in &status.faults {
        results::line(format!("{} {}: {}", file.fault.name(), file.file, file.problem))?;
    }
    let ranges: Vec<String> = status.frames.iter().map(ToString::to_string).collect();
    let faults = FAULTS.map(|fault| format!("{} {}", status.count(fault), fault.name()));
    let without = match status.without_checksum {
        0 => String::new(),
        files => format!("{files} can be read but have no checksum, "),
    };
    results::line(format!(
        "{}: frames {}, {} files: {} verified, {without}{}",
        folder.display(),
        if ranges.is_empty() { "none".to_owned() } else { ranges.join(" and ") },
        status.files,
        status.verified,
        faults.join(", ")
    ))
}

/// Returns a line for each file of the configuration or the path that has changed since the film was begun.
pub(super) fn changed_sources(record: &FilmRecord) -> Vec<String> {
    let changed = |source: &crate::output::provenance::InputFile| {
        let path = record.configuration.folder.join(&source.file);
        let recorded = "the film continues with the version recorded in film.json";
        match inputs::file_sha256(&path) {
            Ok(sha256) if sha256 == source.sha256 => None,
            Ok(_) => Some(format!("{} changed since the film was begun; {recorded}", path.display())),
            Err(error) => Some(format!("{} cannot be read ({error}); {recorded}", path.display())),
        }
    };
    record.sources.iter().filter_map(changed).collect()
}
