//! Identity of files.

use std::{io, os::unix::fs::MetadataExt as _, path::Path};

/// Returns the numbers of the device and of the file that a path leads to. A different file has different numbers, even under the same name.
///
/// # Errors
///
/// The path does not exist, or its file cannot be examined.
pub(crate) fn identity(path: &Path) -> io::Result<[u64; 2]> {
    let found = std::fs::metadata(path)?;
    Ok([found.dev(), found.ino()])
}
