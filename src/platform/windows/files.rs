//! Identity of files.

use std::{io, path::Path};

/// The same for all files that exist: an open file keeps its name on this system.
///
/// # Errors
///
/// The path leads to nothing, or to what cannot be examined.
pub(crate) fn identity(path: &Path) -> io::Result<[u64; 2]> {
    std::fs::metadata(path).map(|_| [0, 0])
}
