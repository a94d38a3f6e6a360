//! From text to tables: syntax with line and column, and deserialisation that knows the path of the key at fault.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
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
            problem: error.message().trim().replace('\n', "; "),
        }
    })
}

/// Deserialises the value at the path `prefix`; a fault names the key below it.
pub(super) fn deserialise<T: DeserializeOwned>(value: Value, prefix: &str) -> Result<T, KeyError> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let key = if path == "." { String::new() } else { path };
        let problem = error.inner().message().trim().replace('\n', "; ");
        // Serde reports an unknown key at the table that holds it; the user looks for the key.
        let unknown = problem.strip_prefix("unknown field `").and_then(|rest| rest.split('`').next());
        let key = match unknown {
            Some(name) if key != name && !key.ends_with(&format!(".{name}")) => key_below(&key, name),
            _ => key,
        };
        KeyError::new(key_below(prefix, &key), in_words(&problem))
    })
}

/// A message of serde in the words of the file: keys, and the kinds of values that TOML has.
fn in_words(problem: &str) -> String {
    let problem = problem.replace("unknown field", "unknown key").replace("missing field", "missing key");
    let Some((found, expected)) = problem.rsplit_once(", expected ") else { return problem };
    let kind = match expected {
        "f32" | "f64" => "a number without quotation marks or unit",
        "u8" | "u16" | "u32" | "u64" | "usize" | "nonzero u32" | "a nonzero u32" => "a whole number, not negative",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a boolean" => "true or false",
        "a map" => "a table",
        "a sequence" => "a list in brackets",
        _ => return problem,
    };
    format!("{found}, expected {kind}")
}

/// Checks the numbers of a value by the ranges of a type.
pub(super) fn check_ranges<T: JsonSchema + 'static>(value: &Value) -> Result<(), KeyError> {
    ranges::check::<T>(value)
}

/// Deserialises a value and checks its numbers.
pub(super) fn read<T: DeserializeOwned + JsonSchema + 'static>(value: Value) -> Result<T, KeyError> {
    let read = deserialise(value.clone(), "")?;
    check_ranges::<T>(&value)?;
    Ok(read)
}
