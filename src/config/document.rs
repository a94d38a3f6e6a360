//! From text to tables: syntax with line and column, and deserialisation that knows the path of the key at fault.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_path_to_error::{Path, Segment};
use toml::{Table, Value};

use super::error::ConfigError;
use crate::ranges;
use crate::ranges::{KeyError, key_below};

/// Parses TOML; `origin` names the file in messages.
pub(super) fn parse(text: &str, origin: &str) -> Result<Table, ConfigError> {
    text.parse::<Table>().map_err(|error| {
        let at = error.span().map_or(0, |span| span.start).min(text.len());
        let before = &text.as_bytes()[..at];
        let line_start = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
        ConfigError::Syntax {
            origin: origin.to_owned(),
            line: before.iter().filter(|&&byte| byte == b'\n').count() + 1,
            column: String::from_utf8_lossy(&before[line_start..]).chars().count() + 1,
            problem: match (error.message(), error.span().and_then(|span| text.get(span))) {
                ("duplicate key", Some(key)) => format!("duplicate key `{}`", key.trim()),
                (problem, _) => problem.trim().replace('\n', "; "),
            },
        }
    })
}

/// Deserialises the value at the path `prefix`; an error names the key below it.
pub(super) fn deserialise<T: DeserializeOwned>(value: Value, prefix: &str) -> Result<T, KeyError> {
    let given = value.clone();
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let key = if path == "." { String::new() } else { path };
        let problem = error.inner().message().trim().replace('\n', "; ");
        let problem = match problem.as_str() {
            NOT_A_NAME => unknown_name::<T>(given, error.path()).unwrap_or(problem),
            _ => problem,
        };
        // For an unknown key, serde gives the path of its table; give the path of the key itself.
        let unknown = problem.strip_prefix("unknown field `").and_then(|rest| rest.split('`').next());
        let key = match unknown {
            Some(name) if key != name && !key.ends_with(&format!(".{name}")) => key_below(&key, name),
            _ => key,
        };
        let problem = in_words(&problem, &key);
        KeyError::new(key_below(prefix, &key), problem)
    })
}

/// Serde's error for a value that must be one of several names but is not text. This error does not list the names.
const NOT_A_NAME: &str = "invalid type: unit variant, expected string only";

/// Returns serde's error for the same value written as text, which lists the names.
fn unknown_name<T: DeserializeOwned>(mut whole: Value, path: &Path) -> Option<String> {
    let mut value = &mut whole;
    for segment in path {
        value = match segment {
            Segment::Map { key } => value.get_mut(key.as_str())?,
            Segment::Seq { index } => value.get_mut(*index)?,
            // A path segment for an enum adds no key.
            Segment::Enum { .. } | Segment::Unknown => value,
        };
    }
    *value = Value::from(value.to_string());
    let error = serde_path_to_error::deserialize::<_, T>(whole).err()?;
    let problem = error.inner().message().trim();
    problem.starts_with("unknown variant").then(|| problem.replace('\n', "; "))
}

/// Names of the elements of lists of fixed length, by the name of the list's key.
const LISTS: [(&str, &str); 14] = [
    ("size", "[width, height]"),
    ("size_m", "[x, y, z]"),
    ("position", "[x, y]"),
    ("position_m", "[x, y, z]"),
    ("points_m", "[x, y, z]"),
    ("around_m", "[x, y, z]"),
    ("eye_m", "[x, y, z]"),
    ("radii_m", "[x, y, z]"),
    ("velocity_c", "[x, y, z]"),
    ("orientation", "[x, y, z, w]"),
    ("horizon_deg", "[azimuth, altitude]"),
    ("geometric_albedo", "[red, green, blue]"),
    ("radius_m", "[smallest, largest]"),
    ("spin_period_s", "[shortest, longest]"),
];

/// Returns the message for a list of the wrong length, or for a value that is not a list.
fn list_in_words(found: &str, expected: &str, key: &str) -> String {
    let name = key.rsplit('.').next().and_then(|name| name.split('[').next()).unwrap_or_default();
    match LISTS.iter().find(|(known, _)| *known == name) {
        Some((_, form)) => format!("{found}: must be {form}"),
        None => {
            let length = expected.strip_prefix("an array of length ");
            let kind = length.map_or("a shorter list".to_owned(), |length| format!("a list of {length} values"));
            format!("{found}, expected {kind}")
        }
    }
}

/// Rewrites a message of serde about a key in terms of the file: keys, and the types of values in TOML.
fn in_words(problem: &str, key: &str) -> String {
    let problem = problem.replace("unknown field", "unknown key").replace("missing field", "missing key");
    let Some((found, expected)) = problem.rsplit_once(", expected ") else { return problem };
    let kind = match expected {
        "f32" | "f64" => "a number without quotation marks or unit",
        "u32" => "a whole number from 0 to 4294967295",
        "i32" => "a whole number from -2147483648 to 2147483647",
        "u64" | "usize" => "a whole number, not negative",
        "i64" => "a whole number",
        "a boolean" => "true or false",
        "a map" => "a table",
        "a sequence" => "a list in brackets",
        _ if expected.starts_with("an array of length ") || expected == "fewer elements in array" => {
            return list_in_words(found, expected, key);
        }
        _ => return problem,
    };
    format!("{found}, expected {kind}")
}

/// Checks the numbers of a value against the ranges of a type.
pub(super) fn check_ranges<T: JsonSchema + 'static>(value: &Value) -> Result<(), KeyError> {
    ranges::check::<T>(value)
}

/// Deserialises a value and checks its numbers.
pub(super) fn read<T: DeserializeOwned + JsonSchema + 'static>(value: Value) -> Result<T, KeyError> {
    let read = deserialise(value.clone(), "")?;
    check_ranges::<T>(&value)?;
    Ok(read)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use serde::Deserialize;

    use super::super::{FisheyeSpec, SceneConfig};
    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Name {
        First,
        Second,
    }

    #[derive(Debug, Deserialize)]
    #[allow(dead_code, reason = "only the error is looked at")]
    struct Item {
        name: Name,
    }

    #[derive(Debug, Deserialize)]
    #[allow(dead_code, reason = "only the error is looked at")]
    struct Items {
        items: Vec<Item>,
    }

    fn problem<T: DeserializeOwned + JsonSchema + 'static>(text: &str) -> String {
        read::<T>(Value::Table(parse(text, "test.toml").unwrap()))
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default()
    }

    #[test]
    fn messages_name_the_valid_numbers_and_the_elements_of_lists() {
        for (text, expected) in [
            (
                "size = [99999999999, 64]",
                "size[0]: invalid value: integer `99999999999`, expected a whole number from 0 to 4294967295",
            ),
            ("size = [-3, 4]", "size[0]: invalid value: integer `-3`, expected a whole number from 0 to 4294967295"),
            ("size = [1, 2, 3]", "size: invalid length 3: must be [width, height]"),
            ("size = [1]", "size: invalid length 1: must be [width, height]"),
            ("size = 4", "size: invalid type: integer `4`: must be [width, height]"),
        ] {
            assert_eq!(problem::<FisheyeSpec>(&format!("fov_deg = 90\n{text}")), expected);
        }
        let found = problem::<SceneConfig>("camera = { orientation = [1, 2] }");
        assert_eq!(found, "camera.orientation: invalid length 2: must be [x, y, z, w]");
    }

    #[test]
    fn duplicate_keys_are_named() {
        for (text, expected) in [
            ("[stars]\nmethod = 'auto'\nmethod = 'tent'\n", "test.toml:3:1: duplicate key `method`"),
            ("[stars]\n[stars]\n", "test.toml:2:2: duplicate key `stars`"),
        ] {
            assert_eq!(parse(text, "test.toml").unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn a_value_that_is_no_text_lists_the_names() {
        for value in ["false", "3", "2.5"] {
            let table: Table = format!("[[items]]\nname = 'first'\n[[items]]\nname = {value}").parse().unwrap();
            let KeyError { key, problem } = deserialise::<Items>(Value::Table(table), "").unwrap_err();
            let expected = format!("unknown variant `{value}`, expected `first` or `second`");
            assert_eq!((key, problem), ("items[1].name".to_owned(), expected));
        }
    }
}
