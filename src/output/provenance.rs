//! Provenance of a picture as recorded in manifests: enough to make it again, and to find the differences if the bytes
//! differ.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::scene::Camera;

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
    /// Folder of its relative paths.
    pub folder: PathBuf,
    /// TOML with overrides, without the keys that concern only the daemon and the headset.
    pub toml: String,
}

/// A rejected row of a catalogue.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UsedRow {
    /// Line of the file on which the row begins, from 1.
    pub line: usize,
    /// Reason for the rejection.
    pub reason: String,
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
    pub first_rejected: Vec<UsedRow>,
}

/// The camera at the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UsedCamera {
    /// Position, ICRS, barycentric, m.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w from camera axes to ICRS axes.
    pub orientation: [f64; 4],
    /// Velocity, ICRS axes, in units of the speed of light.
    pub velocity_c: [f64; 3],
}

impl From<&Camera> for UsedCamera {
    fn from(camera: &Camera) -> Self {
        Self {
            position_m: camera.position_m.to_array(),
            orientation: camera.world_from_camera.to_array(),
            velocity_c: camera.velocity_c.to_array(),
        }
    }
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
    /// The camera.
    pub camera: UsedCamera,
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
