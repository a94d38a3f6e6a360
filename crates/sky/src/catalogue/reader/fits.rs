//! Star catalogues in FITS: the first binary table (FITS Standard 4.0, 7.3) with the columns of a star catalogue.
//!
//! A stored value v means TSCALn v + TZEROn; TNULLn and NaN mean "no value". Columns of one logical value, number or text are read (L, B, I,
//! J, K, E, D, A). Columns of bits, complex numbers, several numbers or variable length (X, C, M, P, Q) are listed in the report and not
//! read. The file is read row by row.

use std::io::{self, Read};

use super::frame::Frame;
use super::rows::Reading;
use super::scalar::Scalar;
use super::table::{Head, Table};
use super::{CatalogueError, CatalogueRead, RowPlace};
use crate::fits::Header;

/// Maximum number of bytes in a row. Tables stored column by column have all data in a single row.
const MOST_ROW_BYTES: usize = 1 << 24;

/// A column that is read.
struct Column {
    /// First byte in the row.
    start: usize,
    /// Bytes in the row.
    bytes: usize,
    /// `None`: text.
    scalar: Option<Scalar>,
    scale: f64,
    zero: f64,
    null: Option<i64>,
}

impl Column {
    /// Returns the value in a row as text; empty if there is none.
    fn text(&self, row: &[u8]) -> String {
        let bytes = &row[self.start..self.start + self.bytes];
        let Some(scalar) = self.scalar else {
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
            return String::from_utf8_lossy(&bytes[..end]).trim().to_owned();
        };
        let is_scaled = self.scale != 1.0 || self.zero != 0.0;
        match scalar.integer(bytes) {
            Some(value) if Some(value) == self.null => String::new(),
            // Unsigned numbers are stored with an offset. They are computed as integers, because numbers of Gaia exceed the precision of an f64.
            Some(value) if self.scale == 1.0 && self.zero.fract() == 0.0 && self.zero.abs() < 2e19 => {
                (i128::from(value) + self.zero as i128).to_string()
            }
            Some(value) => (self.scale * value as f64 + self.zero).to_string(),
            None => match scalar.text(bytes).parse::<f64>() {
                Ok(value) if is_scaled => (self.scale * value + self.zero).to_string(),
                _ => scalar.text(bytes),
            },
        }
    }
}

/// Reads the binary table of a FITS file from `source`; messages call it `file`. Stars are placed `years` Julian years after J2000.0.
///
/// # Errors
/// If the file cannot be read or is damaged, if it has no binary table with the columns of a star catalogue, or if no row is usable.
pub fn read_fits_from(source: impl Read, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(source, file, &years.into())
}

/// Reads in the same way; `reading` may contain a receiver of the stars.
pub(super) fn read(mut source: impl Read, file: &str, reading: &Reading) -> Result<CatalogueRead, CatalogueError> {
    let malformed =
        |place: RowPlace, reason: String| CatalogueError::Malformed { file: file.to_owned(), place, reason };
    let io_error = |source| CatalogueError::Io { file: file.to_owned(), place: RowPlace::Head, source };
    let mut seen = Vec::new();
    let mut refused = None;
    while let Some(header) = Header::next(&mut source).map_err(io_error)? {
        let header = header.map_err(|reason| malformed(RowPlace::Head, reason))?;
        let kind = header.0.get("XTENSION").map_or("primary", String::as_str);
        let length = header.data_bytes().map_err(|reason| malformed(RowPlace::Head, reason))?;
        if kind == "BINTABLE" {
            let (mut head, columns, left_out) = head(&header).map_err(|reason| malformed(RowPlace::Head, reason))?;
            head.frames.fill(frame(&header));
            match Table::new(file, &head, reading) {
                Ok(mut table) => {
                    if !left_out.is_empty() {
                        table
                            .note(format!("columns that do not hold a single number or text: {}", left_out.join(", ")));
                    }
                    return rows(&mut source, &header, &columns, table, file);
                }
                Err(error) => refused = refused.or(Some(with_left_out(error, &left_out))),
            }
        }
        seen.push(kind.to_owned());
        let skipped = io::copy(&mut source.by_ref().take(length as u64), &mut io::sink()).map_err(io_error)?;
        if skipped < length as u64 {
            return Err(malformed(
                RowPlace::Head,
                format!("the file ends after {skipped} of the {length} bytes of its unit {} ({kind})", seen.len()),
            ));
        }
    }
    Err(refused.unwrap_or_else(|| {
        let found = seen.join(", ");
        malformed(
            RowPlace::Head,
            format!("no binary table; units of the file: {found}; a star catalogue in FITS is a BINTABLE"),
        )
    }))
}

/// Returns the frame of reference that a header states (FITS Standard 4.0, 8.3). `EPOCH` is the old name of the equinox.
fn frame(header: &Header) -> Frame {
    let text = |names: &[&str]| {
        let value = names.iter().find_map(|name| header.0.get(*name));
        value.map_or_else(String::new, |value| value.trim().to_owned())
    };
    Frame { system: text(&["RADESYS", "RADECSYS"]), equinox: text(&["EQUINOX", "EPOCH"]), epoch: String::new() }
}

/// Adds the columns that do not hold a single value to the error.
fn with_left_out(error: CatalogueError, left_out: &[String]) -> CatalogueError {
    match error {
        CatalogueError::Columns { file, place, reason, found } if !left_out.is_empty() => {
            let found =
                format!("{found}; not read, because they do not hold a single number or text: {}", left_out.join(", "));
            CatalogueError::Columns { file, place, reason, found }
        }
        error => error,
    }
}

/// Returns the head of the columns that are read, these columns, and the names of the other columns.
fn head(header: &Header) -> Result<(Head, Vec<Column>, Vec<String>), String> {
    if header.0.get("ZTABLE").is_some_and(|value| value == "T") {
        return Err("the table is compressed as a tiled table (ZTABLE); write it uncompressed or as .fits.gz".into());
    }
    if header.0.get("PIXTYPE").is_some_and(|value| value == "HEALPIX") {
        return Err("it is a HEALPix map and not a list of stars; a map of light is { light = { file = ... } }".into());
    }
    let row_bytes = header.axes()?.first().copied().unwrap_or(0);
    let count =
        header.count("TFIELDS").filter(|n| *n <= 999).ok_or("TFIELDS is missing or not a number from 0 to 999")?;
    let (mut head, mut columns, mut left_out) = (Head::default(), Vec::new(), Vec::new());
    let mut start: usize = 0;
    for index in 1..=count {
        let text = |key: &str| header.0.get(&format!("{key}{index}")).map_or("", String::as_str).trim();
        let form = text("TFORM");
        let letter = form.find(|c: char| !c.is_ascii_digit()).ok_or_else(|| format!("TFORM{index} is `{form}`"))?;
        let repeat: usize = match &form[..letter] {
            "" => 1,
            digits => digits.parse().map_err(|_| format!("TFORM{index} is `{form}`"))?,
        };
        let scalar = match &form[letter..=letter] {
            "L" => Some(Scalar::Logical),
            "B" => Some(Scalar::Byte),
            "I" => Some(Scalar::Short),
            "J" => Some(Scalar::Int),
            "K" => Some(Scalar::Long),
            "E" => Some(Scalar::Float),
            "D" => Some(Scalar::Double),
            _ => None,
        };
        let bytes_each = match (&form[letter..=letter], scalar) {
            (_, Some(scalar)) => Some(scalar.bytes()),
            ("A", _) => Some(1),
            ("C" | "P", _) => Some(8),
            ("M" | "Q", _) => Some(16),
            ("X", _) => None,
            _ => {
                return Err(format!(
                    "TFORM{index} is `{form}`; its letter must be one of L, X, B, I, J, K, A, E, D, C, M, P, Q"
                ));
            }
        };
        let bytes = bytes_each.map_or(Some(repeat.div_ceil(8)), |each| each.checked_mul(repeat));
        let end = bytes.and_then(|bytes| start.checked_add(bytes)).filter(|end| *end <= row_bytes);
        let (Some(bytes), Some(end)) = (bytes, end) else {
            return Err(format!("column {index} ends beyond the row of {row_bytes} bytes"));
        };
        let is_text = form[letter..].starts_with('A');
        let name = text("TTYPE");
        if (scalar.is_some() && repeat == 1) || (is_text && repeat > 0) {
            head.push(name, text("TUNIT"), text("TUCD"));
            let number = |key: &str| header.number(&format!("{key}{index}"));
            columns.push(Column {
                start,
                bytes,
                scalar,
                scale: number("TSCAL").unwrap_or(1.0),
                zero: number("TZERO").unwrap_or(0.0),
                null: text("TNULL").parse().ok(),
            });
        } else {
            left_out.push(if name.is_empty() { format!("number {index}") } else { super::excerpt(name) });
        }
        start = end;
    }
    Ok((head, columns, left_out))
}

/// Reads the rows of the table.
fn rows(
    source: &mut impl Read,
    header: &Header,
    columns: &[Column],
    mut table: Table,
    file: &str,
) -> Result<CatalogueRead, CatalogueError> {
    let malformed = |place, reason: String| CatalogueError::Malformed { file: file.to_owned(), place, reason };
    let axes = header.axes().map_err(|reason| malformed(RowPlace::Head, reason))?;
    let [row_bytes, count] = axes[..] else {
        return Err(malformed(RowPlace::Head, format!("a table must have two axes, but this one has {}", axes.len())));
    };
    if row_bytes > MOST_ROW_BYTES {
        return Err(malformed(
            RowPlace::Head,
            format!("a row has {row_bytes} bytes; at most {MOST_ROW_BYTES} can be read"),
        ));
    }
    let mut row = vec![0; row_bytes];
    let mut fields = vec![String::new(); columns.len()];
    for index in 1..=count {
        source.read_exact(&mut row).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => {
                malformed(RowPlace::Row(index), format!("the file ends here, but its header announces {count} rows"))
            }
            _ => CatalogueError::Io { file: file.to_owned(), place: RowPlace::Row(index), source: error },
        })?;
        for (field, column) in fields.iter_mut().zip(columns) {
            *field = column.text(&row);
        }
        table.add(Ok(&fields))?;
    }
    table.finish()
}
