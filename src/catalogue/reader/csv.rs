//! CSV catalogues, read line by line.
//!
//! One line is one row: star catalogues have no line breaks inside fields, and so the line number in a message is right
//! and a stray quotation mark cannot swallow the rest of a file of any size. The separator (comma, tab or semicolon) is
//! the one that the header has most of. Blank lines and lines that begin with `#` are passed over; fields may be
//! quoted. Text that is not UTF-8 is harmless outside the columns that are used.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::columns::{self, Columns};
use super::row::{self, Refusal};
use super::{CatalogueError, CatalogueRead, ReadReport};

/// Longest line that can be part of a star catalogue, in bytes.
const LINE_LIMIT: usize = 1 << 20;

/// Reads a CSV catalogue from a file.
///
/// # Errors
/// If the file cannot be opened or read, if its columns do not make a star catalogue, or if no row is usable.
pub fn read_csv(path: &Path) -> Result<CatalogueRead, CatalogueError> {
    read_csv_from(super::open(path)?, &path.display().to_string())
}

/// Reads a CSV catalogue from `source`; `file` is its name in messages.
///
/// # Errors
/// As [`read_csv`], apart from opening.
pub fn read_csv_from(source: impl Read, file: &str) -> Result<CatalogueRead, CatalogueError> {
    let mut lines = Lines { source: BufReader::with_capacity(1 << 16, source), file, number: 0, bytes: Vec::new() };

    // The header: separator and columns.
    let Some(header) = lines.next_row()? else { return Err(CatalogueError::NoRow { file: file.to_owned() }) };
    let header = String::from_utf8_lossy(header).into_owned();
    let header = header.trim_start_matches('\u{feff}');
    let separator = separator_of(header);
    let mut fields = Vec::new();
    split(header, separator, &mut fields);
    let header_line = lines.number;
    let columns_error = |reason: String, names: &[&str]| CatalogueError::Columns {
        file: file.to_owned(),
        line: header_line,
        reason,
        found: columns::listing(names),
    };
    let columns = Columns::recognise(&fields).map_err(|reason| columns_error(reason, &fields))?;

    // The rows.
    let mut report = ReadReport::new(file);
    let mut stars = Vec::new();
    while let Some(line) = lines.next_row()? {
        let text = String::from_utf8_lossy(line);
        let mut fields = Vec::with_capacity(columns.len());
        split(&text, separator, &mut fields);
        report.rows += 1;
        let star = if fields.len() == columns.len() {
            row::star(&columns, |i| fields[i])
        } else {
            Err(Refusal::Row(format!("{} fields instead of {}", fields.len(), columns.len())))
        };
        match star {
            Ok((star, notes)) => {
                report.count(notes);
                stars.push(star);
            }
            Err(Refusal::Row(reason)) => report.reject(lines.number, reason),
            Err(Refusal::File(reason)) => {
                return Err(CatalogueError::Malformed { file: file.to_owned(), line: lines.number, reason });
            }
        }
    }
    report.finish(stars)
}

/// Lines of a file with their number, one in memory at a time.
struct Lines<'f, R> {
    source: BufReader<R>,
    file: &'f str,
    /// Number of the line read last, from 1.
    number: usize,
    bytes: Vec<u8>,
}

impl<R: Read> Lines<'_, R> {
    /// The next line that is neither blank nor a comment, without its end; `None` after the last.
    fn next_row(&mut self) -> Result<Option<&[u8]>, CatalogueError> {
        loop {
            self.bytes.clear();
            let limit = LINE_LIMIT as u64 + 1;
            let line = self.number + 1;
            let read = self.source.by_ref().take(limit).read_until(b'\n', &mut self.bytes);
            match read {
                Ok(0) => return Ok(None),
                Ok(n) if n > LINE_LIMIT => {
                    let reason = format!("a line of more than {LINE_LIMIT} bytes: this is no star catalogue in CSV");
                    return Err(CatalogueError::Malformed { file: self.file.to_owned(), line, reason });
                }
                Ok(_) => self.number = line,
                Err(source) => return Err(CatalogueError::Io { file: self.file.to_owned(), line, source }),
            }
            let trimmed = self.bytes.trim_ascii();
            if !trimmed.is_empty() && trimmed[0] != b'#' {
                break;
            }
        }
        while matches!(self.bytes.last(), Some(b'\n' | b'\r')) {
            self.bytes.pop();
        }
        Ok(Some(&self.bytes))
    }
}

/// The separator that the header has most of; a comma if none.
fn separator_of(header: &str) -> char {
    let count = |separator: char| header.chars().filter(|&c| c == separator).count();
    [',', '\t', ';'].into_iter().rev().max_by_key(|&c| count(c)).unwrap_or(',')
}

/// Splits a line into its fields. A field that begins with a quotation mark ends at the next lone one; doubled marks
/// stand for one and are left as they are, because no number contains them.
fn split<'a>(line: &'a str, separator: char, fields: &mut Vec<&'a str>) {
    let mut rest = line;
    loop {
        let start = rest.trim_start_matches(' ');
        let (field, after) = match start.strip_prefix('"').and_then(|quoted| Some((quoted, closing_mark(quoted)?))) {
            Some((quoted, end)) => (&quoted[..end], &quoted[end + 1..]),
            None => ("", rest),
        };
        let is_quoted = after.len() != rest.len();
        match after.find(separator) {
            Some(at) => {
                fields.push(if is_quoted { field } else { &after[..at] });
                rest = &after[at + separator.len_utf8()..];
            }
            None => {
                fields.push(if is_quoted { field } else { after });
                return;
            }
        }
    }
}

/// Position of the quotation mark that ends a quoted field, if there is one.
fn closing_mark(quoted: &str) -> Option<usize> {
    let bytes = quoted.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        if bytes[at] == b'"' {
            if bytes.get(at + 1) != Some(&b'"') {
                return Some(at);
            }
            at += 1;
        }
        at += 1;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(line: &str) -> Vec<&str> {
        let mut fields = Vec::new();
        split(line, ',', &mut fields);
        fields
    }

    #[test]
    fn lines_are_split_into_fields() {
        assert_eq!(fields("1,,3,"), ["1", "", "3", ""]);
        assert_eq!(fields(r#""a, b",2, "c ""d""" ,4"#), ["a, b", "2", r#"c ""d"""#, "4"]);
        assert_eq!(fields(r#"5" star,2"#), [r#"5" star"#, "2"]);
        assert_eq!(fields(r#""never closed,2"#), [r#""never closed"#, "2"]);
        assert_eq!(fields(""), [""]);
    }

    #[test]
    fn the_separator_is_the_one_the_header_uses() {
        assert_eq!(separator_of("ra_deg\tdec_deg\tv_mag"), '\t');
        assert_eq!(separator_of("ra_deg;dec_deg;v_mag"), ';');
        assert_eq!(separator_of("ra_deg,dec_deg,v_mag"), ',');
        assert_eq!(separator_of("ra_deg"), ',');
    }
}
