//! Converts the rows of a file to stars; shared by all formats.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::mpsc::SyncSender;

use rayon::prelude::*;

use super::columns::Columns;
use super::row::{self, Notes, Refusal};
use super::{CatalogueError, CatalogueRead, NAMED_STARS_KEPT, ReadReport, StreamedStar};
use crate::catalogue::StarRecord;
use crate::catalogue::motion::StarVelocity;
use crate::catalogue::names::NamesOfStar;

/// Number of stars that are sent at a time.
const BATCH: usize = 4096;

/// Options of reading: the time at which stars are placed, and the receiver of the stars.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    /// Julian years after J2000.0.
    pub years: f64,
    /// Receiver of the stars; without a receiver they are kept in memory.
    pub stream: Option<SyncSender<Vec<StreamedStar>>>,
    /// Whether right ascensions of unknown unit are in degrees, because one of them cannot be in hours.
    pub ra_in_degrees: bool,
}

impl From<f64> for Reading {
    fn from(years: f64) -> Self {
        Self { years, stream: None, ra_in_degrees: false }
    }
}

/// Stars, names and report of the rows that were read so far.
pub(super) struct Rows {
    report: ReadReport,
    stars: Vec<StarRecord>,
    /// Hash of all fields of each star's row.
    hashes: Vec<u64>,
    names: Vec<NamesOfStar>,
    velocities: Vec<StarVelocity>,
    reading: Reading,
    /// Stars that have not been sent yet.
    batch: Vec<StreamedStar>,
    /// Line and reason of the first row whose right ascension may be in hours or degrees.
    undecided: Option<(usize, String)>,
}

impl Rows {
    /// Creates the rows of a file with these columns.
    pub fn new(file: &str, columns: &Columns, reading: &Reading) -> Self {
        let mut report = ReadReport::new(file);
        report.source = columns.source;
        report.unused.clone_from(&columns.unused);
        if reading.ra_in_degrees {
            report.notes.push("right ascensions are in degrees, because one of them cannot be hours".to_owned());
        }
        Self {
            report,
            stars: Vec::new(),
            hashes: Vec::new(),
            names: Vec::new(),
            velocities: Vec::new(),
            reading: reading.clone(),
            batch: Vec::new(),
            undecided: None,
        }
    }

    /// Marks the format as one without lines.
    pub fn without_lines(mut self) -> Self {
        self.report.without_lines = true;
        self
    }

    /// Number of rows that were added.
    pub fn count(&self) -> usize {
        self.report.rows
    }

    /// Adds a remark on the whole file to the report.
    pub fn note(&mut self, note: String) {
        self.report.notes.push(note);
    }

    /// Adds a row, or the reason why its fields cannot be read. The reason in the report begins with `place`.
    ///
    /// # Errors
    /// The columns do not define the meaning of this row, or the receiver of the stars was dropped.
    pub fn add<'a>(
        &mut self,
        columns: &Columns,
        fields: Result<impl Fn(usize) -> &'a str, String>,
        (line, place): (usize, &str),
    ) -> Result<(), CatalogueError> {
        self.report.rows += 1;
        if self.reading.stream.is_some() {
            return self.stream(columns, fields, (line, place));
        }
        let star = fields.map_err(Refusal::row).and_then(|field| {
            let (star, notes) = row::star(columns, &field, self.reading.years)?;
            let mut hasher = DefaultHasher::new();
            (0..columns.len()).for_each(|column| field(column).trim().hash(&mut hasher));
            if self.stars.len() >= NAMED_STARS_KEPT {
                self.report.names_left_out += usize::from(row::has_names(columns, &field));
            } else if let Some(names) = row::names(columns, &field) {
                self.names.push(NamesOfStar { star: self.stars.len() as u32, names });
            }
            Ok((star, notes, hasher.finish()))
        });
        match star {
            Ok((star, notes, hash)) => {
                self.report.count(&notes);
                if let Some(velocity) = notes.velocity {
                    self.velocities.push(StarVelocity { star: self.stars.len() as u32, velocity });
                }
                self.stars.push(star);
                self.hashes.push(hash);
            }
            Err(refusal) => return self.refuse(refusal, (line, place)),
        }
        Ok(())
    }

    /// Counts a refused row.
    fn refuse(&mut self, refusal: Refusal, (line, place): (usize, &str)) -> Result<(), CatalogueError> {
        match refusal {
            Refusal::Row(reason) => {
                self.report.reject(line, format!("{place}{}", reason.text), reason.kind);
                Ok(())
            }
            Refusal::HoursOrDegrees(reason) => {
                self.undecided.get_or_insert((line, format!("{place}{reason}")));
                Ok(())
            }
            Refusal::Degrees { reason, refutes } => {
                let (file, place, reason) =
                    (self.report.file.clone(), self.report.place(line), format!("{place}{reason}"));
                // The file cannot be read again in degrees if an earlier row was sexagesimal, that is, in hours, or if its star has already been
                // passed on.
                let can_begin_again = self.report.used == 0 || (refutes && self.reading.stream.is_none());
                Err(if can_begin_again {
                    CatalogueError::Degrees { file, place, reason }
                } else {
                    CatalogueError::Malformed { file, place, reason }
                })
            }
        }
    }

    /// As [`Self::add`], if stars are sent to a receiver.
    fn stream<'a>(
        &mut self,
        columns: &Columns,
        fields: Result<impl Fn(usize) -> &'a str, String>,
        place: (usize, &str),
    ) -> Result<(), CatalogueError> {
        let star = fields.map_err(Refusal::row).and_then(|field| {
            let (star, notes) = row::star(columns, &field, self.reading.years)?;
            Ok((star, notes, row::names(columns, &field)))
        });
        match star {
            Ok((star, notes, names)) => {
                self.report.count(&notes);
                let Notes { velocity, without_colour, parallax, .. } = notes;
                self.batch.push(StreamedStar { star, velocity, names, without_colour, parallax });
                if self.batch.len() == BATCH { self.send() } else { Ok(()) }
            }
            Err(refusal) => self.refuse(refusal, place),
        }
    }

    /// Sends the stars of the batch.
    fn send(&mut self) -> Result<(), CatalogueError> {
        let batch = std::mem::take(&mut self.batch);
        let Some(stream) = &self.reading.stream else { return Ok(()) };
        stream.send(batch).map_err(|_| CatalogueError::Stopped { file: self.report.file.clone() })
    }

    /// Returns the result for the whole file; an error if none of its rows is usable.
    pub fn finish(mut self) -> Result<CatalogueRead, CatalogueError> {
        if let Some((line, reason)) = self.undecided {
            let place = self.report.place(line);
            return Err(CatalogueError::Malformed { file: self.report.file, place, reason });
        }
        self.send()?;
        let Self { mut report, mut stars, hashes, mut names, mut velocities, .. } = self;
        report.check()?;
        // Remove rows that repeat another one, and adjust the indices of the others.
        let is_repeated = repetitions(&stars, &hashes);
        report.repeated = is_repeated.iter().filter(|repeated| **repeated).count();
        report.used -= report.repeated;
        if report.repeated > 0 {
            let mut kept = 0;
            let mut index = |repeated: &bool| {
                kept += u32::from(!repeated);
                (!repeated).then(|| kept - 1)
            };
            let indices: Vec<Option<u32>> = is_repeated.iter().map(&mut index).collect();
            let index = |star: u32| indices.get(star as usize).copied().flatten();
            velocities =
                velocities.into_iter().filter_map(|v| Some(StarVelocity { star: index(v.star)?, ..v })).collect();
            report.moving = velocities.len();
            names = names.into_iter().filter_map(|of| Some(NamesOfStar { star: index(of.star)?, ..of })).collect();
            let mut repeated = is_repeated.into_iter();
            stars.retain(|_| !repeated.next().unwrap_or(false));
        }
        Ok(CatalogueRead { stars, names, velocities, report })
    }
}

/// Returns for each star whether its row repeats an earlier one in all fields; the hashes of the rows are compared. Rows with the same position and
/// brightness but different catalogue numbers may be a double star.
fn repetitions(stars: &[StarRecord], hashes: &[u64]) -> Vec<bool> {
    let mut order: Vec<u32> = (0..stars.len() as u32).collect();
    order.par_sort_unstable_by_key(|&index| (hashes[index as usize], index));
    let mut is_repeated = vec![false; stars.len()];
    for pair in order.windows(2) {
        let [first, second] = [pair[0] as usize, pair[1] as usize];
        is_repeated[second] = hashes[first] == hashes[second] && stars[first] == stars[second];
    }
    is_repeated
}
