//! CSV catalogues, read line by line; the `csv` crate splits a line into fields.
//!
//! One line is one row, because star catalogues have no line breaks inside fields. CSV in general allows them. A stray quotation mark would then hide
//! all rows up to the next mark, or the rest of the file. `Lines` therefore sits between the file and the parser. It passes on one line at a time and
//! skips blank lines and lines that begin with `#`. If the parser asks for more within a row, `Lines` closes the quotation; that row is rejected and
//! the next line is a new row. Only one line is ever in memory. `Lines` also counts the lines: the position that the crate reports for a record is
//! the end of the previous one, which is too early after blank lines, comments and CRLF.
//!
//! The separator is the most frequent character among comma, tab, semicolon and bar in the header. If the header has none of these but has blanks,
//! the separator is a blank. Several blanks are then one separator, because they align the columns. A field is quoted only if the mark is its first
//! character; otherwise blanks around fields are ignored. Text that is not UTF-8 matters only in the columns that are used.
//!
//! A file of VizieR may have several tables with different columns, each after a comment `#Table`. Only the first table is read.
//!
//! The head is the first line, with exceptions for some programs. VizieR writes a line of units and a line of dashes below the head. numpy, TOPCAT
//! and astropy write the head as a comment. A comment is the head if it has as many fields as the first line, and if it has column names that the
//! first line lacks or all fields of the first line are numbers. ECSV (astropy, Gaia archive) gives the units of its columns in comments. pandas
//! writes an index without a name before the columns of aligned text. Excel writes `sep=;` before the head.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use ::csv::{ByteRecord, ErrorKind, Reader, ReaderBuilder, StringRecord, Terminator};

use super::columns::{self, Columns};
use super::rows::{Reading, Rows};
use super::{CatalogueError, CatalogueRead, RowPlace};

/// Maximum number of bytes of comments before the first row that are kept. A head, units and the mark of ECSV are searched in them.
const COMMENTS_LIMIT: usize = 1 << 20;
/// Maximum number of comments that are compared with the first line, counted from the last one.
const HEADS_TRIED: usize = 20;

/// Maximum number of rows that are read before the first of them is converted to a star. They are searched for a line of dashes, an index and decimal
/// commas.
const FIRST_ROWS: usize = 100;

/// Longest accepted line, bytes.
const LINE_LIMIT: usize = 1 << 20;

/// U+FEFF in UTF-8, with which some programs begin a file.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reason for rejecting a row whose last quoted field is not closed.
const UNCLOSED: &str = "a quotation mark is not closed on its line";

/// Reads a CSV catalogue from a file; stars are placed `years` Julian years after J2000.0.
///
/// # Errors
/// If the file cannot be opened or read, if its columns are not those of a star catalogue, or if no row is usable.
pub fn read_csv(path: &Path, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read_csv_from(super::open(path)?, &path.display().to_string(), years)
}

/// Reads a CSV catalogue from `source`; messages call it `file`.
///
/// # Errors
/// Those of [`read_csv`], except for errors of opening the file.
pub fn read_csv_from(source: impl Read, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(source, file, &years.into())
}

/// Reads in the same way; `reading` may contain a receiver of the stars.
pub(super) fn read(source: impl Read, file: &str, reading: &Reading) -> Result<CatalogueRead, CatalogueError> {
    let mut lines = Lines::new(source, file);
    if !lines.advance()? {
        return Err(CatalogueError::NoRow { file: file.to_owned() });
    }
    let head_in_comment = lines.head_in_comment();
    let separator = separator_of(head_in_comment.as_deref().map_or(&lines.bytes, str::as_bytes));
    if separator == b' ' {
        lines.align();
    }
    // Rows end at the line feed alone, so that a carriage return within a line does not split it. Trimming in the crate would copy every record;
    // fields are trimmed when they are used instead.
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(separator)
        .terminator(Terminator::Any(b'\n'))
        .from_reader(lines);
    // Head.
    let mut record = ByteRecord::new();
    let (mut names, head_line, is_closed): (Vec<String>, usize, bool) = match head_in_comment {
        Some(head) => (split(head.as_bytes(), separator), 1, true),
        None => {
            let (line, is_closed) = read_row(&mut reader, file, &mut record)?.unwrap_or((1, true));
            let head = StringRecord::from_byte_record_lossy(record);
            let names = head.iter().map(str::to_owned).collect();
            record = head.into_byte_record();
            (names, line, is_closed)
        }
    };
    // Read the first rows: they contain units and a line of dashes, or stars.
    let mut first_rows: Vec<(StringRecord, usize, bool)> = Vec::new();
    while first_rows.len() < FIRST_ROWS
        && let Some((line, is_closed)) = read_row(&mut reader, file, &mut record)?
    {
        first_rows.push((StringRecord::from_byte_record_lossy(record), line, is_closed));
        record = ByteRecord::new();
    }
    if separator == b' ' && !first_rows.is_empty() && first_rows.iter().all(|(row, ..)| row.len() == names.len() + 1) {
        names.insert(0, String::new());
    }
    let recognised = |units: Option<&[String]>| {
        let columns = if is_closed { Columns::recognise(&names, units) } else { Err(UNCLOSED.to_owned()) };
        columns.map_err(|reason| CatalogueError::Columns {
            file: file.to_owned(),
            place: RowPlace::Line(head_line),
            reason,
            found: columns::listing(&names),
        })
    };
    let is_dashes = |row: &StringRecord| {
        let mut fields = row.iter().map(str::trim).filter(|field| !field.is_empty());
        fields.clone().any(|field| field.len() > 1) && fields.all(|field| field.bytes().all(|byte| byte == b'-'))
    };
    let dashes = first_rows.iter().take(2).position(|(row, ..)| is_dashes(row));
    let units: Option<Vec<String>> = match dashes {
        Some(1) => Some(first_rows[0].0.iter().map(str::to_owned).collect()),
        _ => reader.get_ref().units(&names),
    };
    let columns = recognised(units.as_deref())?.in_degrees(reading.ra_in_degrees);
    first_rows.drain(..dashes.map_or(0, |dashes| dashes + 1));
    let has_decimal_commas = separator != b',' && has_decimal_commas(&first_rows);
    if has_decimal_commas {
        tracing::info!(file, "numbers have decimal commas");
    }

    // Rows.
    let mut rows = Rows::new(file, &columns, reading);
    let add = |rows: &mut Rows, fields: &StringRecord, line: usize, is_closed: bool| {
        let with_points = has_decimal_commas.then(|| with_points(fields));
        let fields = with_points.as_ref().unwrap_or(fields);
        let read = if !is_closed {
            Err(UNCLOSED.to_owned())
        } else if fields.len() != columns.len()
            && !(fields.len() == columns.len() + 1 && fields[columns.len()].is_empty())
        {
            Err(format!("{} fields instead of {}", fields.len(), columns.len()))
        } else {
            Ok(|i: usize| &fields[i])
        };
        rows.add(&columns, read, (line, ""))
    };
    for (fields, line, is_closed) in &first_rows {
        add(&mut rows, fields, *line, *is_closed)?;
    }
    while let Some((line, is_closed)) = read_row(&mut reader, file, &mut record)? {
        let fields = StringRecord::from_byte_record_lossy(record);
        add(&mut rows, &fields, line, is_closed)?;
        record = fields.into_byte_record();
    }
    if reader.get_ref().further > 0 {
        rows.note(format!("tables of the file that are not read: {}", reader.get_ref().further));
    }
    rows.finish()
}

/// Reads the next row. Returns its line, and whether its quotation marks are closed; `None` after the last row.
fn read_row<R: Read>(
    reader: &mut Reader<Lines<'_, R>>,
    file: &str,
    record: &mut ByteRecord,
) -> Result<Option<(usize, bool)>, CatalogueError> {
    let line = reader.get_ref().number;
    let is_row = reader.read_byte_record(record).map_err(|error| match error.into_kind() {
        ErrorKind::Io(source) => source.downcast::<CatalogueError>().unwrap_or_else(|source| CatalogueError::Io {
            file: file.to_owned(),
            place: RowPlace::Line(line),
            source,
        }),
        kind => CatalogueError::Malformed {
            file: file.to_owned(),
            place: RowPlace::Line(line),
            reason: format!("not CSV: {kind:?}"),
        },
    })?;
    Ok(is_row.then(|| reader.get_mut().end_row()))
}

/// Passes the rows of a file to the parser, one line at a time.
///
/// A read never passes the end of a line, and every line ends in a line feed. Therefore the parser has finished the row when it has consumed the
/// line, unless it is inside quotation marks. Only in that case does it read again before [`Lines::end_row`] is called.
struct Lines<'f, R> {
    source: BufReader<R>,
    file: &'f str,
    /// Number of the last line read, from 1.
    number: usize,
    /// The last line read, or a quotation mark that is inserted because the closing one is missing.
    bytes: Vec<u8>,
    /// Number of `bytes` that the parser has consumed.
    taken: usize,
    /// Whether the parser is in the row that begins on this line.
    in_row: bool,
    is_closed: bool,
    /// Comments before the first row, without their comment mark; at most [`COMMENTS_LIMIT`] bytes.
    comments: Vec<String>,
    comment_bytes: usize,
    has_row: bool,
    /// Whether several blanks are one separator.
    is_aligned: bool,
    /// Number of tables after the first one; their columns may be different.
    further: usize,
}

impl<'f, R: Read> Lines<'f, R> {
    fn new(source: R, file: &'f str) -> Self {
        let source = BufReader::with_capacity(1 << 16, source);
        Self {
            source,
            file,
            number: 0,
            bytes: Vec::new(),
            taken: 0,
            in_row: false,
            is_closed: true,
            comments: Vec::new(),
            comment_bytes: 0,
            has_row: false,
            is_aligned: false,
            further: 0,
        }
    }

    /// Treats several blanks as one separator from now on, including in the line that was read last.
    fn align(&mut self) {
        self.is_aligned = true;
        self.bytes = with_single_blanks(&self.bytes);
        self.bytes.push(b'\n');
    }

    /// Returns the comment before the first row that is the head. The comment must have as many fields as the row. In addition, either it names the
    /// columns of a star catalogue and the row does not, or it is the last comment and contains no numbers, while the row contains only numbers.
    fn head_in_comment(&self) -> Option<String> {
        let is_number = |field: &String| field.trim().parse::<f64>().is_ok() || with_point(field).is_some();
        let is_known = |fields: &[String]| Columns::recognise(fields, None).is_ok();
        let is_head = |(index, comment): &(usize, &String)| {
            let separator = separator_of(comment.as_bytes());
            let [fields, row] = [comment.as_bytes(), &self.bytes].map(|line| split(line, separator));
            let is_like_row = fields.len() > 1 && fields.len() == row.len();
            let is_above_numbers = *index == 0 && row.iter().all(is_number) && !fields.iter().any(is_number);
            is_like_row && (is_above_numbers || (is_known(&fields) && !is_known(&row)))
        };
        let last_first = self.comments.iter().rev().take(HEADS_TRIED).enumerate();
        last_first.into_iter().find(is_head).map(|(_, comment)| comment.trim().to_owned())
    }

    /// Returns the units of these columns from the comments of ECSV. The unit is empty for a column without one; the result is `None` if the file is
    /// not ECSV. A column is an item of a YAML list, either in one line such as `- {name: ra, unit: deg, datatype: float64}` (astropy) or in lines
    /// `-`, `name: ra`, `unit: deg` (bulk files of the Gaia archive).
    fn units(&self, names: &[String]) -> Option<Vec<String>> {
        self.comments.first().filter(|first| first.trim_start().starts_with("%ECSV"))?;
        let mut items: Vec<[Option<String>; 2]> = Vec::new();
        for line in self.comments.iter().map(|line| line.trim()) {
            // A separator of YAML documents is not an item.
            let begin = line.strip_prefix('-').filter(|rest| !rest.starts_with('-'));
            if begin.is_some() {
                items.push([None, None]);
            }
            let text = begin.unwrap_or(line).trim_start();
            let flow = text.strip_prefix('{');
            let Some(item) = items.last_mut() else { continue };
            for (key, value) in ["name:", "unit:"].into_iter().zip(item) {
                let found = match flow {
                    Some(flow) => {
                        flow.split_once(key).map(|(_, rest)| &rest[..rest.find([',', '}']).unwrap_or(rest.len())])
                    }
                    None => text.strip_prefix(key),
                };
                if let Some(found) = found {
                    *value = Some(found.trim().trim_matches(['\'', '"']).to_owned());
                }
            }
        }
        let mut items: HashMap<String, String> =
            items.into_iter().filter_map(|[name, unit]| Some((name?, unit.unwrap_or_default()))).collect();
        Some(names.iter().map(|name| items.remove(name).unwrap_or_default()).collect())
    }

    /// Advances to the next line that is neither blank nor a comment; false after the last.
    fn advance(&mut self) -> Result<bool, CatalogueError> {
        loop {
            self.bytes.clear();
            self.taken = 0;
            let limit = LINE_LIMIT as u64 + 1;
            let line = self.number + 1;
            let read = self.source.by_ref().take(limit).read_until(b'\n', &mut self.bytes);
            match read {
                Ok(0) => return Ok(false),
                Ok(n) if n > LINE_LIMIT => {
                    let reason = format!("a line of more than {LINE_LIMIT} bytes: not a star catalogue in CSV");
                    return Err(CatalogueError::Malformed {
                        file: self.file.to_owned(),
                        place: RowPlace::Line(line),
                        reason,
                    });
                }
                Ok(_) => self.number = line,
                Err(source) => {
                    return Err(CatalogueError::Io { file: self.file.to_owned(), place: RowPlace::Line(line), source });
                }
            }
            if line == 1 && self.bytes.starts_with(BYTE_ORDER_MARK) {
                self.bytes.drain(..BYTE_ORDER_MARK.len());
            }
            let trimmed = self.bytes.trim_ascii();
            match trimmed.split_first() {
                None => {}
                Some(_) if line == 1 && is_separator_line(trimmed) => {}
                Some((b'#' | b'%', comment)) if !self.has_row => {
                    self.comment_bytes += comment.len();
                    if self.comment_bytes <= COMMENTS_LIMIT {
                        self.comments.push(String::from_utf8_lossy(comment).into_owned());
                    }
                }
                Some((b'#', comment)) => self.further += usize::from(is_begin_of_table(comment)),
                Some(_) if self.further > 0 => {}
                Some(_) => break,
            }
        }
        if self.is_aligned {
            self.bytes = with_single_blanks(&self.bytes);
        }
        if self.bytes.last() != Some(&b'\n') {
            self.bytes.push(b'\n');
        }
        self.in_row = true;
        self.is_closed = true;
        self.has_row = true;
        Ok(true)
    }

    /// Ends a row that the parser has finished; returns its line and whether its quotation marks were closed.
    fn end_row(&mut self) -> (usize, bool) {
        self.in_row = false;
        (self.number, self.is_closed)
    }
}

impl<R: Read> Read for Lines<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.bytes.len() {
            if self.in_row {
                self.bytes.clear();
                self.bytes.extend_from_slice(b"\"\n");
                self.taken = 0;
                self.is_closed = false;
            } else if !self.advance().map_err(io::Error::other)? {
                return Ok(0);
            }
        }
        let count = (&self.bytes[self.taken..]).read(buffer)?;
        self.taken += count;
        Ok(count)
    }
}

/// The fields of one line.
fn split(line: &[u8], separator: u8) -> Vec<String> {
    let line = if separator == b' ' { with_single_blanks(line) } else { line.trim_ascii().to_vec() };
    let mut reader = ReaderBuilder::new().has_headers(false).delimiter(separator).from_reader(line.as_slice());
    let mut record = ByteRecord::new();
    match reader.read_byte_record(&mut record) {
        Ok(true) => record.iter().map(|field| String::from_utf8_lossy(field).into_owned()).collect(),
        _ => Vec::new(),
    }
}

/// Replaces every run of blanks outside of quotation marks with one blank, and removes blanks at both ends of the line.
fn with_single_blanks(line: &[u8]) -> Vec<u8> {
    let mut single = Vec::with_capacity(line.len());
    let mut in_quotes = false;
    for &byte in line.trim_ascii() {
        in_quotes ^= byte == b'"';
        let is_blank = !in_quotes && (byte == b' ' || byte == b'\t');
        match is_blank {
            true if single.last() == Some(&b' ') => {}
            true => single.push(b' '),
            false => single.push(byte),
        }
    }
    single
}

/// Whether a line defines the separator, as in `sep=;`, which Excel writes.
fn is_separator_line(line: &[u8]) -> bool {
    line.len() == 5 && line[..4].eq_ignore_ascii_case(b"sep=")
}

/// Whether a comment begins a table of VizieR, as in `#Table`, a tab, and `I_239_tyc_main:`.
fn is_begin_of_table(comment: &[u8]) -> bool {
    let Some((word, rest)) = comment.split_at_checked(5) else { return false };
    word.eq_ignore_ascii_case(b"table") && rest.first().is_some_and(|byte| b" \t:".contains(byte))
}

/// Replaces the comma of a number with a decimal comma by a point; `None` for other text.
fn with_point(field: &str) -> Option<String> {
    let is_plain = |c: char| c.is_ascii_digit() || ",+-eE".contains(c);
    let text = field.trim();
    let number = (text.matches(',').count() == 1 && text.chars().all(is_plain)).then(|| text.replace(',', "."))?;
    number.parse::<f64>().is_ok().then_some(number)
}

fn with_points(fields: &StringRecord) -> StringRecord {
    fields.iter().map(|field| with_point(field).map_or(Cow::Borrowed(field), Cow::Owned)).collect::<Vec<_>>().into()
}

/// Whether numbers of these rows have decimal commas, as spreadsheets of many countries write them, and none has a decimal point.
fn has_decimal_commas(rows: &[(StringRecord, usize, bool)]) -> bool {
    let fields = || rows.iter().flat_map(|(row, ..)| row.iter());
    let has_point = |field: &str| field.contains('.') && field.trim().parse::<f64>().is_ok();
    fields().any(|field| with_point(field).is_some()) && !fields().any(has_point)
}

/// Returns the most frequent separator in the head. If it has none, returns a blank if the head has blanks, otherwise a comma.
fn separator_of(head: &[u8]) -> u8 {
    let head = head.trim_ascii();
    let count = |separator: u8| head.iter().filter(|&&c| c == separator).count();
    let most = [b',', b'\t', b';', b'|'].into_iter().rev().max_by_key(|&c| count(c)).unwrap_or(b',');
    if count(most) == 0 && count(b' ') > 0 { b' ' } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_separator_is_taken_from_the_header() {
        assert_eq!(separator_of(b"ra_deg\tdec_deg\tv_mag"), b'\t');
        assert_eq!(separator_of(b"ra_deg;dec_deg;v_mag"), b';');
        assert_eq!(separator_of(b"ra_deg,dec_deg,v_mag"), b',');
        assert_eq!(separator_of(b"ra_deg"), b',');
    }

    #[test]
    fn decimal_commas_are_read_if_no_number_has_a_point() {
        for (field, expected) in [
            ("101,287", Some("101.287")),
            (" -16,7 ", Some("-16.7")),
            ("1,5e-3", Some("1.5e-3")),
            ("1,2,3", None),
            ("12", None),
            ("alf, CMa", None),
            (",", None),
        ] {
            assert_eq!(with_point(field).as_deref(), expected, "{field}");
        }
        let read = |text: &str| read_csv_from(text.as_bytes(), "test.csv", 0.0).map(|read| read.stars);
        let plain = read("ra_deg,dec_deg,v_mag\n101.287,-16.716,-1.46\n").unwrap();
        for text in [
            "ra_deg;dec_deg;v_mag\n101,287;-16,716;-1,46\n",
            "# ra_deg;dec_deg;v_mag\n101,287;-16,716;-1,46\n",
            "ra_deg\tdec_deg\tv_mag\n101,287\t-16,716\t-1,46\n",
        ] {
            assert_eq!(read(text).unwrap(), plain, "{text}");
        }
        // A decimal comma in a file with decimal points is an error.
        assert!(read("ra_deg;dec_deg;v_mag\n101,287;-16.716;-1.46\n").is_err());
    }

    #[test]
    fn lines_are_passed_whole_and_open_quotations_are_closed() {
        let mut lines = Lines::new(&b"\xef\xbb\xbf# \"head\r\n\r\n  \na,\"b\r\n\"c"[..], "test.csv");
        let mut buffer = [0; 64];
        let mut next = |lines: &mut Lines<_>| {
            let count = lines.read(&mut buffer).unwrap();
            String::from_utf8(buffer[..count].to_vec()).unwrap()
        };
        assert_eq!(next(&mut lines), "a,\"b\r\n");
        assert_eq!(next(&mut lines), "\"\n");
        assert_eq!(lines.end_row(), (4, false));
        assert_eq!(next(&mut lines), "\"c\n");
        assert_eq!(lines.end_row(), (5, true));
        assert_eq!(next(&mut lines), "");
    }

    /// The form of astropy, and that of the bulk files of the Gaia archive.
    #[test]
    fn units_of_both_forms_of_ecsv_are_read() {
        let flow = "# %ECSV 1.0\n# ---\n# datatype:\n# - {name: ra, unit: deg, datatype: float64}\n\
                    # - {name: pmra, unit: mas / yr, datatype: float64}\n# - {name: b, datatype: int64, description: no unit}\n";
        let block = "# %ECSV 1.0\n# ---\n# delimiter: ','\n# datatype:\n# -\n#   name: ra\n#   datatype: float64\n#   unit: deg\n\
                     #   description: Right ascension\n# -\n#   name: pmra\n#   unit: mas / yr\n# - name: b\n#   datatype: int64\n";
        for comments in [flow, block] {
            let text = format!("{comments}pmra,b,ra\n1,2,3\n");
            let mut lines = Lines::new(text.as_bytes(), "test.ecsv");
            assert!(lines.advance().unwrap());
            let units = lines.units(&["pmra", "b", "ra"].map(str::to_owned));
            assert_eq!(units.unwrap(), ["mas / yr", "", "deg"], "{comments}");
        }
        let mut lines = Lines::new(&b"# %CSV\n# - {name: ra, unit: deg}\nra\n"[..], "test.csv");
        assert!(lines.advance().unwrap());
        assert_eq!(lines.units(&["ra".to_owned()]), None);
    }
}
