//! Bound of the folder that keeps baked atlases. Several programs may share a folder: files appear and vanish as a whole, and a file that
//! another program has removed counts as absent.
//!
//! No shader: holds files.
//!
//! No twin: holds files.

use std::{
    fs::{self, File, FileTimes, Metadata},
    io,
    path::{Path, PathBuf},
    time::SystemTime,
};

/// First letters of the names of atlases; other files of the folder are left alone.
pub(super) const PREFIX: &str = "impostors-";
/// Last letters of the names of atlases.
pub(super) const SUFFIX: &str = ".atlas";

/// Records that an atlas was used: its time of access decides which files are removed first. Mounts that keep no such times are handled,
/// because it is set explicitly.
pub(super) fn mark_used(path: &Path) {
    let times = FileTimes::new().set_accessed(SystemTime::now());
    if let Err(problem) = File::open(path).and_then(|file| file.set_times(times)) {
        tracing::debug!(file = %path.display(), %problem, "cannot record the use of the cached impostor atlas");
    }
}

/// Removes the atlases that were not used for the longest time from the folder of `kept`, until all together have at most `most_bytes`.
/// `kept` itself stays.
///
/// # Errors
///
/// The folder cannot be read, or a file cannot be removed.
pub(super) fn trim(kept: &Path, most_bytes: u64) -> io::Result<()> {
    let mut atlases = atlases(crate::files::folder_of(kept))?;
    let mut bytes: u64 = atlases.iter().map(|atlas| atlas.bytes).sum();
    atlases.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
    for atlas in atlases.iter().filter(|atlas| atlas.path != kept) {
        if bytes <= most_bytes {
            break;
        }
        present(fs::remove_file(&atlas.path))?;
        tracing::info!(file = %atlas.path.display(), "removed the impostor atlas that was not used for the longest time");
        bytes -= atlas.bytes;
    }
    Ok(())
}

struct Atlas {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

fn atlases(folder: &Path) -> io::Result<Vec<Atlas>> {
    let mut atlases = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let is_atlas = path
            .file_name()
            .and_then(|name| name.to_str())
            .is_some_and(|name| name.starts_with(PREFIX) && name.ends_with(SUFFIX));
        if !is_atlas {
            continue;
        }
        if let Some(metadata) = present(fs::symlink_metadata(&path))?.filter(Metadata::is_file) {
            let used = metadata.accessed().or_else(|_| metadata.modified())?;
            atlases.push(Atlas { path, bytes: metadata.len(), used });
        }
    }
    Ok(atlases)
}

/// The result of an operation on a file; `None` if another program has removed the file.
fn present<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use std::time::Duration;

    use super::*;

    /// A folder with atlases of 100 bytes, the first unused for the longest time, and other files.
    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (hours, name) in names.iter().rev().enumerate() {
            let path = folder.path().join(name);
            fs::write(&path, [0; 100]).unwrap();
            let used = SystemTime::now() - Duration::from_secs(3600 * (hours as u64 + 1));
            File::options().write(true).open(&path).unwrap().set_times(FileTimes::new().set_accessed(used)).unwrap();
        }
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn atlases_unused_for_the_longest_time_are_removed_first() {
        let all = ["impostors-a.atlas", "notes.atlas", "impostors-b.atlas", "impostors-c.txt", "impostors-c.atlas"];
        let folder = folder(&all);
        let path = |name: &str| folder.path().join(name);
        trim(&path("impostors-c.atlas"), 300).unwrap();
        assert_eq!(names(folder.path()).len(), 5, "three atlases of 100 bytes fit");
        // The oldest was used again.
        mark_used(&path("impostors-a.atlas"));
        trim(&path("impostors-c.atlas"), 299).unwrap();
        assert_eq!(names(folder.path()), ["impostors-a.atlas", "impostors-c.atlas", "impostors-c.txt", "notes.atlas"]);
        // The file that was just written stays, although another one was used later.
        trim(&path("impostors-c.atlas"), 0).unwrap();
        assert_eq!(names(folder.path()), ["impostors-c.atlas", "impostors-c.txt", "notes.atlas"]);
    }

    #[test]
    fn files_that_another_program_removes_are_absent_and_other_errors_are_reported() {
        let gone = || io::Error::from(io::ErrorKind::NotFound);
        assert_eq!(present::<()>(Err(gone())).unwrap(), None);
        assert!(present::<()>(Err(io::ErrorKind::PermissionDenied.into())).is_err());
        assert!(trim(Path::new("no/such/folder/impostors-a.atlas"), 1).is_err());
    }
}
