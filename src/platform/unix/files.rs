//! Identity of files.

use std::{io, os::unix::fs::MetadataExt as _, path::Path};

/// Numbers of the device and of the file that a path leads to: another file has others, also under the same name.
///
/// # Errors
///
/// The path leads to nothing, or to what cannot be examined.
pub(crate) fn identity(path: &Path) -> io::Result<[u64; 2]> {
    let found = std::fs::metadata(path)?;
    Ok([found.dev(), found.ino()])
}
