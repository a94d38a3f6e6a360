//! Readers of star catalogues in CSV and JSON files.
//!
//! A reader first recognises the columns ([`columns`]: this program's names, those of HYG, AT-HYG and Gaia archive
//! exports, and a plain `magnitude,temperature,x,y,z`). It then converts each row to a [`StarRecord`] ([`row`]). An
//! unusable row is counted, and the first few are kept with their line and reason; it is always reported and never
//! stops the rest. A file without a usable row is an error. Besides the stars, reading CSV needs memory for one line
//! only.
//!
//! Units: degrees (hours for `ra` of HYG), parsecs, milliarcseconds, magnitudes, kelvin; every name includes its
//! unit.

mod columns;
mod csv;
mod json;
mod row;
mod sexagesimal;

use std::fmt;
use std::path::{Path, PathBuf};

use super::StarRecord;
use crate::files;

pub use csv::{read_csv, read_csv_from};
pub use json::{read_json, read_json_from};

/// Number of rejected rows that [`ReadReport`] keeps with their reason.
pub const REJECTED_ROWS_KEPT: usize = 10;

/// Extensions that [`read_file`] accepts.
pub const EXTENSIONS: &str = ".csv, .txt (CSV) and .json";

/// Result of reading one file.
#[derive(Clone, Debug)]
pub struct CatalogueRead {
    /// The usable stars in the order of the file.
    pub stars: Vec<StarRecord>,
    /// Counts of used and rejected rows.
    pub report: ReadReport,
}

/// Counts of the rows of one file: `rows == used + rejected`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadReport {
    /// The file's name as passed to the reader.
    pub file: String,
    /// Rows (CSV) or entries (JSON) after the header; blank lines and comments do not count.
    pub rows: usize,
    /// Rows that became stars.
    pub used: usize,
    /// Used rows without a distance: the star is at infinity.
    pub without_distance: usize,
    /// Used rows without temperature and colour: the star gets the Sun's temperature.
    pub without_colour: usize,
    /// Used rows with a temperature or colour outside the valid range, which was clamped.
    pub temperature_clamped: usize,
    /// Used rows with Gaia's G instead of V, because BP-RP is missing.
    pub g_taken_as_v: usize,
    /// Rows that could not be used.
    pub rejected: usize,
    /// The first [`REJECTED_ROWS_KEPT`] rejected rows.
    pub first_rejected: Vec<RejectedRow>,
}

/// A row that could not be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RejectedRow {
    /// Line in the file on which the row begins, from 1.
    pub line: usize,
    /// Reason for the rejection.
    pub reason: String,
}

impl ReadReport {
    fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// Counts an unusable row.
    fn reject(&mut self, line: usize, reason: String) {
        self.rejected += 1;
        if self.first_rejected.len() < REJECTED_ROWS_KEPT {
            self.first_rejected.push(RejectedRow { line, reason });
        }
    }

    /// Counts a star and the notes on its row.
    fn count(&mut self, notes: row::Notes) {
        self.used += 1;
        self.without_distance += usize::from(notes.without_distance);
        self.without_colour += usize::from(notes.without_colour);
        self.temperature_clamped += usize::from(notes.temperature_clamped);
        self.g_taken_as_v += usize::from(notes.g_taken_as_v);
    }

    /// Returns the result for a whole file: an error if none of its rows is usable.
    fn finish(self, stars: Vec<StarRecord>) -> Result<CatalogueRead, CatalogueError> {
        if self.rows == 0 {
            return Err(CatalogueError::NoRow { file: self.file });
        }
        let Some(first) = self.first_rejected.first().filter(|_| stars.is_empty()) else {
            return Ok(CatalogueRead { stars, report: self });
        };
        let (line, reason) = (first.line, first.reason.clone());
        Err(CatalogueError::NoUsableRow { file: self.file, rejected: self.rejected, line, reason })
    }
}

impl fmt::Display for ReadReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} of {} rows used", self.file, self.used, self.rows)?;
        for (count, note) in [
            (self.without_distance, "without distance (at infinity)"),
            (self.without_colour, "without colour (5772 K)"),
            (self.temperature_clamped, "with a temperature outside 500 to 100000 K (moved to the edge)"),
            (self.g_taken_as_v, "without BP-RP (G taken as V)"),
        ] {
            if count > 0 {
                write!(f, ", {count} {note}")?;
            }
        }
        write!(f, "; {} rejected", self.rejected)?;
        for row in &self.first_rejected {
            write!(f, "\n  line {}: {}", row.line, row.reason)?;
        }
        let more = self.rejected - self.first_rejected.len().min(self.rejected);
        if more > 0 {
            write!(f, "\n  and {more} more")?;
        }
        Ok(())
    }
}

/// Errors of reading a catalogue. Every message names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CatalogueError {
    /// The file cannot be opened.
    #[error("cannot open the catalogue {}: {source}", path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Reading failed.
    #[error("file {file}: reading failed at line {line}: {source}")]
    Io {
        /// Name of the file.
        file: String,
        /// Line that was being read.
        line: usize,
        /// The system's error.
        source: std::io::Error,
    },
    /// The extension is not supported.
    #[error("file {}: a star catalogue must be one of {EXTENSIONS}", path.display())]
    Extension {
        /// Path of the file.
        path: PathBuf,
    },
    /// The columns are not those of a star catalogue.
    #[error("file {file}: line {line}: {reason}; columns found: {found}; {}", columns::NEEDED)]
    Columns {
        /// Name of the file.
        file: String,
        /// Line of the header.
        line: usize,
        /// Description of the missing or contradictory columns.
        reason: String,
        /// The columns, shortened if there are many.
        found: String,
    },
    /// The file cannot be parsed beyond this line.
    #[error("file {file}: line {line}: {reason}")]
    Malformed {
        /// Name of the file.
        file: String,
        /// The line.
        line: usize,
        /// Description of the problem.
        reason: String,
    },
    /// The file has a header but no rows.
    #[error("file {file}: no row of data")]
    NoRow {
        /// Name of the file.
        file: String,
    },
    /// Every row was rejected.
    #[error("file {file}: no usable row; {rejected} rows rejected, first: line {line}: {reason}")]
    NoUsableRow {
        /// Name of the file.
        file: String,
        /// Number of rejected rows.
        rejected: usize,
        /// Line of the first rejected row.
        line: usize,
        /// Reason for its rejection.
        reason: String,
    },
}

/// Reads a catalogue in the format given by the extension of `path`. Stars are placed `years` Julian years after
/// J2000.0.
///
/// # Errors
/// [`CatalogueError::Extension`] for extensions other than [`EXTENSIONS`] (in upper or lower case), otherwise as
/// [`read_csv`] and [`read_json`].
pub fn read_file(path: &Path, years: f64) -> Result<CatalogueRead, CatalogueError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("csv" | "txt") => read_csv(path, years),
        Some("json") => read_json(path, years),
        _ => Err(CatalogueError::Extension { path: path.to_owned() }),
    }
}

/// Opens `path` for reading.
fn open(path: &Path) -> Result<std::fs::File, CatalogueError> {
    let open_error = |source| CatalogueError::Open { path: path.to_owned(), source };
    files::open_regular(path).map_err(open_error)
}

/// Shortens text from a file for a message: at most 40 characters, control characters escaped.
fn excerpt(text: &str) -> String {
    let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod tests;
