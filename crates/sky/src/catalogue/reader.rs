//! Readers of star catalogues in CSV, JSON, VOTable, FITS and Parquet.
//!
//! A reader first recognises the source of the file from its set of columns ([`sources`]), and then the meaning of the columns ([`columns`]). It
//! knows this program's names, those of HYG, AT-HYG, Gaia archive exports and VizieR, and a plain `magnitude,temperature,x,y,z`. It then converts
//! each row to a [`StarRecord`] ([`row`]). Unusable rows are counted, and the first few are kept with their line and reason. They are always reported
//! and never stop the reading of other rows. A file without a usable row is an error. In addition to the stars, reading CSV needs memory for one line
//! only.
//!
//! Units: degrees (hours for `ra` of HYG), parsecs, milliarcseconds, magnitudes, kelvin; every field name includes its unit.

mod columns;
mod csv;
mod finder;
mod fits;
mod frame;
mod json;
mod parquet;
mod row;
mod rows;
mod scalar;
mod sexagesimal;
mod sources;
mod table;
mod units;
mod votable;

use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;

use serde::{Deserialize, Serialize};

use super::StarRecord;
use super::motion::StarVelocity;
use super::names::{NamedStar, NamesOfStar, StarNames};
use crate::files;

pub use row::MeasuredParallax;
pub use sources::Source;

pub use csv::{read_csv, read_csv_from};
pub use fits::read_fits_from;
pub use json::{read_json, read_json_from};
pub use parquet::read_parquet_from;
pub use votable::read_votable_from;

/// Number of rejected rows that [`ReadReport`] keeps with their reason.
pub const REJECTED_ROWS_KEPT: usize = 10;

/// Number of kinds of problems that [`ReadReport`] counts separately.
const KINDS_KEPT: usize = 20;
/// Kind for rows with other problems.
const OTHER_KINDS: &str = "other reasons";

/// Number of stars of a file whose names are kept.
pub const NAMED_STARS_KEPT: usize = 300_000;

/// Formats that [`read_file`] reads.
pub const FORMATS: &str =
    "CSV, TSV, ECSV, JSON, VOTable, a binary table in FITS, or Parquet, each also compressed with gzip";

/// Largest expanded size of a gzipped Parquet file, bytes, because it is held in memory.
const MOST_GZIP_PARQUET_BYTES: u64 = 1 << 30;

/// Result of reading one file.
#[derive(Clone, Debug)]
pub struct CatalogueRead {
    /// The usable stars in the order of the file.
    pub stars: Vec<StarRecord>,
    /// Names among the first [`NAMED_STARS_KEPT`] stars, by increasing index.
    pub names: Vec<NamesOfStar>,
    /// Velocities of the stars that move, by increasing index.
    pub velocities: Vec<StarVelocity>,
    /// Counts of used and rejected rows.
    pub report: ReadReport,
}

impl CatalogueRead {
    /// The named stars.
    pub fn named(&self) -> Vec<NamedStar> {
        self.names.iter().map(|of| NamedStar::from_file(of.names.clone(), self.stars[of.star as usize])).collect()
    }
}

/// A star that is passed on as soon as its row is read.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamedStar {
    /// The star.
    pub star: StarRecord,
    /// Its velocity, as in [`StarVelocity`].
    pub velocity: Option<[f32; 3]>,
    /// Its names.
    pub names: Option<StarNames>,
    /// Whether it has neither temperature nor colour.
    pub without_colour: bool,
    /// Its parallax, if the file has a column of errors and no distance.
    pub parallax: Option<MeasuredParallax>,
}

/// Counts of the rows of one file: `rows == used + rejected + repeated`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadReport {
    /// The file's name as passed to the reader.
    pub file: String,
    /// The source, recognised from the file's columns.
    pub source: Source,
    /// Columns that are not read although the renderer could use them, with the reason if it is known.
    pub unused: Vec<String>,
    /// Remarks on the whole file, such as columns that have several values.
    pub notes: Vec<String>,
    /// Whether the format has no lines: [`RejectedRow::line`] is then the number of the row.
    pub without_lines: bool,
    /// Number of rows (CSV) or entries (JSON) after the header; blank lines and comments do not count.
    pub rows: usize,
    /// Rows that became stars.
    pub used: usize,
    /// Used rows without a distance: the star is at infinity.
    pub without_distance: usize,
    /// Used rows with a distance below 1 pc, although the Sun is the only star so near.
    pub very_near: usize,
    /// Used rows that are brighter than any real star: probably the Sun, the Moon or a planet.
    pub very_bright: usize,
    /// Used rows without temperature and colour: the star gets the Sun's temperature.
    pub without_colour: usize,
    /// Used rows with a temperature or colour outside the valid range, which was clamped.
    pub temperature_clamped: usize,
    /// Used rows with a colour index that no star can have; it is treated as missing.
    pub colour_ignored: usize,
    /// Used rows with a proper motion or a radial velocity that marks a missing value, such as -9999.
    pub motion_ignored: usize,
    /// Used rows with Hipparcos' Hp instead of V.
    pub hp_taken_as_v: usize,
    /// Used rows with a proper motion or a radial velocity.
    pub moving: usize,
    /// Used rows beyond the first [`NAMED_STARS_KEPT`] whose names are not kept.
    pub names_left_out: usize,
    /// Rows that repeat another row of the file in all fields.
    pub repeated: usize,
    /// Used rows with Gaia's G instead of V, because BP-RP is missing.
    pub g_taken_as_v: usize,
    /// Rows that could not be used.
    pub rejected: usize,
    /// Numbers of rejected rows by kind of problem, in the order of first occurrence. Kinds beyond the first few are counted together.
    pub rejected_kinds: Vec<RejectedKind>,
    /// The first [`REJECTED_ROWS_KEPT`] rejected rows.
    pub first_rejected: Vec<RejectedRow>,
}

/// A row that could not be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectedRow {
    /// Line of the file on which the row begins, from 1; in formats without lines, the number of the row.
    pub line: usize,
    /// Reason for the rejection.
    pub reason: String,
}

/// Rows that could not be used because of the same problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RejectedKind {
    /// The problem, without the values of a row.
    pub kind: String,
    /// Number of rows.
    pub rows: usize,
    /// The first one.
    pub first: RejectedRow,
}

/// A position in a file, for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowPlace {
    /// A line, from 1.
    Line(usize),
    /// A row of a format without lines, from 1.
    Row(usize),
    /// The head of a format without lines.
    Head,
}

impl fmt::Display for RowPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
            Self::Head => f.write_str("head"),
        }
    }
}

impl ReadReport {
    fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// Position of a row, from its line or number.
    fn place(&self, line: usize) -> RowPlace {
        if self.without_lines { RowPlace::Row(line) } else { RowPlace::Line(line) }
    }

    /// Counts an unusable row, with the kind of its problem.
    fn reject(&mut self, line: usize, reason: String, kind: String) {
        self.rejected += 1;
        let is_known = |kind: &str| self.rejected_kinds.iter().position(|known| known.kind == kind);
        let is_full = self.rejected_kinds.len() >= KINDS_KEPT;
        let (kind, known) = match is_known(&kind) {
            None if is_full => (OTHER_KINDS.to_owned(), is_known(OTHER_KINDS)),
            known => (kind, known),
        };
        match known.and_then(|index| self.rejected_kinds.get_mut(index)) {
            Some(known) => known.rows += 1,
            None => {
                let first = RejectedRow { line, reason: reason.clone() };
                self.rejected_kinds.push(RejectedKind { kind, rows: 1, first });
            }
        }
        if self.first_rejected.len() < REJECTED_ROWS_KEPT {
            self.first_rejected.push(RejectedRow { line, reason });
        }
    }

    /// Counts a star and the notes on its row.
    fn count(&mut self, notes: &row::Notes) {
        self.used += 1;
        self.without_distance += usize::from(notes.without_distance);
        self.very_near += usize::from(notes.very_near);
        self.very_bright += usize::from(notes.very_bright);
        self.source = notes.source.unwrap_or(self.source);
        self.without_colour += usize::from(notes.without_colour);
        self.temperature_clamped += usize::from(notes.temperature_clamped);
        self.colour_ignored += usize::from(notes.colour_ignored);
        self.motion_ignored += usize::from(notes.motion_ignored);
        self.g_taken_as_v += usize::from(notes.g_taken_as_v);
        self.hp_taken_as_v += usize::from(notes.hp_taken_as_v);
        self.moving += usize::from(notes.velocity.is_some());
    }

    /// Returns an error if the file has no rows, or if none of them is usable.
    fn check(&self) -> Result<(), CatalogueError> {
        let file = self.file.clone();
        if self.rows == 0 {
            return Err(CatalogueError::NoRow { file });
        }
        match self.first_rejected.first().filter(|_| self.used == 0) {
            Some(first) => Err(CatalogueError::NoUsableRow {
                file,
                rejected: self.rejected,
                place: self.place(first.line),
                reason: first.reason.clone(),
            }),
            None => Ok(()),
        }
    }
}

impl fmt::Display for ReadReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, used, rows, source, rejected, .. } = self;
        write!(f, "{file}: {used} of {rows} rows used, read as {} ({})", source.name(), source.conventions())?;
        for (count, note) in [
            (self.without_distance, "without distance (at infinity)"),
            (self.very_near, "nearer than 1 pc, although the Sun is the only star so near (wrong unit?)"),
            (self.very_bright, "brighter than any star (the Sun, the Moon or a planet?)"),
            (self.without_colour, "without colour (5772 K)"),
            (self.temperature_clamped, "with a temperature outside 500 to 100000 K (moved to the nearest limit)"),
            (self.colour_ignored, "with a colour index outside -1.5 to 8.5 (taken as missing)"),
            (self.motion_ignored, "with a motion of nines, such as -9999 (taken as missing)"),
            (self.g_taken_as_v, "without BP-RP (G taken as V)"),
            (self.hp_taken_as_v, "without V (Hp taken as V)"),
            (self.repeated, "repeated (drawn once)"),
            (self.names_left_out, "with names that are not kept (only those of the first 300000 stars are)"),
        ] {
            if count > 0 {
                write!(f, ", {count} {note}")?;
            }
        }
        if !self.unused.is_empty() {
            write!(f, "; columns that are not read: {}", self.unused.join(", "))?;
        }
        for note in &self.notes {
            write!(f, "; {note}")?;
        }
        write!(f, "; {rejected} rejected")?;
        for row in &self.first_rejected {
            write!(f, "\n  {}: {}", self.place(row.line), row.reason)?;
        }
        let more = self.rejected - self.first_rejected.len().min(self.rejected);
        if more > 0 {
            write!(f, "\n  and {more} more; of all {rejected}:")?;
            for RejectedKind { kind, rows, .. } in &self.rejected_kinds {
                write!(f, "\n  {rows} rows: {kind}")?;
            }
        }
        Ok(())
    }
}

/// Errors from reading a catalogue. Every message names the file.
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
    #[error("file {file}: reading failed at {place}: {source}")]
    Io {
        /// Name of the file.
        file: String,
        /// Part of the file that was being read.
        place: RowPlace,
        /// The system's error.
        source: std::io::Error,
    },
    /// The format is not supported.
    #[error("file {}: {found}; a star catalogue must be {FORMATS}", path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// The format, recognised from its first bytes.
        found: String,
    },
    /// The columns are not those of a star catalogue.
    #[error("file {file}: {place}: {reason}; columns found: {found}; {}", columns::NEEDED)]
    Columns {
        /// Name of the file.
        file: String,
        /// Place of the header.
        place: RowPlace,
        /// Description of the missing or contradictory columns.
        reason: String,
        /// The columns, shortened if there are many.
        found: String,
    },
    /// The file cannot be read beyond this position.
    #[error("file {file}: {place}: {reason}")]
    Malformed {
        /// Name of the file.
        file: String,
        /// The place.
        place: RowPlace,
        /// Description of the problem.
        reason: String,
    },
    /// A right ascension must be in degrees, although its column does not state the unit. In this case [`read_file`] and [`stream_file`] read the
    /// file again with right ascensions in degrees; readers of a stream cannot do this.
    #[error("file {file}: {place}: {reason}")]
    Degrees {
        /// Name of the file.
        file: String,
        /// Place of the row.
        place: RowPlace,
        /// The value, and the remedy.
        reason: String,
    },
    /// The receiver of the stars was dropped.
    #[error("file {file}: reading was stopped")]
    Stopped {
        /// Name of the file.
        file: String,
    },
    /// The file has a header but no rows.
    #[error("file {file}: no row of data")]
    NoRow {
        /// Name of the file.
        file: String,
    },
    /// Every row was rejected.
    #[error("file {file}: no usable row; {rejected} rows rejected, first: {place}: {reason}")]
    NoUsableRow {
        /// Name of the file.
        file: String,
        /// Number of rejected rows.
        rejected: usize,
        /// Place of the first rejected row.
        place: RowPlace,
        /// Reason for its rejection.
        reason: String,
    },
}

/// Reads a catalogue; its format is recognised from its first bytes. A file compressed with gzip is expanded while it is read. Stars are placed
/// `years` Julian years after J2000.0.
///
/// # Errors
/// [`CatalogueError::Format`] for a format other than [`FORMATS`], otherwise the errors of the reader of the format.
pub fn read_file(path: &Path, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(path, &years.into())
}

/// Reads a catalogue in the same way, and sends its stars in batches while it reads them. The memory does not grow with the number of rows, except
/// for JSON and gzipped Parquet. Repeated rows are not detected: they are counted as used.
///
/// # Errors
/// Those of [`read_file`], or the receiver was dropped.
pub fn stream_file(
    path: &Path,
    years: f64,
    stream: SyncSender<Vec<StreamedStar>>,
) -> Result<ReadReport, CatalogueError> {
    read(path, &rows::Reading { stream: Some(stream), ..years.into() }).map(|read| read.report)
}

fn read(path: &Path, reading: &rows::Reading) -> Result<CatalogueRead, CatalogueError> {
    match read_once(path, reading) {
        // No star has been passed on yet, because without the unit no row has a direction.
        Err(CatalogueError::Degrees { .. }) => {
            read_once(path, &rows::Reading { ra_in_degrees: true, ..reading.clone() })
        }
        read => read,
    }
}

fn read_once(path: &Path, reading: &rows::Reading) -> Result<CatalogueRead, CatalogueError> {
    let name = path.display().to_string();
    let io_error = |source| CatalogueError::Io { file: name.clone(), place: RowPlace::Head, source };
    let (mut source, is_gzip) = files::expanded(open(path)?).map_err(io_error)?;
    let start = source.fill_buf().map_err(io_error)?;
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let unknown = [
        (&b"PK\x03\x04"[..], "it is a ZIP archive"),
        (b"\x89HDF", "it is an HDF5 file"),
        (b"\xfd7zXZ", "it is compressed with xz"),
        (b"BZh", "it is compressed with bzip2"),
        (b"\x28\xb5\x2f\xfd", "it is compressed with zstd"),
        (b"\xff\xfe", "it is text in UTF-16; save it as UTF-8"),
        (b"\xfe\xff", "it is text in UTF-16; save it as UTF-8"),
    ];
    if let Some((_, found)) = unknown.iter().find(|(bytes, _)| text.starts_with(bytes)) {
        return Err(CatalogueError::Format { path: path.to_owned(), found: (*found).to_owned() });
    }
    if text.starts_with(b"SIMPLE  =") {
        return fits::read(source, &name, reading);
    }
    if text.starts_with(b"PAR1") {
        if !is_gzip {
            return parquet::read(open(path)?, &name, reading);
        }
        // Parquet is read from its end, so that the expanded file must be in memory.
        let mut bytes = Vec::new();
        source.take(MOST_GZIP_PARQUET_BYTES + 1).read_to_end(&mut bytes).map_err(io_error)?;
        if bytes.len() as u64 > MOST_GZIP_PARQUET_BYTES {
            let found = format!("it is gzipped Parquet of more than {MOST_GZIP_PARQUET_BYTES} bytes; expand it");
            return Err(CatalogueError::Format { path: path.to_owned(), found });
        }
        return parquet::read(bytes::Bytes::from(bytes), &name, reading);
    }
    if text.starts_with(b"<") {
        return votable::read(source, &name, reading);
    }
    if start.iter().take(512).any(|byte| *byte == 0) {
        return Err(CatalogueError::Format { path: path.to_owned(), found: "it is not text".to_owned() });
    }
    if start.contains(&b'\r') && !start.contains(&b'\n') && !text.starts_with(b"{") && !text.starts_with(b"[") {
        let found = "its lines end with carriage returns alone; end them with line feeds".to_owned();
        return Err(CatalogueError::Format { path: path.to_owned(), found });
    }
    match text.first() {
        Some(b'{' | b'[') => json::read(source, &name, reading),
        _ => csv::read(source, &name, reading),
    }
}

/// Opens `path` for reading.
fn open(path: &Path) -> Result<std::fs::File, CatalogueError> {
    let open_error = |source| CatalogueError::Open { path: path.to_owned(), source };
    files::open_regular(path).map_err(open_error)
}

/// Shortens text from a file for a message: to at most 40 characters, with control characters escaped.
fn excerpt(text: &str) -> String {
    let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod delivered_tests;
#[cfg(test)]
mod format_tests;
#[cfg(test)]
mod source_tests;
#[cfg(test)]
mod tests;
