//! Star catalogues in VOTable (IVOA, VOTable 1.4): the first table with the columns of a star catalogue.
//!
//! The data may be TABLEDATA, BINARY or BINARY2 (base64). TABLEDATA is read row by row. Streams in other files, compressed streams and embedded FITS
//! are refused. A field with several values is read as one text. VALUES/null and the null bits of BINARY2 mean "no value".

use std::io::{self, BufRead, Read};

use base64::{Engine, engine::general_purpose::STANDARD};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::frame::Frame;
use super::rows::Reading;
use super::scalar::Scalar;
use super::table::{Head, Table};
use super::{CatalogueError, CatalogueRead, RowPlace};

/// Maximum size of the text between two tags, bytes. In the binary forms this text is the whole table.
const MOST_BYTES: u64 = 1 << 30;
/// Maximum number of characters of a service's error that a message shows.
const MOST_ERROR_TEXT: usize = 400;
/// Maximum number of fields.
const MOST_FIELDS: usize = 10_000;

/// Type of a field's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Number(Scalar),
    Bits,
    Text,
    /// UTF-16.
    WideText,
    /// A real and an imaginary number.
    Complex(Scalar),
}

/// A FIELD.
struct Column {
    kind: Result<Kind, String>,
    /// Number of values; `None` if each row states its number.
    count: Option<usize>,
    /// Text of a missing value.
    null: String,
}

/// Form of the data that is being read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Text,
    Binary,
    /// Binary, with a bit for each field that states whether its value is missing.
    Binary2,
}

/// Reader that fails after [`MOST_BYTES`] until it is allowed to continue.
struct Bounded<R> {
    source: R,
    left: u64,
}

impl<R: BufRead> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for Bounded<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.left == 0 {
            return Err(io::Error::other(format!("more than {MOST_BYTES} bytes without a tag")));
        }
        self.source.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.left = self.left.saturating_sub(count as u64);
        self.source.consume(count);
    }
}

/// Reads a VOTable from `source`; messages call it `file`. Stars are placed `years` Julian years after J2000.0.
///
/// # Errors
/// If the file cannot be read or is not a VOTable, if none of its tables has the columns of a star catalogue, if the data are in an unsupported form,
/// or if no row is usable.
pub fn read_votable_from(source: impl BufRead, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(source, file, &years.into())
}

/// Reads in the same way; `reading` may contain a receiver of the stars.
pub(super) fn read(source: impl BufRead, file: &str, reading: &Reading) -> Result<CatalogueRead, CatalogueError> {
    let mut reader = Reader::from_reader(Bounded { source, left: MOST_BYTES });
    reader.config_mut().expand_empty_elements = true;
    let mut document = Document::new(file, reading);
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        reader.get_mut().left = MOST_BYTES;
        let event = reader.read_event_into(&mut buffer).map_err(|error| match error {
            quick_xml::Error::Io(source) => {
                let source = io::Error::new(source.kind(), source.to_string());
                CatalogueError::Io { file: file.to_owned(), place: document.place(), source }
            }
            error => document.malformed(format!("not XML: {error}")),
        })?;
        match event {
            Event::Start(start) => document.start(&start)?,
            Event::End(end) => document.end(end.local_name().as_ref())?,
            Event::Text(text) => document.text(&text),
            Event::CData(text) => document.text(&text),
            Event::GeneralRef(reference) => document.reference(&reference)?,
            Event::Eof => return document.finish(),
            _ => {}
        }
    }
}

/// State of the reader.
struct Document<'f> {
    file: &'f str,
    reading: &'f Reading,
    head: Head,
    columns: Vec<Column>,
    /// Whether the last FIELD is open, so that VALUES belongs to it.
    in_field: bool,
    /// The table that is read, or the error of the first table that cannot be read.
    table: Option<Result<Table, CatalogueError>>,
    /// Whether the data that follow belong to that table.
    is_reading: bool,
    form: Form,
    /// Texts of the row.
    fields: Vec<String>,
    /// Text of the open TD, STREAM or INFO.
    value: Option<String>,
    notes: Vec<String>,
    /// Number of tables after the one that is read.
    further: usize,
    has_votable: bool,
    /// Whether the VOTABLE has ended.
    has_end: bool,
    /// Frames of reference (COOSYS) by their identifiers.
    frames: Vec<(String, Frame)>,
    /// For each FIELD the identifier of its frame; empty if it has none.
    frame_ids: Vec<String>,
    /// Whether the open INFO is the error of a service.
    is_error: bool,
}

impl<'f> Document<'f> {
    fn new(file: &'f str, reading: &'f Reading) -> Self {
        Self {
            file,
            reading,
            head: Head::default(),
            columns: Vec::new(),
            in_field: false,
            table: None,
            is_reading: false,
            form: Form::Text,
            fields: Vec::new(),
            value: None,
            notes: Vec::new(),
            further: 0,
            has_votable: false,
            has_end: false,
            frames: Vec::new(),
            frame_ids: Vec::new(),
            is_error: false,
        }
    }

    fn place(&self) -> RowPlace {
        match &self.table {
            Some(Ok(table)) => RowPlace::Row(table.count() + 1),
            _ => RowPlace::Head,
        }
    }

    fn malformed(&self, reason: String) -> CatalogueError {
        CatalogueError::Malformed { file: self.file.to_owned(), place: self.place(), reason }
    }

    /// An attribute of a start tag; empty if it is missing.
    fn attribute(&self, start: &BytesStart<'_>, name: &str) -> Result<String, CatalogueError> {
        for attribute in start.attributes() {
            let attribute = attribute.map_err(|error| self.malformed(format!("not XML: {error}")))?;
            if attribute.key.local_name().as_ref() == name.as_bytes() {
                let value = attribute.normalized_value(XmlVersion::Implicit1_0);
                return value
                    .map(|value| value.into_owned())
                    .map_err(|error| self.malformed(format!("not XML: {error}")));
            }
        }
        Ok(String::new())
    }

    fn start(&mut self, start: &BytesStart<'_>) -> Result<(), CatalogueError> {
        match start.local_name().as_ref() {
            b"VOTABLE" => self.has_votable = true,
            b"INFO" if self.attribute(start, "name")? == "QUERY_STATUS" => {
                match self.attribute(start, "value")?.as_str() {
                    "ERROR" => {
                        self.is_error = true;
                        self.value = Some(String::new());
                    }
                    "OVERFLOW" => {
                        self.notes.push("the service reached its limit of rows (OVERFLOW): rows are missing".into())
                    }
                    _ => {}
                }
            }
            b"TABLE" => {
                self.head = Head::default();
                self.columns.clear();
                self.frame_ids.clear();
            }
            b"COOSYS" if self.frames.len() < MOST_FIELDS => {
                let text = |name: &str| self.attribute(start, name);
                let frame = Frame { system: text("system")?, equinox: text("equinox")?, epoch: text("epoch")? };
                let id = text("ID")?;
                self.frames.push((id, frame));
            }
            b"FIELD" => self.field(start)?,
            b"VALUES" if self.in_field => {
                let null = self.attribute(start, "null")?;
                if let Some(column) = self.columns.last_mut() {
                    column.null = null;
                }
            }
            b"TABLEDATA" => self.data(Form::Text),
            b"BINARY" => self.data(Form::Binary),
            b"BINARY2" => self.data(Form::Binary2),
            b"FITS" => {
                return Err(self.malformed("its data are FITS; they must be TABLEDATA, BINARY or BINARY2".into()));
            }
            b"STREAM" if self.is_reading => {
                if !self.attribute(start, "href")?.is_empty() {
                    return Err(
                        self.malformed("its data are in another file; they must be in the VOTable itself".into())
                    );
                }
                let encoding = self.attribute(start, "encoding")?;
                if encoding != "base64" {
                    return Err(self.malformed(format!("its stream has the encoding `{encoding}`; it must be base64")));
                }
                self.value = Some(String::new());
            }
            b"TR" => self.fields.clear(),
            b"TD" if self.is_reading => {
                let encoding = self.attribute(start, "encoding")?;
                if !encoding.is_empty() {
                    return Err(self.malformed(format!("a TD has the encoding `{encoding}`; it must be plain text")));
                }
                self.value = Some(String::new());
            }
            _ => {}
        }
        Ok(())
    }

    /// Adds a FIELD to the head of the table.
    fn field(&mut self, start: &BytesStart<'_>) -> Result<(), CatalogueError> {
        if self.columns.len() == MOST_FIELDS {
            return Err(self.malformed(format!("a table must have at most {MOST_FIELDS} fields")));
        }
        let text = |name: &str| self.attribute(start, name);
        let (mut name, unit, ucd) = (text("name")?, text("unit")?, text("ucd")?);
        if name.is_empty() {
            name = text("ID")?;
        }
        let datatype = text("datatype")?;
        let kind = match datatype.as_str() {
            "boolean" => Ok(Kind::Number(Scalar::Logical)),
            "bit" => Ok(Kind::Bits),
            "unsignedByte" => Ok(Kind::Number(Scalar::Byte)),
            "short" => Ok(Kind::Number(Scalar::Short)),
            "int" => Ok(Kind::Number(Scalar::Int)),
            "long" => Ok(Kind::Number(Scalar::Long)),
            "float" => Ok(Kind::Number(Scalar::Float)),
            "double" => Ok(Kind::Number(Scalar::Double)),
            "char" => Ok(Kind::Text),
            "unicodeChar" => Ok(Kind::WideText),
            "floatComplex" => Ok(Kind::Complex(Scalar::Float)),
            "doubleComplex" => Ok(Kind::Complex(Scalar::Double)),
            other => Err(format!("the field {} has the unknown datatype `{other}`", super::excerpt(&name))),
        };
        let size = text("arraysize")?;
        let count = if size.ends_with('*') {
            None
        } else {
            let sizes = if size.is_empty() { "1" } else { &size };
            let product = sizes.split('x').try_fold(1_usize, |all, size| all.checked_mul(size.trim().parse().ok()?));
            Some(product.ok_or_else(|| self.malformed(format!("the arraysize `{size}` is not a size")))?)
        };
        let frame_id = text("ref")?;
        self.head.push(&name, &unit, &ucd);
        self.frame_ids.push(frame_id);
        self.columns.push(Column { kind, count, null: String::new() });
        self.in_field = true;
        Ok(())
    }

    /// Begins the data of a table, and decides whether they are read.
    fn data(&mut self, form: Form) {
        self.form = form;
        if matches!(self.table, Some(Ok(_))) {
            self.further += 1;
            self.is_reading = false;
            return;
        }
        // A FIELD without a frame gets that of the document if there is only one.
        for (frame, id) in self.head.frames.iter_mut().zip(&self.frame_ids) {
            let named = self.frames.iter().find(|(known, _)| !id.is_empty() && known == id);
            let only = self.frames.first().filter(|_| self.frames.len() == 1);
            if let Some((_, stated)) = named.or(only) {
                frame.clone_from(stated);
            }
        }
        let table = Table::new(self.file, &self.head, self.reading);
        self.is_reading = table.is_ok();
        if table.is_ok() || self.table.is_none() {
            self.table = Some(table);
        }
    }

    fn text(&mut self, text: &[u8]) {
        if let Some(value) = &mut self.value {
            value.push_str(&String::from_utf8_lossy(text));
        }
    }

    /// Adds the character that a reference such as `&amp;` or `&#x41;` means.
    fn reference(&mut self, reference: &quick_xml::events::BytesRef<'_>) -> Result<(), CatalogueError> {
        let named = match &**reference {
            b"amp" => Some('&'),
            b"lt" => Some('<'),
            b"gt" => Some('>'),
            b"quot" => Some('"'),
            b"apos" => Some('\''),
            _ => None,
        };
        let number = reference.resolve_char_ref().map_err(|error| self.malformed(format!("not XML: {error}")))?;
        match (named.or(number), &mut self.value) {
            (Some(character), Some(value)) => value.push(character),
            (None, Some(_)) => return Err(self.malformed("an entity of the document is not known".into())),
            (_, None) => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &[u8]) -> Result<(), CatalogueError> {
        match name {
            b"INFO" if self.is_error => {
                let text = self.value.take().unwrap_or_default();
                let words: Vec<&str> = text.split_whitespace().collect();
                let shortened: String = words.join(" ").chars().take(MOST_ERROR_TEXT).collect();
                let reason = match shortened.escape_debug().to_string() {
                    none if none.is_empty() => "no reason".to_owned(),
                    reason => format!("`{reason}`"),
                };
                return Err(
                    self.malformed(format!("the service that wrote it reports an error, not a table: {reason}"))
                );
            }
            b"FIELD" => self.in_field = false,
            b"VOTABLE" => self.has_end = true,
            b"TABLEDATA" | b"BINARY" | b"BINARY2" => self.is_reading = false,
            b"TD" if self.is_reading => {
                let text = self.value.take().unwrap_or_default();
                let text = text.trim();
                let null = self.columns.get(self.fields.len()).map_or("", |column| column.null.as_str());
                self.fields.push(if text == null { String::new() } else { text.to_owned() });
            }
            b"TR" if self.is_reading => {
                if let Some(Ok(table)) = &mut self.table {
                    table.add(Ok(&self.fields))?;
                }
            }
            b"STREAM" if self.is_reading => {
                let mut text = self.value.take().unwrap_or_default();
                text.retain(|c| !c.is_ascii_whitespace());
                let bytes = STANDARD.decode(text).map_err(|error| self.malformed(format!("not base64: {error}")))?;
                self.binary(&bytes)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Reads the rows of a binary form.
    fn binary(&mut self, mut bytes: &[u8]) -> Result<(), CatalogueError> {
        while !bytes.is_empty() {
            let before = bytes.len();
            let null_bits = match self.form {
                Form::Binary2 => cut(&mut bytes, self.columns.len().div_ceil(8)).map(<[u8]>::to_vec),
                _ => Ok(Vec::new()),
            };
            let row = || -> Result<(), String> {
                let null_bits = null_bits?;
                self.fields.clear();
                for (index, column) in self.columns.iter().enumerate() {
                    let text = column.cell(&mut bytes)?;
                    let is_null = null_bits.get(index / 8).is_some_and(|byte| byte >> (7 - index % 8) & 1 == 1);
                    self.fields.push(if is_null || text == column.null { String::new() } else { text });
                }
                Ok(())
            };
            row().map_err(|reason| self.malformed(reason))?;
            if bytes.len() == before {
                return Err(self.malformed("its table has data, but all of its fields have a size of 0 bytes".into()));
            }
            if let Some(Ok(table)) = &mut self.table {
                table.add(Ok(&self.fields))?;
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<CatalogueRead, CatalogueError> {
        if self.has_votable && !self.has_end {
            return Err(self.malformed("the file ends before </VOTABLE>: it is incomplete".to_owned()));
        }
        let none = if self.has_votable { "the VOTable has no table with data" } else { "it is XML, but not a VOTable" };
        let none = self.malformed(none.to_owned());
        let mut table = self.table.unwrap_or(Err(none))?;
        self.notes.into_iter().for_each(|note| table.note(note));
        if self.further > 0 {
            table.note(format!("tables of the file that are not read: {}", self.further));
        }
        table.finish()
    }
}

impl Column {
    /// Removes the values of this column for one row from the start of `bytes` and returns them as text.
    fn cell(&self, bytes: &mut &[u8]) -> Result<String, String> {
        let kind = self.kind.clone()?;
        let count = match self.count {
            Some(count) => count,
            None => cut(bytes, 4)?.first_chunk().map_or(0, |length| u32::from_be_bytes(*length) as usize),
        };
        let each = match kind {
            Kind::Number(scalar) => scalar.bytes(),
            Kind::Complex(scalar) => 2 * scalar.bytes(),
            Kind::Text | Kind::Bits => 1,
            Kind::WideText => 2,
        };
        let length = if kind == Kind::Bits { Some(count.div_ceil(8)) } else { count.checked_mul(each) };
        let cell = cut(bytes, length.unwrap_or(usize::MAX))?;
        Ok(match kind {
            Kind::Number(scalar) if count == 1 => scalar.text(cell),
            Kind::Text => {
                let end = cell.iter().position(|byte| *byte == 0).unwrap_or(cell.len());
                String::from_utf8_lossy(&cell[..end]).trim().to_owned()
            }
            Kind::WideText => {
                let units = cell.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]));
                let text: String =
                    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
                text.trim_end_matches('\0').trim().to_owned()
            }
            Kind::Number(scalar) | Kind::Complex(scalar) => {
                cell.chunks_exact(scalar.bytes()).map(|bytes| scalar.text(bytes)).collect::<Vec<_>>().join(" ")
            }
            Kind::Bits => String::new(),
        })
    }
}

/// Removes `count` bytes from the start of `bytes` and returns them.
fn cut<'b>(bytes: &mut &'b [u8], count: usize) -> Result<&'b [u8], String> {
    let (start, rest) = bytes.split_at_checked(count).ok_or("the binary data end within a row")?;
    *bytes = rest;
    Ok(start)
}
