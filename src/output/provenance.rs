//! What a picture was made of, as manifests tell it: enough to make it again, and to say what differs where that does not give the same bytes.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::scene::Camera;

/// A file that the configuration names, or that one of those names.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct InputFile {
    /// Its path from the folder of the configuration, or from the root.
    pub file: String,
    /// Length.
    pub bytes: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
}

/// The configuration as it was used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UsedConfiguration {
    /// The folder at which its relative paths start.
    pub folder: PathBuf,
    /// With its overrides, TOML; without what concerns the daemon and the headset alone.
    pub toml: String,
}

/// A row of a catalogue that could not be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UsedRow {
    /// Line in the file on which it begins, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

/// A catalogue and what became of its rows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UsedCatalogue {
    /// As the configuration names it; of synthetic stars their numbers.
    pub name: String,
    /// Stars that it gave.
    pub stars: usize,
    /// Rows that could not be used; `None` for stores and built-in catalogues, which have none.
    pub rejected_rows: Option<usize>,
    /// The first of them.
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

/// What a picture was made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// The adapter.
    pub adapter: String,
    /// Its driver.
    pub driver: String,
    /// The configuration.
    pub configuration: UsedConfiguration,
    /// The camera.
    pub camera: UsedCamera,
    /// The moment, s since 2000-01-01T12:00:00Z.
    pub time_s_since_j2000: f64,
    /// Where the stars come from.
    pub catalogues: Vec<UsedCatalogue>,
    /// Every file that pictures depend on, by path.
    pub files: Vec<InputFile>,
}

/// A path as it is told: from the folder of the configuration, where it is in there.
pub fn told_path(path: &Path, folder: &Path) -> String {
    path.strip_prefix(folder).unwrap_or(path).display().to_string()
}
