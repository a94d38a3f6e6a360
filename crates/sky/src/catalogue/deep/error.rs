//! Errors of deep stores.

use std::io;
use std::path::{Path, PathBuf};

use super::super::galaxy::GalaxyError;
use super::super::reader::CatalogueError;
use super::super::store::StoreError;

/// Errors from writing or reading a deep store.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeepError {
    /// An I/O error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The disk is full.
    #[error(
        "{}: the disk is full. Nothing was put in place of the store; free some space and run the same command again: it continues with the \
         unfinished store",
        path.display()
    )]
    DiskFull {
        /// The file that could not be written.
        path: PathBuf,
    },
    /// The folder is not a deep store.
    #[error("{}: not a deep star store (a folder whose file `index` begins with {:?})", path.display(), "STERDEEP")]
    NotAStore {
        /// The folder.
        path: PathBuf,
    },
    /// The store has another version.
    #[error("{}: deep store of version {found}; this program reads versions 1 to {}; import the catalogue again", path.display(), super::index::VERSION)]
    Version {
        /// The index.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// A file is damaged or belongs to another store.
    #[error("{}: damaged store: {problem}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Description of the damage.
        problem: String,
    },
    /// A leaf or tile is damaged.
    #[error("{}: damaged store: {part} {cell} of order {order}: {problem}", path.display())]
    DamagedPart {
        /// The file.
        path: PathBuf,
        /// `leaf` or `tile`.
        part: &'static str,
        /// Number of its cell, nested.
        cell: u64,
        /// Order of its cell.
        order: u8,
        /// Description of the damage.
        problem: String,
    },
    /// A leaf or tile does not exist.
    #[error("{}: no {part} {cell}: numbers must be between 0 and {last}", path.display())]
    NoSuchPart {
        /// The file.
        path: PathBuf,
        /// `leaf` or `tile`.
        part: &'static str,
        /// Requested number.
        cell: u64,
        /// Largest number.
        last: u64,
    },
    /// The bright stars cannot be read or written.
    #[error(transparent)]
    Bright(#[from] StoreError),
    /// A catalogue cannot be read.
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    /// A synthetic galaxy cannot be made.
    #[error(transparent)]
    Galaxy(#[from] GalaxyError),
    /// The work needs more memory.
    #[error(
        "{what}: {needed_mib} MiB are needed, but the limit is {limit_mib} MiB; set --memory to at least {needed_mib}MiB"
    )]
    Memory {
        /// The work.
        what: String,
        /// Needed memory, MiB.
        needed_mib: u64,
        /// Limit, MiB.
        limit_mib: u64,
    },
    /// The destination exists and is not a deep store.
    #[error("{}: exists and is not a deep store; choose another name, or remove it", path.display())]
    Occupied {
        /// The destination.
        path: PathBuf,
    },
    /// An unfinished store of other inputs is next to the destination.
    #[error("{}: an unfinished store of other inputs ({found}); remove it, or repeat the command that made it", path.display())]
    OtherJob {
        /// The unfinished store.
        path: PathBuf,
        /// Its inputs.
        found: String,
    },
    /// Another program is writing the store.
    #[error("{}: another program is writing this store", path.display())]
    Busy {
        /// The unfinished store.
        path: PathBuf,
    },
    /// A catalogue in HATS cannot be imported.
    #[error("{}: {problem}", path.display())]
    Hats {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        problem: String,
    },
    /// A part of a store was given where a whole store is needed.
    #[error(
        "{}: has only the cells {cells} of 0..{}: it is a part of a store, and the rest of the sky would be missing; `catalogue merge` joins it with the \
         other parts",
        path.display(),
        super::BUCKETS
    )]
    IsPart {
        /// The part.
        path: PathBuf,
        /// Its cells.
        cells: String,
    },
    /// A store cannot be merged with the others.
    #[error("{}: {problem}", path.display())]
    OtherPart {
        /// The store.
        path: PathBuf,
        /// Description of the problem.
        problem: String,
    },
    /// Two parts have cells in common.
    #[error("{} (cells {}) and {} (cells {}) overlap; each cell must be in exactly one part", first.0.display(), first.1, second.0.display(), second.1)]
    Overlap {
        /// A part and its cells.
        first: (PathBuf, String),
        /// The other part.
        second: (PathBuf, String),
    },
    /// Some cells are in none of the parts.
    #[error(
        "the cells {missing} of 0..{} are in none of the parts; make a part that contains them with `--cells`",
        super::BUCKETS
    )]
    Gap {
        /// Ranges of missing cells.
        missing: String,
    },
    /// No star is left to be stored.
    #[error("{}: no star is left to be stored", path.display())]
    NoStars {
        /// The destination.
        path: PathBuf,
    },
    /// A cell has more light than a composite star can hold.
    #[error(
        "cell {cell} of order {order} has {illuminance_lx:.2e} lx of stars fainter than V = {magnitude}; a composite star holds at most {:.2e} lx per \
         channel",
        super::composite::largest_lx()
    )]
    TooBright {
        /// Number of the cell, nested.
        cell: u64,
        /// Its order.
        order: u8,
        /// Limit of the plane.
        magnitude: u8,
        /// Luminance-weighted illuminance.
        illuminance_lx: f64,
    },
    /// A file cannot be exported.
    #[error("cannot write {}: {problem}", path.display())]
    Export {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        problem: String,
    },
}

impl DeepError {
    /// Converts an I/O error of a file.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> Self {
        let path = path.to_owned();
        move |source| match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull { path: path.clone() },
            _ => Self::Io { path: path.clone(), source },
        }
    }

    /// Creates the error for a damaged file.
    pub(super) fn damaged(path: &Path, problem: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), problem: problem.into() }
    }
}
