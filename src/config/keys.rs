//! Moves keys between types that have the same ones, such as a specification and the message that carries it.

use serde::{Serialize, de::DeserializeOwned};
use toml::{Table, Value};

use super::document::deserialise;
use super::error::{Fault, join};

/// A key that is unknown, missing, or has a value that is not valid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", join_problem(.key, .problem))]
pub struct KeyError {
    /// Path of the key; empty for the value itself.
    pub key: String,
    /// What is wrong, and what is valid.
    pub problem: String,
}

fn join_problem(key: &str, problem: &str) -> String {
    if key.is_empty() { problem.to_owned() } else { format!("{key}: {problem}") }
}

impl KeyError {
    /// The same error with the path `prefix` before its key.
    #[must_use]
    pub fn within(self, prefix: &str) -> Self {
        Self { key: join(prefix, &self.key), ..self }
    }
}

impl From<Fault> for KeyError {
    fn from(Fault { key, problem }: Fault) -> Self {
        Self { key, problem }
    }
}

/// The keys of a value.
pub(super) fn table_of(value: &impl Serialize) -> Result<Table, Fault> {
    Table::try_from(value).map_err(|error| Fault::new("", error.to_string()))
}

/// A value with the same keys.
///
/// # Errors
///
/// The first key that the other type does not have, or whose value it does not take.
pub fn with_same_keys<T: DeserializeOwned>(value: &impl Serialize) -> Result<T, KeyError> {
    Ok(deserialise(Value::Table(table_of(value)?), "")?)
}

/// `current` with the `keys` of `given`. A key that `given` does not have is removed.
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
    Ok(deserialise(Value::Table(table), "")?)
}
