//! JSON catalogues. The keys of an object are the column names as in CSV, and the values are numbers or strings. A missing key is a missing value.
//! The whole file is held in memory. Forms:
//!
//! - an array of objects, or an object whose `stars` or `data` is such an array (pandas: `records`, `table`);
//! - an object with `metadata` or `columns`, which name the columns, and `data`, a list of rows (Gaia archive; pandas: `split`);
//! - an object of columns, each a list or an object by row (pandas: `list`, `columns`);
//! - an object in each line (NDJSON).

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value};

use super::columns::{self, Columns};
use super::rows::{Reading, Rows};
use super::{CatalogueError, CatalogueRead, RowPlace};

/// Maximum size of a document, bytes. The document is held in memory, where it needs several times this size.
const MOST_BYTES: u64 = 1 << 30;

/// Valid documents, for messages.
const FORMS: &str = "must be an array of stars, an object whose \"stars\" or \"data\" is such an array, an object of columns of equal length, or one object on each line";

/// Reads a JSON catalogue from a file; stars are placed `years` Julian years after J2000.0.
///
/// # Errors
/// If the file cannot be opened or read, if it is not JSON of the form above, if its keys are not those of a star
/// catalogue, or if no entry is usable.
pub fn read_json(path: &Path, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read_json_from(super::open(path)?, &path.display().to_string(), years)
}

/// Reads a JSON catalogue from `source`; messages call it `file`.
///
/// # Errors
/// Those of [`read_json`], except for errors of opening the file.
pub fn read_json_from(source: impl Read, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(source, file, &years.into())
}

/// Reads in the same way; `reading` may contain a receiver of the stars.
pub(super) fn read(source: impl Read, file: &str, reading: &Reading) -> Result<CatalogueRead, CatalogueError> {
    let mut bytes = Vec::new();
    // Read one byte more than the limit to detect that the document exceeds it.
    let mut source = source.take(MOST_BYTES + 1);
    source.read_to_end(&mut bytes).map_err(|source| CatalogueError::Io {
        file: file.to_owned(),
        place: RowPlace::Line(1),
        source,
    })?;
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let malformed = |line: usize, reason: String| CatalogueError::Malformed {
        file: file.to_owned(),
        place: RowPlace::Line(line),
        reason,
    };
    if bytes.len() as u64 > MOST_BYTES {
        let reason = format!("a JSON catalogue must have at most {MOST_BYTES} bytes; CSV has no limit");
        return Err(malformed(1, reason));
    }
    let Document { entries, lines, units } = Document::parse(text).map_err(|(line, reason)| malformed(line, reason))?;
    if entries.is_empty() {
        return Err(CatalogueError::NoRow { file: file.to_owned() });
    }
    let line_of = |entry: usize| lines.get(entry).copied().unwrap_or(1);

    // The columns are all keys that occur.
    let mut column_of_key: BTreeMap<&str, usize> = BTreeMap::new();
    for key in entries.iter().filter_map(Value::as_object).flat_map(|object| object.keys()) {
        let next = column_of_key.len();
        column_of_key.entry(key).or_insert(next);
    }
    let mut names = vec![""; column_of_key.len()];
    for (key, &column) in &column_of_key {
        names[column] = key;
    }
    let units: Vec<&str> = names.iter().map(|name| units.get(*name).map_or("", String::as_str)).collect();
    let columns = Columns::recognise(&names, Some(&units)).map_err(|reason| CatalogueError::Columns {
        file: file.to_owned(),
        place: RowPlace::Line(line_of(0)),
        reason,
        found: columns::listing(&names),
    })?;
    let columns = columns.in_degrees(reading.ra_in_degrees);

    // Entries.
    let mut rows = Rows::new(file, &columns, reading);
    let mut fields = vec![String::new(); names.len()];
    let mut filled = Vec::new();
    for (index, entry) in entries.iter().enumerate() {
        let filled = fill(entry, &column_of_key, &mut fields, &mut filled);
        let read = filled.map(|()| |i: usize| fields[i].as_str());
        rows.add(&columns, read, (line_of(index), &format!("entry {}: ", index + 1)))?;
    }
    rows.finish()
}

/// The stars of a document as objects.
struct Document {
    entries: Vec<Value>,
    /// Line of each entry, from 1; empty if the values of an entry are not contiguous in the text.
    lines: Vec<usize>,
    /// Units of the columns for which the document gives them.
    units: BTreeMap<String, String>,
}

impl Document {
    /// Parses a document in any of the forms. The error contains the line.
    fn parse(text: &[u8]) -> Result<Self, (usize, String)> {
        let not_json = |error: serde_json::Error| (error.line(), format!("not JSON: {error}"));
        let error = match serde_json::from_slice(text) {
            Ok(document) => return Self::of(document, text),
            Err(error) => error,
        };
        // Python writes NaN, which JSON does not have.
        if let Some(text) = with_nulls(text) {
            return Self::of(serde_json::from_slice(&text).map_err(not_json)?, &text);
        }
        // One object in each line.
        let mut objects = serde_json::Deserializer::from_slice(text).into_iter::<Value>();
        let (mut entries, mut lines) = (Vec::new(), Vec::new());
        let (mut line, mut counted) = (1, 0);
        while let Some(object) = objects.next() {
            let (Ok(object @ Value::Object(_)), end) = (object, objects.byte_offset()) else {
                return Err(not_json(error));
            };
            let own = &text[counted..end];
            let before =
                own.iter().take_while(|byte| byte.is_ascii_whitespace()).filter(|byte| **byte == b'\n').count();
            lines.push(line + before);
            line += own.iter().filter(|byte| **byte == b'\n').count();
            counted = end;
            entries.push(object);
        }
        if entries.len() < 2 {
            return Err(not_json(error));
        }
        Ok(Self { entries, lines, units: BTreeMap::new() })
    }

    fn of(document: Value, text: &[u8]) -> Result<Self, (usize, String)> {
        let mut object = match document {
            Value::Array(entries) => {
                return Ok(Self { entries, lines: entry_lines(text, None), units: BTreeMap::new() });
            }
            Value::Object(object) => object,
            _ => return Err((1, FORMS.to_owned())),
        };
        for key in ["stars", "data"] {
            let Some(Value::Array(list)) = object.get_mut(key).map(Value::take) else { continue };
            let (names, units) = named_columns(&object);
            let entries = list.into_iter().map(|entry| match entry {
                Value::Array(values) if values.len() == names.len() => {
                    Value::Object(names.iter().cloned().zip(values).collect())
                }
                entry => entry,
            });
            return Ok(Self { entries: entries.collect(), lines: entry_lines(text, Some(key)), units });
        }
        let entries = by_columns(object).ok_or((1, FORMS.to_owned()))?;
        Ok(Self { entries, lines: Vec::new(), units: BTreeMap::new() })
    }
}

/// Returns the names of the columns of a list of lists, and their units. `metadata` of the Gaia archive has both, `columns` of pandas only the names.
fn named_columns(document: &Map<String, Value>) -> (Vec<String>, BTreeMap<String, String>) {
    let (mut names, mut units) = (Vec::new(), BTreeMap::new());
    let columns = ["metadata", "columns", "fields"].into_iter().find_map(|key| document.get(key)?.as_array());
    for column in columns.into_iter().flatten() {
        let text = |key: &str| column.get(key).and_then(Value::as_str);
        let name = column.as_str().or(text("name")).unwrap_or_default().to_owned();
        units.extend(text("unit").map(|unit| (name.clone(), unit.to_owned())));
        names.push(name);
    }
    (names, units)
}

/// Converts a document whose keys are columns to a list of objects. Each column is a list, or an object by row. Returns `None` if the columns have
/// another form or different lengths.
fn by_columns(document: Map<String, Value>) -> Option<Vec<Value>> {
    let mut entries: Vec<Map<String, Value>> = Vec::new();
    let mut first_rows: Vec<String> = Vec::new();
    for (position, (name, column)) in document.into_iter().enumerate() {
        let (rows, values): (Vec<String>, Vec<Value>) = match column {
            Value::Array(values) => (Vec::new(), values),
            Value::Object(rows) => rows.into_iter().unzip(),
            _ => return None,
        };
        if position == 0 {
            entries.resize_with(values.len(), Map::new);
            first_rows.clone_from(&rows);
        }
        if values.len() != entries.len() || rows != first_rows {
            return None;
        }
        for (entry, value) in entries.iter_mut().zip(values) {
            entry.insert(name.clone(), value);
        }
    }
    (!entries.is_empty()).then(|| entries.into_iter().map(Value::Object).collect())
}

/// Replaces NaN and infinities outside of strings with `null`; returns `None` if there are none.
fn with_nulls(text: &[u8]) -> Option<Vec<u8>> {
    let mut replaced = Vec::with_capacity(text.len());
    let (mut position, mut in_string, mut has_any) = (0, false, false);
    while position < text.len() {
        let rest = &text[position..];
        let word =
            [&b"NaN"[..], b"-Infinity", b"Infinity"].into_iter().find(|word| !in_string && rest.starts_with(word));
        if let Some(word) = word {
            replaced.extend_from_slice(b"null");
            position += word.len();
            has_any = true;
            continue;
        }
        // A quotation mark after a backslash does not end a string.
        let count = if in_string && rest[0] == b'\\' { 2.min(rest.len()) } else { 1 };
        in_string ^= rest[0] == b'"';
        replaced.extend_from_slice(&rest[..count]);
        position += count;
    }
    has_any.then_some(replaced)
}

/// Writes the values of `entry` as text into `fields`, by column. `filled` lists the columns that the previous entry filled. Only these are cleared,
/// because there may be far more columns if every entry has different keys.
fn fill(
    entry: &Value,
    column_of_key: &BTreeMap<&str, usize>,
    fields: &mut [String],
    filled: &mut Vec<usize>,
) -> Result<(), String> {
    let object = entry.as_object().ok_or("is not an object")?;
    filled.drain(..).for_each(|column| fields[column].clear());
    for (key, value) in object {
        let Some(&column) = column_of_key.get(key.as_str()) else { continue };
        filled.push(column);
        let field = &mut fields[column];
        match value {
            Value::Null => {}
            Value::String(text) => field.push_str(text),
            // Containers and booleans are invalid values; if their column is used, the message shows their text.
            other => field.push_str(&other.to_string()),
        }
    }
    Ok(())
}

/// Returns the number of the line, counted from 1, on which each entry of a list begins. `text` must be valid JSON. Without a `key`, the list is the
/// document itself; otherwise it is the value of `key` in the document. If the key occurs several times, the last value is used, as in the parser.
fn entry_lines(text: &[u8], key: Option<&str>) -> Vec<usize> {
    let list_depth = if key.is_some() { 2 } else { 1 };
    let mut lines = Vec::new();
    let (mut line, mut depth, mut position) = (1, 0, 0);
    let mut in_list = false;
    let mut expects_entry = false;
    let mut last_string = &text[..0];
    while position < text.len() {
        let byte = text[position];
        // The first byte of a value in the list begins an entry.
        let begins_value = !matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b',' | b']' | b'}' | b':');
        if in_list && depth == list_depth && expects_entry && begins_value {
            lines.push(line);
            expects_entry = false;
        }
        match byte {
            b'\n' => line += 1,
            // Skip a string; at depth 1 it may be the key of the list.
            b'"' => {
                let start = position + 1;
                position = start;
                while text.get(position).is_some_and(|&b| b != b'"') {
                    position += if text[position] == b'\\' { 2 } else { 1 };
                }
                if depth == 1 {
                    last_string = text.get(start..position).unwrap_or_default();
                }
            }
            b'{' | b'[' => {
                depth += 1;
                if byte == b'[' && depth == list_depth && key.is_none_or(|k| last_string == k.as_bytes()) {
                    in_list = true;
                    expects_entry = true;
                    lines.clear();
                }
            }
            b'}' | b']' => {
                in_list &= depth != list_depth;
                depth -= 1;
            }
            b',' => expects_entry |= depth == list_depth,
            _ => {}
        }
        position += 1;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entry_lines_finds_the_line_of_each_entry() {
        assert_eq!(entry_lines(b"[{\"a\":[1,\n2]},\n\n{\"b\":\"]\\\"}\"}\n, 5, \"x\"]", None), [1, 4, 5, 5]);
        let text = b"{\"other\": [\n1, 2],\n \"stars\": [\n{\"a\": {\"b\": [1, 2]}},\n{}\n], \"more\": [1]}";
        assert_eq!(entry_lines(text, Some("stars")), [4, 5]);
        assert!(entry_lines(b"[]", None).is_empty());
    }

    /// Compares the forms of the Gaia archive, of pandas (`orient`), of Python's `json` and of NDJSON with an array of objects.
    #[test]
    fn every_form_gives_the_same_stars() {
        let read = |text: &str| read_json_from(text.as_bytes(), "test.json", 0.0);
        let plain = read(
            r#"[{"ra":101.287,"dec":-16.716,"v_mag":-1.46,"teff_k":null,"parallax":379.2},
            {"ra":88.79,"dec":7.4,"v_mag":0.5,"teff_k":3500,"parallax":6.5}]"#,
        )
        .unwrap();
        let records = r#"{"ra":101.287,"dec":-16.716,"v_mag":-1.46,"teff_k":NaN,"parallax":379.2},
            {"ra":88.79,"dec":7.4,"v_mag":0.5,"teff_k":3500,"parallax":6.5}"#;
        let rows = "[[101.287,-16.716,-1.46,null,379.2],\n[88.79,7.4,0.5,3500,6.5]]";
        for text in [
            format!("[{records}]"),
            format!(r#"{{"schema":{{"fields":[]}},"data":[{records}]}}"#),
            format!(
                r#"{{"metadata":[{{"name":"ra","unit":"deg"}},{{"name":"dec"}},{{"name":"v_mag"}},{{"name":"teff_k"}},{{"name":"parallax","unit":"mas"}}],"data":{rows}}}"#
            ),
            format!(r#"{{"columns":["ra","dec","v_mag","teff_k","parallax"],"index":[0,1],"data":{rows}}}"#),
            r#"{"ra":[101.287,88.79],"dec":[-16.716,7.4],"v_mag":[-1.46,0.5],"teff_k":[null,3500],"parallax":[379.2,6.5]}"#.to_owned(),
            r#"{"ra":{"0":101.287,"1":88.79},"dec":{"0":-16.716,"1":7.4},"v_mag":{"0":-1.46,"1":0.5},"teff_k":{"0":null,"1":3500},
                "parallax":{"0":379.2,"1":6.5}}"#
                .to_owned(),
            records.replace("},", "}").replace("NaN", "null"),
        ] {
            let found = read(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(found.stars, plain.stars, "{text}");
        }
        for (text, part) in [
            (r#"{"ra":[1,2],"dec":[1],"v_mag":[1,2]}"#, "columns of equal length"),
            ("{\"ra\":1}\n5\n", "not JSON"),
            ("[{\"ra\":\"NaN\",]", "not JSON"),
            ("7", "must be an array"),
            (r#"{"metadata":[{"name":"ra"}],"data":[[1,2]]}"#, "no direction"),
        ] {
            let error = read(text).expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
        let document = Document::parse(b"{\"a\":1}\n\n{\"a\":\n2}\n{\"a\":3}").unwrap();
        assert_eq!(document.lines, [1, 3, 5]);
    }
}
