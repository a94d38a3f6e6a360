//! Parts of a store: the stars of a range of cells of order 4, which another program joins with those of the other cells ([`merge`](super::merge)).
//!
//! A part is a deep store whose index has its range of cells. Three more files have what a merge needs:
//!
//! | file | content |
//! |---|---|
//! | `part.json` | [`PartRecord`]: version, cells, inputs with digests, numbers for the report, checksums of the other two files |
//! | `bright-stars`, `bright-names` | the bright stars in full precision: `bright` has them relative to chunks of all stars |
//!
//! The SHA-256 of `part.json` is in the index, and so in the root checksum.

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
/// Version of parts. Programs that encode stars otherwise must have another one.
pub const VERSION: u32 = 1;
/// Largest length of a record, bytes.
const MOST_BYTES: u64 = 1 << 28;

/// The fields that a record of any version has.
#[derive(Deserialize)]
struct Version {
    version: u32,
    program: String,
}

/// An input of an import.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Its name, for messages.
    pub name: String,
    /// SHA-256 of a file, root checksum of a deep store, or all parameters of something that the program has or makes.
    pub digest: String,
}

/// Record of a part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartRecord {
    /// Version of parts.
    pub version: u32,
    /// Version of the program.
    pub program: String,
    /// Its cells.
    pub cells: CellRange,
    /// Inputs, in the order of the command.
    pub inputs: Vec<Input>,
    /// Lines of the report for the inputs.
    pub lines: Vec<String>,
    /// Stars that needed a rule, and those that were left out.
    pub tally: Tally,
    /// Number of bright stars, and length of the file of their names.
    pub bright: [u64; 2],
    /// CRC-32 of the files of bright stars and of their names.
    pub bright_crc32: [u32; 2],
}

impl PartRecord {
    /// The record before its files are written.
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
    /// It cannot be read, is not that of the index, or has another version.
    pub fn read(folder: &Path, expected: &PartOfIndex) -> Result<Self, DeepError> {
        let path = folder.join(NAME);
        let bytes = files::read_bounded(&path, MOST_BYTES).map_err(DeepError::io(&path))?;
        if <[u8; 32]>::from(Sha256::digest(&bytes)) != expected.sha256 {
            return Err(DeepError::damaged(&path, "its checksum is not the one in the index"));
        }
        // Another version may have other fields: compare it first.
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
                return Err(DeepError::damaged(&folder.join(name), "its checksum is not the one in part.json"));
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
