//! Readers of star catalogues in files: CSV and JSON.
//!
//! A reader first recognises the columns ([`columns`]: our own names and those of HYG, AT-HYG, Gaia archive exports and
//! a plain `magnitude,temperature,x,y,z`), then turns row after row into [`StarRecord`]s ([`row`]). A row that cannot be
//! used is counted and the first few are kept with line and reason; it never disappears in silence and never stops the
//! rest. A file without a usable row is an error. Apart from the stars themselves, reading CSV needs memory for one line.
//!
//! Units: degrees (hours for `ra` of HYG), parsecs, milliarcseconds, magnitudes, kelvin; every name says which.

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

/// How many rejected rows [`ReadReport`] keeps with their reason.
pub const REJECTED_ROWS_KEPT: usize = 10;

/// Extensions that [`read_file`] knows.
pub const EXTENSIONS: &str = ".csv, .txt (CSV) and .json";

/// What a reader found in one file.
#[derive(Clone, Debug)]
pub struct CatalogueRead {
    /// The usable stars in the order of the file.
    pub stars: Vec<StarRecord>,
    /// What became of every row.
    pub report: ReadReport,
}

/// What became of the rows of one file: `rows == used + rejected`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadReport {
    /// The file's name as given.
    pub file: String,
    /// Rows (CSV) or entries (JSON) after the header; blank lines and comments do not count.
    pub rows: usize,
    /// Rows that became stars.
    pub used: usize,
    /// Used, but without distance: at infinity.
    pub without_distance: usize,
    /// Used, but with neither temperature nor colour: given the Sun's temperature.
    pub without_colour: usize,
    /// Used with a temperature or a colour outside the possible range, moved to its edge.
    pub temperature_clamped: usize,
    /// Used with Gaia's G in place of V, because BP-RP is missing.
    pub g_taken_as_v: usize,
    /// Rows that could not be used.
    pub rejected: usize,
    /// The first [`REJECTED_ROWS_KEPT`] of them.
    pub first_rejected: Vec<RejectedRow>,
}

/// A row that could not be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RejectedRow {
    /// Line in the file on which the row begins, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

impl ReadReport {
    fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// Counts a row that cannot be used.
    fn reject(&mut self, line: usize, reason: String) {
        self.rejected += 1;
        if self.first_rejected.len() < REJECTED_ROWS_KEPT {
            self.first_rejected.push(RejectedRow { line, reason });
        }
    }

    /// Counts a star and how it came about.
    fn count(&mut self, notes: row::Notes) {
        self.used += 1;
        self.without_distance += usize::from(notes.without_distance);
        self.without_colour += usize::from(notes.without_colour);
        self.temperature_clamped += usize::from(notes.temperature_clamped);
        self.g_taken_as_v += usize::from(notes.g_taken_as_v);
    }

    /// The result of a whole file: an error if none of its rows is usable.
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
        for (count, what) in [
            (self.without_distance, "without distance (at infinity)"),
            (self.without_colour, "without colour (5772 K)"),
            (self.temperature_clamped, "with a temperature outside 500 to 100000 K (moved to the edge)"),
            (self.g_taken_as_v, "without BP-RP (G taken as V)"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
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

/// Why a catalogue could not be read. Every message names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CatalogueError {
    /// The file cannot be opened.
    #[error("cannot open the catalogue {}: {source}", path.display())]
    Open {
        /// Its path.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Reading broke off.
    #[error("file {file}: reading failed at line {line}: {source}")]
    Io {
        /// Name of the file.
        file: String,
        /// Line that was being read.
        line: usize,
        /// The system's reason.
        source: std::io::Error,
    },
    /// No reader for this kind of file.
    #[error("file {}: a star catalogue must be one of {EXTENSIONS}", path.display())]
    Extension {
        /// Its path.
        path: PathBuf,
    },
    /// The columns do not make a star catalogue.
    #[error("file {file}: line {line}: {reason}; columns found: {found}; {}", columns::NEEDED)]
    Columns {
        /// Name of the file.
        file: String,
        /// Line of the header.
        line: usize,
        /// What is missing or contradictory.
        reason: String,
        /// The columns, shortened if many.
        found: String,
    },
    /// The file as a whole cannot be understood from this line on.
    #[error("file {file}: line {line}: {reason}")]
    Malformed {
        /// Name of the file.
        file: String,
        /// The line.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// A header, but nothing after it.
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
        /// How many rows there were.
        rejected: usize,
        /// Line of the first.
        line: usize,
        /// What is wrong with the first.
        reason: String,
    },
}

/// Reads a catalogue; the extension of `path` tells the format. Stars are placed `years` Julian years after J2000.0.
///
/// # Errors
/// [`CatalogueError::Extension`] for anything but [`EXTENSIONS`] (in upper or lower case), else as [`read_csv`] and
/// [`read_json`].
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
