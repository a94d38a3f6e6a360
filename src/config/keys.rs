//! Converts between types that have the same keys, such as a specification and the message that carries it.

use serde::{Serialize, de::DeserializeOwned};
use toml::{Table, Value};

use super::document::deserialise;
use crate::ranges::KeyError;

/// The keys of a value.
pub(super) fn table_of(value: &impl Serialize) -> Result<Table, KeyError> {
    Table::try_from(value).map_err(|error| KeyError::new("", error.to_string()))
}

/// Converts a value to another type with the same keys.
///
/// # Errors
///
/// The first key that the other type does not have, or whose value it does not accept.
pub fn with_same_keys<T: DeserializeOwned>(value: &impl Serialize) -> Result<T, KeyError> {
    deserialise(Value::Table(table_of(value)?), "")
}

/// Returns `current` with the values of `keys` replaced by those in `given`. A key of `keys` that `given` does not have is removed.
///
/// # Errors
///
/// A key that the type does not have.
pub fn with_keys_of<T: Serialize + DeserializeOwned>(current: &T, given: &T, keys: &[&str]) -> Result<T, KeyError> {
    let (mut table, mut given) = (table_of(current)?, table_of(given)?);
    for key in keys {
        table.remove(*key);
        table.extend(given.remove_entry(*key));
    }
    deserialise(Value::Table(table), "")
}
