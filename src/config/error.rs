//! What can be wrong with a configuration. Every message names the file (or the override), the key, and what is allowed.

use std::io;
use std::path::PathBuf;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The path of a film cannot be read.
    #[error("cannot read the path {}: {source}", path.display())]
    ReadPath {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The text is not TOML.
    #[error("{origin}:{line}:{column}: {problem}")]
    Syntax {
        /// The file, or what stands for it.
        origin: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser says.
        problem: String,
    },
    /// An override does not have the form `key=value`, or its key leads nowhere.
    #[error("--set {argument}: {problem}")]
    Override {
        /// The override as given.
        argument: String,
        /// What is wrong and what is allowed.
        problem: String,
    },
    /// A key is unknown or missing, or its value is not allowed.
    #[error("{origin}: {key}: {problem}")]
    Key {
        /// The file, or the override that set the key.
        origin: String,
        /// Path of the key, such as `views[1].fov_deg (view `dome`)`.
        key: String,
        /// What is wrong and what is allowed.
        problem: String,
    },
}

/// A key and what is wrong with it, before the file is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    /// Path of the key from where the fault was found; empty for the place itself.
    pub key: String,
    /// What is wrong and what is allowed.
    pub problem: String,
}

impl Fault {
    /// A fault of `key`.
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { key: key.into(), problem: problem.into() }
    }

    /// The same fault seen from outside: `prefix` is the path to where it was found.
    pub fn within(self, prefix: &str) -> Self {
        Self { key: join(prefix, &self.key), ..self }
    }
}

/// Path of `key` below `prefix`.
pub(super) fn join(prefix: &str, key: &str) -> String {
    match (prefix.is_empty(), key.is_empty()) {
        (true, _) => key.to_owned(),
        (_, true) => prefix.to_owned(),
        _ if key.starts_with('[') => format!("{prefix}{key}"),
        _ => format!("{prefix}.{key}"),
    }
}

/// Refuses NaN and infinities.
pub(super) fn finite(key: &str, value: f64) -> Result<(), Fault> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(Fault::new(key, format!("{value} is not allowed: a finite number is needed")))
    }
}
