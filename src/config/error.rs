//! Errors of configurations. Every message names the file (or the override), the key, and the valid values.

use std::io;
use std::path::PathBuf;

use crate::ranges::KeyError;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The path of a film cannot be read.
    #[error("cannot read the path {}: {source}", path.display())]
    ReadPath {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The text is not TOML.
    #[error("{origin}:{line}:{column}: {problem}")]
    Syntax {
        /// Name of the file, or of the built-in configuration.
        origin: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Message of the parser.
        problem: String,
    },
    /// An override does not have the form `key=value`, or there is nothing at its path.
    #[error("--set {argument}: {problem}")]
    Override {
        /// The override as given.
        argument: String,
        /// What is wrong, and which values are valid.
        problem: String,
    },
    /// A key is unknown or missing, or its value is not valid.
    #[error("{origin}: {key}: {problem}")]
    Key {
        /// The file, or the override that set the key.
        origin: String,
        /// Path of the key, such as `views[1].fov_deg (view `dome`)`.
        key: String,
        /// What is wrong, and which values are valid.
        problem: String,
    },
}

/// Refuses NaN and infinities.
pub(super) fn finite(key: &str, value: f64) -> Result<(), KeyError> {
    if value.is_finite() { Ok(()) } else { Err(KeyError::new(key, format!("{value}: must be a finite number"))) }
}
