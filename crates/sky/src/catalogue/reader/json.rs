//! JSON catalogues: an array of objects, or an object whose `stars` is such an array. The keys are the column names
//! of CSV, the values are numbers or strings; a missing key is a missing value. The whole file is held in memory.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use serde_json::Value;

use super::columns::{self, Columns};
use super::rows::{Reading, Rows};
use super::{CatalogueError, CatalogueRead, RowPlace};

/// Largest document, bytes: it is held in memory and needs several times as much there.
const MOST_BYTES: u64 = 1 << 30;

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
/// As [`read_json`], apart from opening.
pub fn read_json_from(source: impl Read, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(source, file, &years.into())
}

/// The same, with a receiver of the stars.
pub(super) fn read(source: impl Read, file: &str, reading: &Reading) -> Result<CatalogueRead, CatalogueError> {
    let mut bytes = Vec::new();
    // One byte more than the limit shows that the document exceeds it.
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
    // The list of stars, and the line of each entry.
    let document: Value = serde_json::from_slice(text).map_err(|e| malformed(e.line(), format!("not JSON: {e}")))?;
    let stars_key = document.as_object().map(|_| "stars");
    let list = match stars_key {
        Some(key) => document.get(key),
        None => Some(&document),
    };
    let Some(entries) = list.and_then(Value::as_array) else {
        return Err(malformed(1, "must be an array of stars, or an object whose \"stars\" is one".into()));
    };
    if entries.is_empty() {
        return Err(CatalogueError::NoRow { file: file.to_owned() });
    }
    let lines = entry_lines(text, stars_key);
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
    let columns = Columns::recognise(&names, None).map_err(|reason| CatalogueError::Columns {
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

/// Writes the values of `entry` as text into `fields`, by column. `filled` lists the columns that the previous entry
/// has filled. Only those are cleared, because there may be far more columns if every entry has different keys.
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
            // Containers and booleans are not numbers either; if they are used, the message shows their text.
            other => field.push_str(&other.to_string()),
        }
    }
    Ok(())
}

/// Returns the line, from 1, on which each entry of the list begins. `text` must be valid JSON. The list is the
/// document itself, or the value of `key` in it (the last one if there are several, as in the parser).
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
}
