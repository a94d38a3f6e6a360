//! The file in which a node stores the epoch that it has promised. The epoch is on disk before the node votes.

use std::{
    fs::{self, File},
    io::{self, ErrorKind, Write},
    path::Path,
};

use steradian_lock::messages::Epoch;

/// Reads the promised epoch. If there is no file, no epoch has been promised.
///
/// # Errors
///
/// The file cannot be read, or is damaged: the node must not vote.
pub(super) fn read(path: &Path) -> Result<Epoch, String> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Epoch::NONE),
        Err(error) => return Err(format!("cluster.epochs: {}: {error}", path.display())),
    };
    let numbers: Vec<u64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let words = text.split_whitespace().count();
    match (&numbers[..], text.ends_with('\n')) {
        (&[counter, run], true) if words == 2 => Ok(Epoch { counter, run }),
        _ => Err(format!(
            "cluster.epochs: {}: the file is damaged; remove it only while no director runs, then restart all",
            path.display()
        )),
    }
}

/// Writes the promised epoch, and waits for the disk.
///
/// # Errors
///
/// The file cannot be written.
pub(super) fn write(path: &Path, epoch: Epoch) -> Result<(), String> {
    let save = || -> io::Result<()> {
        let folder = path.parent().unwrap_or(Path::new(""));
        fs::create_dir_all(folder)?;
        let new = path.with_extension("new");
        let mut file = File::create(&new)?;
        file.write_all(format!("{} {}\n", epoch.counter, epoch.run).as_bytes())?;
        file.sync_all()?;
        fs::rename(&new, path)?;
        // On systems where a folder cannot be opened, the rename is on disk with the next flush of the file system.
        File::open(folder).and_then(|folder| folder.sync_all()).or(Ok(()))
    };
    save().map_err(|error| format!("cluster.epochs: {}: {error}; the node must not vote", path.display()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_is_read_as_written_and_a_damaged_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("epochs").join("left.epoch");
        assert_eq!(read(&path), Ok(Epoch::NONE));
        let epoch = Epoch { counter: 3, run: u64::MAX };
        write(&path, epoch).unwrap();
        assert_eq!(read(&path), Ok(epoch));
        for damaged in ["", "3", "3 5", "3 x\n", "3 5 6\n"] {
            fs::write(&path, damaged).unwrap();
            assert!(read(&path).is_err(), "{damaged}");
        }
    }
}
