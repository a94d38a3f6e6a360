//! Parts of a store. A part contains the stars of a range of cells of order 4; a merge joins it with the parts for the other cells
//! ([`merge`](super::merge)).
//!
//! A part is a deep store whose index contains its range of cells. Three additional files contain the data for a merge:
//!
//! | file | content |
//! |---|---|
//! | `part.json` | [`PartRecord`]: version, cells, inputs with digests, numbers for the report, checksums of the other two files |
//! | `bright-stars`, `bright-names` | the bright stars in full precision (in `bright` their positions are relative to chunks of stars) |
//!
//! The SHA-256 of `part.json` is in the index; therefore the root checksum covers it.

use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::cell_range::CellRange;
use super::error::DeepError;
use super::finish::Tally;
use super::index::PartOfIndex;
use super::journal::{BrightStars, NAMES, STARS};
use crate::files;

/// Name of the file of the record.
pub const NAME: &str = "part.json";
/// Version of parts. It must change when the encoding of stars changes.
pub const VERSION: u32 = 1;
/// Largest length of a record, bytes.
const MOST_BYTES: u64 = 1 << 28;

/// The fields that are common to records of all versions.
#[derive(Deserialize)]
struct Version {
    version: u32,
    program: String,
}

/// An input of an import.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Name for messages.
    pub name: String,
    /// SHA-256 of a file, root checksum of a deep store, or all parameters of a source that the program contains or generates.
    pub digest: String,
}

/// Record of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartRecord {
    /// Version of parts.
    pub version: u32,
    /// Version of the program that made the part.
    pub program: String,
    /// Its cells.
    pub cells: CellRange,
    /// Inputs, in the order of the command line.
    pub inputs: Vec<Input>,
    /// Lines about the inputs for the report.
    pub lines: Vec<String>,
    /// Numbers of stars that needed a rule, and of those that were left out.
    pub tally: Tally,
    /// Number of bright stars, and length of the file of their names.
    pub bright: [u64; 2],
    /// CRC-32 of the file of bright stars, and of the file of their names.
    pub bright_crc32: [u32; 2],
}

impl PartRecord {
    /// Creates the record before its files are written.
    pub fn new(cells: CellRange, inputs: Vec<Input>, lines: Vec<String>, tally: Tally) -> Self {
        let program = env!("CARGO_PKG_VERSION").to_owned();
        Self { version: VERSION, program, cells, inputs, lines, tally, bright: [0; 2], bright_crc32: [0; 2] }
    }

    /// Writes the three files into the folder of a store; returns the SHA-256 of `part.json`.
    pub fn write(mut self, folder: &Path, stars: &mut BrightStars) -> Result<[u8; 32], DeepError> {
        self.bright = stars.save_all(folder)?;
        self.bright_crc32 = bright_crc32(folder)?;
        let path = folder.join(NAME);
        let json = serde_json::to_vec_pretty(&self).map_err(|error| DeepError::io(&path)(error.into()))?;
        files::write_whole(&path, &json).map_err(DeepError::io(&path))?;
        Ok(Sha256::digest(&json).into())
    }

    /// Reads the record of a store.
    ///
    /// # Errors
    /// The record cannot be read, does not match the index, or has another version.
    pub fn read(folder: &Path, expected: &PartOfIndex) -> Result<Self, DeepError> {
        let path = folder.join(NAME);
        let bytes = files::read_bounded(&path, MOST_BYTES).map_err(DeepError::io(&path))?;
        if <[u8; 32]>::from(Sha256::digest(&bytes)) != expected.sha256 {
            return Err(DeepError::damaged(&path, "its checksum differs from the one in the index"));
        }
        // Compare the version first, because another version may have other fields.
        let unusable =
            |error: serde_json::Error| DeepError::damaged(&path, format!("it is not the record of a part: {error}"));
        let Version { version, program } = serde_json::from_slice(&bytes).map_err(unusable)?;
        if (version, program.as_str()) != (VERSION, env!("CARGO_PKG_VERSION")) {
            let problem = format!(
                "made by version {program} of the program (version {version} of parts), this is {} ({VERSION}); import this part again, or merge with that \
                 program",
                env!("CARGO_PKG_VERSION")
            );
            return Err(DeepError::OtherPart { path: folder.to_owned(), problem });
        }
        let record: Self = serde_json::from_slice(&bytes).map_err(unusable)?;
        if record.cells != expected.cells {
            return Err(DeepError::damaged(&path, "its cells are not those of the index"));
        }
        Ok(record)
    }

    /// Reads the bright stars in full precision.
    ///
    /// # Errors
    /// A file cannot be read, or its checksum is wrong.
    pub fn bright(&self, folder: &Path) -> Result<BrightStars, DeepError> {
        let found = bright_crc32(folder)?;
        for ((name, found), expected) in [STARS, NAMES].into_iter().zip(found).zip(self.bright_crc32) {
            if found != expected {
                return Err(DeepError::damaged(&folder.join(name), "its checksum differs from the one in part.json"));
            }
        }
        BrightStars::read(folder, self.bright)
    }
}

fn bright_crc32(folder: &Path) -> Result<[u32; 2], DeepError> {
    let of_file = |name: &str| -> Result<u32, DeepError> {
        let path = folder.join(name);
        let mut file = files::open_regular(&path).map_err(DeepError::io(&path))?;
        let (mut hash, mut block) = (crc32fast::Hasher::new(), vec![0; 1 << 20]);
        loop {
            match file.read(&mut block).map_err(DeepError::io(&path))? {
                0 => return Ok(hash.finalize()),
                bytes => hash.update(&block[..bytes]),
            }
        }
    };
    Ok([of_file(STARS)?, of_file(NAMES)?])
}
