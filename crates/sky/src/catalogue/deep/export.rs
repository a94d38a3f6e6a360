//! Exports deep stores and single-file stores as CSV or Parquet. The columns are those of this program's own table format, which its readers
//! understand.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use tempfile::NamedTempFile;

use super::super::StarRecord;
use super::super::motion::StarMotion;
use super::super::store::Store;
use super::DeepStore;
use super::build::{NewStar, OnStep};
use super::error::DeepError;
use super::slice::{Selection, each_bright_star, each_star};
use crate::coordinates::lon_lat_from_direction;
use crate::files;

/// Columns of an export.
const COLUMNS: [&str; 10] = [
    "ra_deg",
    "dec_deg",
    "v_mag",
    "teff_k",
    "distance_pc",
    "pm_ra_mas_yr",
    "pm_dec_mas_yr",
    "radial_velocity_km_s",
    "ref_epoch",
    "name",
];

/// Number of rows in a row group of a Parquet file.
const ROWS_PER_GROUP: usize = 1 << 18;

/// A row of an export. Missing values are `None`.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    ra_deg: f64,
    dec_deg: f64,
    v_mag: f64,
    teff_k: f64,
    distance_pc: Option<f64>,
    /// Proper motion in right ascension times the cosine of the declination and in declination, mas per year, and radial velocity, km/s.
    motion: Option<[f64; 3]>,
    ref_epoch: f64,
    name: String,
}

impl Row {
    fn new(star: &StarRecord, about: &NewStar, ref_epoch: f64) -> Self {
        let (ra, dec) = lon_lat_from_direction(star.position);
        let distance = star.position.length();
        let distance_pc = star.distance_known.then_some(distance);
        let motion = about.velocity.map(|velocity| {
            let velocity = glam::Vec3::from_array(velocity).as_dvec3();
            let motion = StarMotion::from_velocity(velocity, star.position / distance, distance_pc);
            [1e3 * motion.pm_ra_arcsec, 1e3 * motion.pm_dec_arcsec, motion.radial_velocity_km_s]
        });
        let name = about.names.as_ref().map(|names| {
            if names.name.is_empty() {
                names.designations.first().cloned().unwrap_or_default()
            } else {
                names.name.clone()
            }
        });
        Self {
            ra_deg: ra.to_degrees().rem_euclid(360.0),
            dec_deg: dec.to_degrees(),
            v_mag: star.apparent_magnitude(),
            teff_k: f64::from(star.temperature_k),
            distance_pc,
            motion,
            ref_epoch,
            name: name.unwrap_or_default(),
        }
    }

    /// The fields of a row, in the order of [`COLUMNS`], with a precision of 0.04 mas and 0.0001 mag.
    fn fields(&self) -> [String; COLUMNS.len()] {
        let [pm_ra, pm_dec, radial] = self.motion.map_or_else(Default::default, |[ra, dec, radial]| {
            [format!("{ra:.4}"), format!("{dec:.4}"), format!("{radial:.3}")]
        });
        [
            format!("{:.8}", self.ra_deg),
            format!("{:.8}", self.dec_deg),
            format!("{:.4}", self.v_mag),
            format!("{:.0}", self.teff_k),
            self.distance_pc.map_or_else(String::new, |distance| (distance as f32).to_string()),
            pm_ra,
            pm_dec,
            radial,
            self.ref_epoch.to_string(),
            self.name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect(),
        ]
    }
}

/// Formats of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Csv,
    Parquet,
}

/// Writer of the rows in one of the formats.
enum Target {
    Csv(csv::Writer<NamedTempFile>),
    Parquet { writer: SerializedFileWriter<File>, file: NamedTempFile, rows: Vec<Row> },
}

const SCHEMA: &str = "message stars {
    REQUIRED DOUBLE ra_deg; REQUIRED DOUBLE dec_deg; REQUIRED FLOAT v_mag; REQUIRED FLOAT teff_k; OPTIONAL DOUBLE distance_pc;
    OPTIONAL DOUBLE pm_ra_mas_yr; OPTIONAL DOUBLE pm_dec_mas_yr; OPTIONAL DOUBLE radial_velocity_km_s;
    REQUIRED DOUBLE ref_epoch; OPTIONAL BYTE_ARRAY name (UTF8);
}";

impl Target {
    fn create(path: &Path, format: Format) -> Result<Self, DeepError> {
        let file = files::beside(path).map_err(DeepError::io(path))?;
        if format == Format::Csv {
            let mut out = csv::WriterBuilder::new().buffer_capacity(1 << 20).from_writer(file);
            out.write_record(COLUMNS).map_err(|error| DeepError::io(path)(error.into()))?;
            return Ok(Self::Csv(out));
        }
        let failed = |error: ParquetError| parquet_error(path, &error);
        let schema = Arc::new(parse_message_type(SCHEMA).map_err(failed)?);
        let level = ZstdLevel::try_new(3).map_err(failed)?;
        let properties = WriterProperties::builder().set_compression(Compression::ZSTD(level)).build();
        let copy = file.reopen().map_err(DeepError::io(path))?;
        let writer = SerializedFileWriter::new(copy, schema, Arc::new(properties)).map_err(failed)?;
        Ok(Self::Parquet { writer, file, rows: Vec::new() })
    }

    fn add(&mut self, path: &Path, row: Row) -> Result<(), DeepError> {
        match self {
            Self::Csv(out) => out.write_record(row.fields()).map_err(|error| DeepError::io(path)(error.into())),
            Self::Parquet { writer, rows, .. } => {
                rows.push(row);
                if rows.len() < ROWS_PER_GROUP {
                    return Ok(());
                }
                write_group(writer, rows).map_err(|error| parquet_error(path, &error))?;
                rows.clear();
                Ok(())
            }
        }
    }

    fn finish(self, path: &Path) -> Result<(), DeepError> {
        let file = match self {
            Self::Csv(out) => out.into_inner().map_err(|error| DeepError::io(path)(error.into_error()))?,
            Self::Parquet { mut writer, file, rows } => {
                let write = |writer: &mut SerializedFileWriter<File>| {
                    write_group(writer, &rows)?;
                    writer.finish()
                };
                write(&mut writer).map_err(|error| parquet_error(path, &error))?;
                file
            }
        };
        files::publish(file, path).map_err(DeepError::io(path))
    }
}

fn parquet_error(path: &Path, error: &ParquetError) -> DeepError {
    DeepError::Export { path: path.to_owned(), problem: error.to_string() }
}

/// Writes rows as a row group of a Parquet file.
fn write_group(writer: &mut SerializedFileWriter<File>, rows: &[Row]) -> Result<(), ParquetError> {
    if rows.is_empty() {
        return Ok(());
    }
    type Optional = fn(&Row) -> Option<f64>;
    let float: [fn(&Row) -> f64; 2] = [|row| row.v_mag, |row| row.teff_k];
    let angles: [fn(&Row) -> f64; 2] = [|row| row.ra_deg, |row| row.dec_deg];
    let optional: [Optional; 4] = [
        |row| row.distance_pc,
        |row| row.motion.map(|motion| motion[0]),
        |row| row.motion.map(|motion| motion[1]),
        |row| row.motion.map(|motion| motion[2]),
    ];
    let mut group = writer.next_row_group()?;
    let next = |group: &mut parquet::file::writer::SerializedRowGroupWriter<'_, File>,
                index: usize|
     -> Result<(), ParquetError> {
        let column = group.next_column()?;
        let mut column = column.ok_or_else(|| ParquetError::General("a column is missing".to_owned()))?;
        match index {
            0 | 1 => {
                let values: Vec<f64> = rows.iter().map(angles[index]).collect();
                column.typed::<DoubleType>().write_batch(&values, None, None)?;
            }
            2 | 3 => {
                let values: Vec<f32> = rows.iter().map(|row| float[index - 2](row) as f32).collect();
                column.typed::<FloatType>().write_batch(&values, None, None)?;
            }
            4..=7 => {
                let values: Vec<Option<f64>> = rows.iter().map(optional[index - 4]).collect();
                let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
                let values: Vec<f64> = values.into_iter().flatten().collect();
                column.typed::<DoubleType>().write_batch(&values, Some(&levels), None)?;
            }
            8 => {
                let values: Vec<f64> = rows.iter().map(|row| row.ref_epoch).collect();
                column.typed::<DoubleType>().write_batch(&values, None, None)?;
            }
            _ => {
                let levels: Vec<i16> = rows.iter().map(|row| i16::from(!row.name.is_empty())).collect();
                let names =
                    rows.iter().filter(|row| !row.name.is_empty()).map(|row| ByteArray::from(row.name.as_str()));
                let names: Vec<ByteArray> = names.collect();
                column.typed::<ByteArrayType>().write_batch(&names, Some(&levels), None)?;
            }
        }
        column.close()
    };
    for index in 0..COLUMNS.len() {
        next(&mut group, index)?;
    }
    group.close()?;
    Ok(())
}

/// The store whose stars are exported.
#[derive(Clone, Copy, Debug)]
pub enum Rows<'a> {
    /// A single-file store.
    Single(&'a Store),
    /// A deep store.
    Deep(&'a DeepStore),
}

/// Writes the stars of a store that meet the conditions to a file, whose extension must be `.csv` or `.parquet`. The columns are right ascension,
/// declination (ICRS, at `ref_epoch`), V, temperature, distance, motion, epoch and name. Returns the number of rows.
///
/// # Errors
/// The extension is not supported, the store is damaged, or the file cannot be written. In these cases no file is left.
pub fn export(stars: Rows<'_>, selection: &Selection, path: &Path, on_step: &mut OnStep<'_>) -> Result<u64, DeepError> {
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
    let format = match extension.as_ref().and_then(|extension| extension.to_str()) {
        Some("csv") => Format::Csv,
        Some("parquet") => Format::Parquet,
        _ => {
            let problem = "its name must end with .csv or .parquet".to_owned();
            return Err(DeepError::Export { path: path.to_owned(), problem });
        }
    };
    let mut target = Target::create(path, format)?;
    let mut rows = 0;
    let mut add = |star: StarRecord, epoch_year: f64, about: NewStar| {
        rows += 1;
        target.add(path, Row::new(&star, &about, epoch_year))
    };
    match stars {
        Rows::Single(store) => each_bright_star(store, selection, &mut add)?,
        Rows::Deep(store) => each_star(store, selection, &mut add, on_step)?,
    }
    target.finish(path)?;
    Ok(rows)
}
