//! CSV catalogues, read line by line; the `csv` crate splits a line into fields.
//!
//! One line is one row, because star catalogues have no line breaks inside fields. CSV in general allows them, so a
//! stray quotation mark would hide all rows up to the next mark, or the rest of the file. `Lines` therefore sits
//! between the file and the parser. It passes on one line at a time and skips blank lines and lines that begin with
//! `#`. If the parser asks for more within a row, `Lines` closes the quotation; that row is rejected and the next
//! line is a new row. Only one line is ever in memory. `Lines` also counts the lines: the crate's position of a
//! record is the end of the previous one, which is too early after blank lines, comments and CRLF.
//!
//! The separator is the most frequent one of comma, tab and semicolon in the header. A field is quoted only if the
//! mark is its first character; otherwise blanks around fields are ignored. Text that is not UTF-8 matters only in
//! the columns that are used.

use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use ::csv::{ByteRecord, ErrorKind, ReaderBuilder, StringRecord, Terminator};

use super::columns::{self, Columns};
use super::row::{self, Refusal};
use super::{CatalogueError, CatalogueRead, ReadReport};

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
/// As [`read_csv`], apart from opening.
pub fn read_csv_from(source: impl Read, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    let mut lines = Lines::new(source, file);
    if !lines.advance()? {
        return Err(CatalogueError::NoRow { file: file.to_owned() });
    }
    // Rows end at the line feed alone, so that a carriage return within a line does not split it. The crate's own
    // trimming would copy every record; users of a field trim it instead.
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(separator_of(&lines.bytes))
        .terminator(Terminator::Any(b'\n'))
        .from_reader(lines);
    let parser_error = |error: ::csv::Error, line: usize| match error.into_kind() {
        ErrorKind::Io(source) => source.downcast::<CatalogueError>().unwrap_or_else(|source| CatalogueError::Io {
            file: file.to_owned(),
            line,
            source,
        }),
        kind => CatalogueError::Malformed { file: file.to_owned(), line, reason: format!("not CSV: {kind:?}") },
    };

    // Header.
    let mut record = ByteRecord::new();
    reader.read_byte_record(&mut record).map_err(|e| parser_error(e, reader.get_ref().number))?;
    let (header_line, is_closed) = reader.get_mut().end_row();
    let header = StringRecord::from_byte_record_lossy(record);
    let names: Vec<&str> = header.iter().collect();
    let columns = if is_closed { Columns::recognise(&names) } else { Err(UNCLOSED.to_owned()) };
    let columns = columns.map_err(|reason| CatalogueError::Columns {
        file: file.to_owned(),
        line: header_line,
        reason,
        found: columns::listing(&names),
    })?;

    // Rows.
    let mut report = ReadReport::new(file);
    let mut stars = Vec::new();
    record = header.into_byte_record();
    while reader.read_byte_record(&mut record).map_err(|e| parser_error(e, reader.get_ref().number))? {
        let (line, is_closed) = reader.get_mut().end_row();
        let fields = StringRecord::from_byte_record_lossy(record);
        report.rows += 1;
        let star = if !is_closed {
            Err(Refusal::Row(UNCLOSED.to_owned()))
        } else if fields.len() != columns.len() {
            Err(Refusal::Row(format!("{} fields instead of {}", fields.len(), columns.len())))
        } else {
            row::star(&columns, |i| &fields[i], years)
        };
        match star {
            Ok((star, notes)) => {
                report.count(notes);
                stars.push(star);
            }
            Err(Refusal::Row(reason)) => report.reject(line, reason),
            Err(Refusal::File(reason)) => {
                return Err(CatalogueError::Malformed { file: file.to_owned(), line, reason });
            }
        }
        record = fields.into_byte_record();
    }
    report.finish(stars)
}

/// Passes the rows of a file to the parser, one line at a time.
///
/// A read never passes the end of a line, and every line ends in a line feed. So the parser has finished the row when
/// it has consumed the line, unless it is inside quotation marks. Only then does it read again before
/// [`Lines::end_row`] is called.
struct Lines<'f, R> {
    source: BufReader<R>,
    file: &'f str,
    /// Number of the last line read, from 1.
    number: usize,
    /// The last line read, or the closing mark that replaces a missing one.
    bytes: Vec<u8>,
    /// Number of `bytes` that the parser has consumed.
    taken: usize,
    /// Whether the parser is in the row that begins on this line.
    in_row: bool,
    is_closed: bool,
}

impl<'f, R: Read> Lines<'f, R> {
    fn new(source: R, file: &'f str) -> Self {
        let source = BufReader::with_capacity(1 << 16, source);
        Self { source, file, number: 0, bytes: Vec::new(), taken: 0, in_row: false, is_closed: true }
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
                    return Err(CatalogueError::Malformed { file: self.file.to_owned(), line, reason });
                }
                Ok(_) => self.number = line,
                Err(source) => return Err(CatalogueError::Io { file: self.file.to_owned(), line, source }),
            }
            if line == 1 && self.bytes.starts_with(BYTE_ORDER_MARK) {
                self.bytes.drain(..BYTE_ORDER_MARK.len());
            }
            let trimmed = self.bytes.trim_ascii();
            if !trimmed.is_empty() && trimmed[0] != b'#' {
                break;
            }
        }
        if self.bytes.last() != Some(&b'\n') {
            self.bytes.push(b'\n');
        }
        self.in_row = true;
        self.is_closed = true;
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

/// The most frequent separator of the header; a comma if there is none.
fn separator_of(header: &[u8]) -> u8 {
    let count = |separator: u8| header.iter().filter(|&&c| c == separator).count();
    [b',', b'\t', b';'].into_iter().rev().max_by_key(|&c| count(c)).unwrap_or(b',')
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
}
