//! `film.sha256`: a checksum of every frame file, in the form that `sha256sum --check` reads.
//!
//! The first line is a comment with the digest of the film; a line for each file follows. Runs append a line under the lock of the folder before they
//! give a file its final name, so that every file has a line. At the end of a run the lines are sorted: the same files then give the same bytes,
//! regardless of the runs and shards that drew them.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::files;

/// Name of the file.
pub const NAME: &str = "film.sha256";
/// Start of the first line.
const HEAD: &str = "# film ";
/// Maximum size of the file, bytes: enough for a line for each image of a million frames.
const MOST_BYTES: u64 = 4 << 30;

/// Checksums of a film.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checksums {
    /// Digest of the film; empty if there is no file.
    pub film: String,
    /// SHA-256 by file name, hexadecimal.
    pub by_name: BTreeMap<String, String>,
}

fn path_in(folder: &Path) -> PathBuf {
    folder.join(NAME)
}

/// A line that a killed program has written only in part has no line break.
fn parse(text: &str) -> Result<Checksums, String> {
    let mut lines = text.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
    let film = lines.next().and_then(|line| line.strip_prefix(HEAD)).ok_or("it does not begin with `# film`")?;
    let mut by_name = BTreeMap::new();
    for (number, line) in (2..).zip(lines) {
        let parts = line
            .split_once("  ")
            .filter(|(sha256, _)| sha256.len() == 64 && sha256.bytes().all(|byte| byte.is_ascii_hexdigit()));
        let (sha256, name) = parts.ok_or_else(|| format!("line {number} is not a SHA-256, two blanks and a name"))?;
        // If a name has several lines, the last line is valid: it was written when the file was last drawn.
        by_name.insert(name.to_owned(), sha256.to_owned());
    }
    Ok(Checksums { film: film.to_owned(), by_name })
}

impl Checksums {
    /// Reads the checksums of a folder; `None` if it has none.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a file of checksums.
    pub fn read(folder: &Path) -> io::Result<Option<Self>> {
        match files::read_text_bounded(&path_in(folder), MOST_BYTES) {
            Ok(text) => parse(&text).map(Some).map_err(|problem| io::Error::new(io::ErrorKind::InvalidData, problem)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Replaces the checksums of a folder.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        let mut text = format!("{HEAD}{}\n", self.film);
        self.by_name.iter().for_each(|(name, sha256)| text.push_str(&line(sha256, name)));
        files::write_whole_synced(&path_in(folder), text.as_bytes())
    }
}

fn line(sha256: &str, name: &str) -> String {
    format!("{sha256}  {name}\n")
}

/// Appends the checksum of a file. The folder is locked.
pub fn append(folder: &Path, name: &str, sha256: &str) -> io::Result<()> {
    let mut file = OpenOptions::new().append(true).open(path_in(folder))?;
    // A single write: a killed program leaves at most a part of a line, which `repair_end` cuts off.
    file.write_all(line(sha256, name).as_bytes())
}

/// Cuts off the part of a line that a killed program has left. The folder is locked.
pub fn repair_end(folder: &Path) -> io::Result<()> {
    let path = path_in(folder);
    let text = files::read_text_bounded(&path, MOST_BYTES)?;
    if text.ends_with('\n') {
        return Ok(());
    }
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    files::write_whole_synced(&path, whole.as_bytes())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_appended_and_a_torn_line_is_cut_off() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Checksums::read(folder.path()).unwrap(), None);
        let mut expected = Checksums { film: "f".to_owned(), by_name: BTreeMap::new() };
        expected.write(folder.path()).unwrap();
        let [a, b, c] = ["a", "b", "c"].map(|digit| digit.repeat(64));
        append(folder.path(), "v_00001.png", &b).unwrap();
        append(folder.path(), "v_00000.png", &a).unwrap();
        append(folder.path(), "v_00001.png", &c).unwrap();
        expected.by_name = [("v_00000.png".to_owned(), a), ("v_00001.png".to_owned(), c)].into();
        assert_eq!(Checksums::read(folder.path()).unwrap(), Some(expected.clone()));
        let path = folder.path().join(NAME);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&whole[..], b"abcd"].concat()).unwrap();
        assert_eq!(Checksums::read(folder.path()).unwrap(), Some(expected.clone()));
        repair_end(folder.path()).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        expected.write(folder.path()).unwrap();
        assert_eq!(Checksums::read(folder.path()).unwrap(), Some(expected));
        for wrong in ["", "x\n", "# film f\nabc  v_00000.png\n", "# film f\nv_00000.png\n"] {
            std::fs::write(&path, wrong).unwrap();
            assert!(Checksums::read(folder.path()).is_err(), "{wrong}");
        }
    }
}
