//! The folder of a film: `film.json` says which film its frames belong to, and files that are there need not be drawn again.
//!
//! Several runs may work in one folder at the same time, each on its frames. They agree on `film.json` one after the other, under a lock
//! (`.film.lock`); after that each file is one run's alone, and appears whole or not at all.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::OutputError;
use super::super::provenance::{InputFile, UsedCatalogue, UsedConfiguration};
use super::error::FilmError;
use super::frames::{file_name, is_file_of};
use crate::files;

/// Bytes of `film.json`, at most.
const MOST_BYTES: u64 = 256 << 20;

/// What `film.json` holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilmRecord {
    /// Version of the program.
    pub version: String,
    /// Of all that determines the pixels: configuration with overrides, path, format, motion blur, version and adapter; SHA-256, hexadecimal.
    pub digest: String,
    /// Digest of the configuration with overrides alone.
    pub configuration_sha256: String,
    /// Digest of the path alone.
    pub path_sha256: String,
    /// `png8`, `png16`, `exr16` or `exr32`.
    pub format: String,
    /// Of the files.
    pub extension: String,
    /// Adapter and driver that draw the frames.
    pub adapter: String,
    /// Motion blur.
    pub blur: String,
    /// Frames per second.
    pub fps: f64,
    /// What the names of the files begin with.
    pub images: Vec<String>,
    /// The configuration itself.
    pub configuration: UsedConfiguration,
    /// The path itself, TOML.
    pub path_toml: String,
    /// Every file that the frames depend on.
    pub files: Vec<InputFile>,
    /// What became of the catalogues; `None` before one of the runs has loaded them.
    pub catalogues: Option<Vec<UsedCatalogue>>,
}

impl FilmRecord {
    /// In what another film differs.
    fn differences(&self, other: &Self) -> String {
        let others = other.files.iter().filter(|file| !self.files.contains(file));
        let changed = self.files.iter().filter(|file| !other.files.contains(file)).chain(others);
        let mut changed: Vec<&str> = changed.map(|file| file.file.as_str()).collect();
        changed.sort_unstable();
        changed.dedup();
        let contents = format!("the contents of {}", changed.join(" and "));
        let named = [
            (contents.as_str(), !changed.is_empty()),
            ("the configuration or its overrides", self.configuration_sha256 != other.configuration_sha256),
            ("the path", self.path_sha256 != other.path_sha256),
            ("the format", self.format != other.format),
            ("the version of the program", self.version != other.version),
            ("the motion blur", self.blur != other.blur),
            ("the adapter or its driver", self.adapter != other.adapter),
        ];
        let names: Vec<&str> = named.into_iter().filter(|(_, differs)| *differs).map(|(name, _)| name).collect();
        if names.is_empty() { "what determines the pixels".to_owned() } else { names.join(", ") }
    }
}

/// A folder that takes the frames of one film.
#[derive(Debug)]
pub struct FilmFolder {
    folder: PathBuf,
    there: HashSet<String>,
    record: FilmRecord,
}

fn failed(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FilmError {
    let path = path.to_owned();
    move |source| FilmError::Folder { what, path, source }
}

fn names(folder: &Path) -> Result<HashSet<String>, FilmError> {
    let entries = fs::read_dir(folder).map_err(failed("read", folder))?;
    let name = |entry: io::Result<fs::DirEntry>| entry.map(|entry| entry.file_name().into_string().ok());
    let names = entries.map(name).collect::<io::Result<Vec<_>>>().map_err(failed("read", folder))?;
    Ok(names.into_iter().flatten().collect())
}

/// Until it is dropped, `film.json` is this run's alone.
fn locked(folder: &Path) -> Result<File, FilmError> {
    let path = folder.join(".film.lock");
    let lock = File::options().create(true).append(true).open(&path).map_err(failed("open", &path))?;
    lock.lock().map_err(failed("lock", &path))?;
    Ok(lock)
}

fn write_record(path: &Path, record: &FilmRecord) -> Result<(), OutputError> {
    let json = serde_json::to_vec_pretty(record);
    let json = json.map_err(|source| OutputError::Manifest { path: path.to_owned(), source })?;
    files::write_whole_synced(path, &json).map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

impl FilmFolder {
    /// Opens a folder for a film, and makes it where it is not there. With `overwrite` no frame counts as drawn, and the frames of another film are
    /// removed.
    ///
    /// # Errors
    ///
    /// It holds another film, or frames of which nobody says what they are of, and `overwrite` is false; or it cannot be read or written.
    pub fn open(folder: &Path, record: &FilmRecord, overwrite: bool) -> Result<Self, FilmError> {
        fs::create_dir_all(folder).map_err(failed("make", folder))?;
        let _lock = locked(folder)?;
        let path = folder.join("film.json");
        let held = match files::read_bounded(&path, MOST_BYTES) {
            Ok(bytes) => Some(serde_json::from_slice::<FilmRecord>(&bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(failed("read", &path)(error)),
        };
        let mut there = names(folder)?;
        let is_ours = |name: &str| record.images.iter().any(|stem| is_file_of(name, stem, &record.extension));
        let problem = match &held {
            Some(Ok(held)) if held.digest == record.digest => None,
            Some(Ok(held)) => Some(format!("it holds another film, which differs in {}", record.differences(held))),
            Some(Err(error)) => Some(format!("its film.json is not that of a film ({error})")),
            None if there.iter().any(|name| is_ours(name)) => {
                Some("it holds frames, but no film.json that says of which film".to_owned())
            }
            None => None,
        };
        if let Some(problem) = problem {
            if !overwrite {
                return Err(FilmError::OtherFilm { folder: folder.to_owned(), problem });
            }
            // Frames of the other film must not be taken for ours, however long ours is.
            let is_theirs = |name: &str| match &held {
                Some(Ok(held)) => held.images.iter().any(|stem| is_file_of(name, stem, &held.extension)),
                _ => false,
            };
            for name in there.iter().filter(|name| is_ours(name) || is_theirs(name)) {
                let path = folder.join(name);
                fs::remove_file(&path).map_err(failed("remove", &path))?;
            }
            there.clear();
        }
        let is_told = matches!(&held, Some(Ok(held)) if held.digest == record.digest);
        if !is_told {
            write_record(&path, record)?;
        }
        if overwrite {
            there.clear();
        }
        Ok(Self { folder: folder.to_owned(), there, record: record.clone() })
    }

    /// Tells what became of the catalogues, where no run has yet.
    ///
    /// # Errors
    ///
    /// `film.json` cannot be read or written.
    pub fn tell_catalogues(&self, catalogues: Vec<UsedCatalogue>) -> Result<(), FilmError> {
        let _lock = locked(&self.folder)?;
        let path = self.folder.join("film.json");
        let bytes = files::read_bounded(&path, MOST_BYTES).map_err(failed("read", &path))?;
        // Another run may have replaced it since: then it is that one's to tell.
        let is_untold = serde_json::from_slice::<FilmRecord>(&bytes)
            .is_ok_and(|held| held.digest == self.record.digest && held.catalogues.is_none());
        if is_untold {
            write_record(&path, &FilmRecord { catalogues: Some(catalogues), ..self.record.clone() })?;
        }
        Ok(())
    }

    /// Whether all files of a frame were there when the folder was opened.
    pub fn has(&self, frame: u32) -> bool {
        let FilmRecord { images, extension, .. } = &self.record;
        images.iter().all(|stem| self.there.contains(&file_name(stem, frame, extension)))
    }

    /// The frame's file of an image.
    pub fn file(&self, image: usize, frame: u32) -> PathBuf {
        self.folder.join(file_name(&self.record.images[image], frame, &self.record.extension))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    fn record(digest: &str) -> FilmRecord {
        FilmRecord {
            version: "1".to_owned(),
            digest: digest.to_owned(),
            configuration_sha256: digest.to_owned(),
            path_sha256: "p".to_owned(),
            format: "png8".to_owned(),
            extension: "png".to_owned(),
            adapter: "a".to_owned(),
            blur: "none".to_owned(),
            fps: 30.0,
            images: vec!["eyes.left".to_owned(), "eyes.right".to_owned()],
            configuration: UsedConfiguration { folder: "/skies".into(), toml: String::new() },
            path_toml: String::new(),
            files: vec![InputFile { file: "a.csv".to_owned(), bytes: 3, sha256: digest.to_owned() }],
            catalogues: None,
        }
    }

    #[test]
    fn frames_count_where_all_their_files_are_there_and_other_films_are_refused_or_replaced() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = temporary.path().join("film");
        let open = |digest, overwrite| FilmFolder::open(&folder, &record(digest), overwrite);
        assert!(!open("one", false).unwrap().has(0));
        let write = |name: &str| fs::write(folder.join(name), "x").unwrap();
        for name in ["eyes.left_00000.png", "eyes.right_00000.png", "eyes.left_00001.png", "notes.png"] {
            write(name);
        }
        let held = open("one", false).unwrap();
        assert_eq!([0, 1, 2].map(|frame| held.has(frame)), [true, false, false]);
        assert!(!open("one", true).unwrap().has(0), "all of them are drawn again");
        assert!(folder.join("eyes.left_00000.png").exists());

        let message = open("two", false).unwrap_err().to_string();
        assert!(message.contains("configuration") && message.contains("--overwrite"), "{message}");
        assert!(message.contains("the contents of a.csv"), "{message}");
        let replaced = open("two", true).unwrap();
        assert!(!replaced.has(0) && !folder.join("eyes.left_00000.png").exists());
        assert!(folder.join("notes.png").exists(), "what is no frame stays");
        let held = open("two", false).unwrap();
        let told = |stars| {
            vec![UsedCatalogue { name: "a".to_owned(), stars, rejected_rows: None, first_rejected: Vec::new() }]
        };
        held.tell_catalogues(told(7)).unwrap();
        held.tell_catalogues(told(8)).unwrap();
        open("two", false).unwrap();
        let json = fs::read_to_string(folder.join("film.json")).unwrap();
        assert_eq!(serde_json::from_str::<FilmRecord>(&json).unwrap().catalogues, Some(told(7)), "the first one stays");

        write("eyes.left_00000.png");
        fs::remove_file(folder.join("film.json")).unwrap();
        assert!(open("two", false).unwrap_err().to_string().contains("no film.json"));
        write("film.json");
        assert!(open("two", false).unwrap_err().to_string().contains("film.json"));
        open("two", true).unwrap();
    }
}
