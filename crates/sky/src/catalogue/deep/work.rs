//! The working folder of an unfinished store, from which the finished store is moved to its destination.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::error::DeepError;
use super::is_deep_store;

/// Name of the folder of the unfinished store in the working folder.
pub const STORE: &str = "store";

/// Returns the working folder of a store.
pub fn unfinished_folder(out: &Path) -> PathBuf {
    with_suffix(out, ".partial")
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    // `components` drops a separator at the end of the path.
    let mut name: std::ffi::OsString = path.components().collect::<PathBuf>().into_os_string();
    name.push(suffix);
    name.into()
}

/// Creates the working folder if it does not exist, and locks it: no other program uses it until the returned file is dropped.
///
/// # Errors
/// The destination exists and is not a deep store, the folder is in use, or I/O fails.
pub fn begin(out: &Path) -> Result<(PathBuf, File), DeepError> {
    if out.exists() && !is_deep_store(out) {
        return Err(DeepError::Occupied { path: out.to_owned() });
    }
    let folder = unfinished_folder(out);
    fs::create_dir_all(&folder).map_err(DeepError::io(&folder))?;
    let lock_path = folder.join("lock");
    let lock = File::create(&lock_path).map_err(DeepError::io(&lock_path))?;
    match lock.try_lock() {
        Ok(()) => Ok((folder, lock)),
        Err(fs::TryLockError::WouldBlock) => Err(DeepError::Busy { path: folder }),
        Err(fs::TryLockError::Error(error)) => Err(DeepError::io(&lock_path)(error)),
    }
}

/// Moves the finished store to its destination, and removes the working folder. An older store is replaced.
pub fn publish(folder: &Path, out: &Path) -> Result<(), DeepError> {
    let old = with_suffix(out, ".old");
    if out.exists() {
        fs::rename(out, &old).map_err(DeepError::io(out))?;
    }
    fs::rename(folder.join(STORE), out).map_err(DeepError::io(out))?;
    for rest in [folder, &old] {
        if rest.exists() {
            fs::remove_dir_all(rest).map_err(DeepError::io(rest))?;
        }
    }
    Ok(())
}
