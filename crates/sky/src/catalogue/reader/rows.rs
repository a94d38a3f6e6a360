//! The rows of a file on their way to stars, shared by all formats.

use rayon::prelude::*;

use super::columns::Columns;
use super::row::{self, Refusal};
use super::{CatalogueError, CatalogueRead, NAMED_STARS_KEPT, ReadReport};
use crate::catalogue::StarRecord;
use crate::catalogue::names::NamedStar;

/// Stars, names and report of the rows that were read so far.
pub(super) struct Rows {
    report: ReadReport,
    stars: Vec<StarRecord>,
    named: Vec<NamedStar>,
    years: f64,
}

impl Rows {
    /// For a file with these columns, whose stars are placed `years` Julian years after J2000.0.
    pub fn new(file: &str, columns: &Columns, years: f64) -> Self {
        let mut report = ReadReport::new(file);
        report.source = columns.source;
        report.unused.clone_from(&columns.unused);
        Self { report, stars: Vec::new(), named: Vec::new(), years }
    }

    /// Adds a row, or the reason why its fields cannot be read. `place` begins the reason in the report.
    ///
    /// # Errors
    /// The columns do not define the meaning of this row.
    pub fn add<'a>(
        &mut self,
        columns: &Columns,
        fields: Result<impl Fn(usize) -> &'a str, String>,
        (line, place): (usize, &str),
    ) -> Result<(), CatalogueError> {
        self.report.rows += 1;
        let star = fields.map_err(Refusal::Row).and_then(|field| {
            let (star, notes) = row::star(columns, &field, self.years)?;
            if self.stars.len() < NAMED_STARS_KEPT
                && let Some(names) = row::names(columns, &field)
            {
                self.named.push(NamedStar::from_file(names, star));
            }
            Ok((star, notes))
        });
        match star {
            Ok((star, notes)) => {
                self.report.count(notes);
                self.stars.push(star);
            }
            Err(Refusal::Row(reason)) => self.report.reject(line, format!("{place}{reason}")),
            Err(Refusal::File(reason)) => {
                let reason = format!("{place}{reason}");
                return Err(CatalogueError::Malformed { file: self.report.file.clone(), line, reason });
            }
        }
        Ok(())
    }

    /// The result for the whole file; an error if none of its rows is usable.
    pub fn finish(self) -> Result<CatalogueRead, CatalogueError> {
        self.report.finish(self.stars, self.named)
    }
}

/// The stars without those that repeat an earlier one: the same position, magnitude and temperature, bit by bit.
pub(super) fn without_repetitions(mut stars: Vec<StarRecord>) -> Vec<StarRecord> {
    let content = |star: &StarRecord| {
        let p = star.position;
        (p.x.to_bits(), p.y.to_bits(), p.z.to_bits(), star.magnitude.to_bits(), star.temperature_k.to_bits())
    };
    let mut order: Vec<u32> = (0..stars.len() as u32).collect();
    order.par_sort_unstable_by_key(|&index| (content(&stars[index as usize]), index));
    let mut is_repeated = vec![false; stars.len()];
    for pair in order.windows(2) {
        let [first, second] = [pair[0] as usize, pair[1] as usize];
        is_repeated[second] = content(&stars[first]) == content(&stars[second]);
    }
    let mut repeated = is_repeated.into_iter();
    stars.retain(|_| !repeated.next().unwrap_or(false));
    stars
}
