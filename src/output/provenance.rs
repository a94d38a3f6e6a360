//! Provenance of a picture, as recorded in manifests. It suffices to make the picture again, and to find the cause if the bytes differ.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::{catalogue::reader::RejectedRow, config::CameraConfig};

/// A file named by the configuration, or by one of its files.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct InputFile {
    /// Path relative to the folder of the configuration, or absolute.
    pub file: String,
    /// Length in bytes.
    pub bytes: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
}

/// The configuration in effect.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UsedConfiguration {
    /// Folder to which its relative paths refer.
    pub folder: PathBuf,
    /// The configuration as TOML, with overrides applied, and without the keys that concern only the daemon and the headset.
    pub toml: String,
}

/// A catalogue and its load result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UsedCatalogue {
    /// Name in the configuration; for synthetic stars their parameters.
    pub name: String,
    /// Number of loaded stars.
    pub stars: usize,
    /// Number of rejected rows; `None` for stores and built-in catalogues, which have no rows.
    pub rejected_rows: Option<usize>,
    /// First rejected rows.
    pub first_rejected: Vec<RejectedRow>,
}

/// Provenance of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// Name of the adapter.
    pub adapter: String,
    /// Driver of the adapter.
    pub driver: String,
    /// The configuration.
    pub configuration: UsedConfiguration,
    /// The camera at the start: position, orientation and velocity.
    pub camera: CameraConfig,
    /// Moment, s since 2000-01-01T12:00:00Z.
    pub time_s_since_j2000: f64,
    /// Sources of the stars.
    pub catalogues: Vec<UsedCatalogue>,
    /// Every file that pictures depend on, by path.
    pub files: Vec<InputFile>,
}

/// Returns a path as recorded in manifests: relative to the folder of the configuration if it is inside.
pub fn recorded_path(path: &Path, folder: &Path) -> String {
    path.strip_prefix(folder).unwrap_or(path).display().to_string()
}
