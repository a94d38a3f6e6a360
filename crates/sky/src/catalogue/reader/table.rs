//! Tables of formats whose head gives the names, units and meanings of the columns: VOTable, FITS and Parquet.

use super::columns::{self, Columns, Direction};
use super::frame::Frame;
use super::rows::{Reading, Rows};
use super::{CatalogueError, CatalogueRead, RowPlace};

/// UCDs (IVOA, Unified Content Descriptors 1+) that identify a column with an unknown name: beginning of the UCD, and this program's column name with
/// the same meaning.
const UCDS: [(&str, &str); 11] = [
    ("pos.eq.ra", "ra_deg"),
    ("pos.eq.dec", "dec_deg"),
    ("pos.parallax", "parallax_mas"),
    ("pos.distance", "distance_pc"),
    ("pos.pm;pos.eq.ra", "pm_ra_mas_yr"),
    ("pos.pm;pos.eq.dec", "pm_dec_mas_yr"),
    ("spect.dopplerveloc", "radial_velocity_km_s"),
    ("phot.mag;em.opt.v", "v_mag"),
    ("phot.color;em.opt.b;em.opt.v", "b_v"),
    ("phys.temperature.effective", "teff_k"),
    ("meta.id;meta.main", "name"),
];

/// Head of a table: one entry for each column.
#[derive(Clone, Debug, Default)]
pub(super) struct Head {
    pub names: Vec<String>,
    /// Units; empty if the column has none.
    pub units: Vec<String>,
    /// UCDs; empty if the column has none.
    pub ucds: Vec<String>,
    /// Frame of reference of each column's positions.
    pub frames: Vec<Frame>,
}

impl Head {
    /// Adds a column.
    pub fn push(&mut self, name: &str, unit: &str, ucd: &str) {
        self.names.push(name.to_owned());
        self.units.push(unit.to_owned());
        self.ucds.push(ucd.to_owned());
        self.frames.push(Frame::default());
    }

    /// Recognises the columns by their names or, if these are not the names of a star catalogue, also by their UCDs.
    fn columns(&self) -> Result<Columns, String> {
        let by_name = Columns::recognise(&self.names, Some(&self.units));
        if by_name.is_ok() {
            return by_name;
        }
        let mut names = self.names.clone();
        for (name, ucd) in names.iter_mut().zip(&self.ucds) {
            let ucd = ucd.to_lowercase();
            let is_value = !ucd.starts_with("stat.");
            if let Some((_, known)) = UCDS.iter().find(|(begin, _)| is_value && ucd.starts_with(begin)) {
                *name = (*known).to_owned();
            }
        }
        if names == self.names {
            return by_name;
        }
        let by_ucd = Columns::recognise(&names, Some(&self.units));
        by_ucd
            .map(|columns| columns.called(&self.names))
            .map_err(|reason| format!("{reason} (columns identified by their UCDs)"))
    }
}

/// A table whose rows are converted to stars.
pub(super) struct Table {
    columns: Columns,
    rows: Rows,
}

impl Table {
    /// Creates a table with this head.
    ///
    /// # Errors
    /// The columns are not those of a star catalogue.
    pub fn new(file: &str, head: &Head, reading: &Reading) -> Result<Self, CatalogueError> {
        let columns = head.columns().map_err(|reason| CatalogueError::Columns {
            file: file.to_owned(),
            place: RowPlace::Head,
            reason,
            found: columns::listing(&head.names),
        })?;
        let mut columns = columns.in_degrees(reading.ra_in_degrees);
        let ra = match columns.direction {
            Direction::Equatorial { ra, .. } => ra,
            Direction::Cartesian([x, ..]) => x,
        };
        if let Some(frame) = head.frames.get(ra) {
            let epoch = frame.epoch().map_err(|reason| CatalogueError::Malformed {
                file: file.to_owned(),
                place: RowPlace::Head,
                reason,
            })?;
            columns.epoch = epoch.unwrap_or(columns.epoch);
        }
        let rows = Rows::new(file, &columns, reading).without_lines();
        Ok(Self { columns, rows })
    }

    /// Adds a row with the text of each column, or the reason why it cannot be read.
    ///
    /// # Errors
    /// The columns do not define the meaning of this row.
    pub fn add(&mut self, fields: Result<&[String], String>) -> Result<(), CatalogueError> {
        let read = fields.and_then(|fields| {
            if fields.len() == self.columns.len() {
                Ok(|i: usize| fields[i].as_str())
            } else {
                Err(format!("{} fields instead of {}", fields.len(), self.columns.len()))
            }
        });
        let row = self.rows.count() + 1;
        self.rows.add(&self.columns, read, (row, ""))
    }

    /// Number of rows that were added.
    pub fn count(&self) -> usize {
        self.rows.count()
    }

    /// Adds a remark on the file to the report.
    pub fn note(&mut self, note: String) {
        self.rows.note(note);
    }

    /// Returns the result for the whole file; an error if none of its rows is usable.
    pub fn finish(self) -> Result<CatalogueRead, CatalogueError> {
        self.rows.finish()
    }
}
