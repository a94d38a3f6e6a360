//! Identity of files.

use std::{io, path::Path};

/// Returns the same value for all existing files: on this system an open file keeps its name.
///
/// # Errors
///
/// The path does not exist, or its file cannot be examined.
pub(crate) fn identity(path: &Path) -> io::Result<[u64; 2]> {
    std::fs::metadata(path).map(|_| [0, 0])
}
