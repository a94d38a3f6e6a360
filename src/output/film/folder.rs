//! The folder of a film. `film.json` identifies the film to which the frames belong. Frames whose files exist are not
//! drawn again.
//!
//! Several runs may work in one folder at the same time, each on different frames. They check or write `film.json` one
//! after the other, under a lock (`.film.lock`). After that, each file belongs to one run. Its checksum is first
//! recorded in `film.sha256`, then the file is written atomically.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::OutputError;
use super::super::provenance::{InputFile, UsedCatalogue, UsedConfiguration};
use super::blur::Shutter;
use super::checksums::{self, Checksums};
use super::error::FilmError;
use super::frames::{FrameRange, file_name, is_file_of};
use crate::files;

/// Maximum size of `film.json`, bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Contents of `film.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilmRecord {
    /// Version of the program.
    pub version: String,
    /// SHA-256, hexadecimal, of everything that determines the pixels: configuration with overrides, path, format,
    /// motion blur, version and adapter.
    pub digest: String,
    /// SHA-256 of the configuration with overrides.
    pub configuration_sha256: String,
    /// SHA-256 of the path.
    pub path_sha256: String,
    /// `png8`, `png16`, `exr16` or `exr32`.
    pub format: String,
    /// Extension of the files.
    pub extension: String,
    /// Adapter and driver that draw the frames.
    pub adapter: String,
    /// Motion blur.
    pub blur: String,
    /// Motion blur as numbers; `None` without it.
    #[serde(default)]
    pub shutter: Option<Shutter>,
    /// Frames per second.
    pub fps: f64,
    /// Prefixes of the file names.
    pub images: Vec<String>,
    /// The configuration.
    pub configuration: UsedConfiguration,
    /// The path, TOML.
    pub path_toml: String,
    /// Every file that the frames depend on.
    pub files: Vec<InputFile>,
    /// The files of the configuration and of the path, as they were when the film was begun. `configuration` and `path_toml` have their contents,
    /// with overrides.
    #[serde(default)]
    pub sources: Vec<InputFile>,
    /// Ranges of frames of all runs so far; empty in films of earlier versions.
    #[serde(default)]
    pub frames: Vec<FrameRange>,
    /// Load results of the catalogues; `None` until one of the runs has loaded them.
    pub catalogues: Option<Vec<UsedCatalogue>>,
}

impl FilmRecord {
    /// Describes the differences from another film.
    pub fn differences(&self, other: &Self) -> String {
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
        if names.is_empty() { "another input of the pixels".to_owned() } else { names.join(", ") }
    }
}

/// A folder that receives the frames of one film.
#[derive(Debug)]
pub struct FilmFolder {
    folder: PathBuf,
    existing: HashSet<String>,
    record: FilmRecord,
}

pub(super) fn failed(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FilmError {
    let path = path.to_owned();
    move |source| FilmError::Folder { action, path, source }
}

pub(super) fn names(folder: &Path) -> Result<HashSet<String>, FilmError> {
    let entries = fs::read_dir(folder).map_err(failed("read", folder))?;
    let name = |entry: io::Result<fs::DirEntry>| entry.map(|entry| entry.file_name().into_string().ok());
    let names = entries.map(name).collect::<io::Result<Vec<_>>>().map_err(failed("read", folder))?;
    Ok(names.into_iter().flatten().collect())
}

/// Locks the folder: until the file is dropped, only this run may change `film.json`.
fn locked(folder: &Path) -> Result<File, FilmError> {
    let path = folder.join(".film.lock");
    let lock = File::options().create(true).append(true).open(&path).map_err(failed("open", &path))?;
    lock.lock().map_err(failed("lock", &path))?;
    Ok(lock)
}

/// Reads a `film.json`; `None` if there is none, an inner error if it does not describe a film.
pub(super) fn held_record(path: &Path) -> Result<Option<serde_json::Result<FilmRecord>>, FilmError> {
    match files::read_bounded(path, MOST_BYTES) {
        Ok(bytes) => Ok(Some(serde_json::from_slice::<FilmRecord>(&bytes))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed("read", path)(error)),
    }
}

fn write_record(path: &Path, record: &FilmRecord) -> Result<(), OutputError> {
    let json = serde_json::to_vec_pretty(record);
    let json = json.map_err(|source| OutputError::Manifest { path: path.to_owned(), source })?;
    files::write_whole_synced(path, &json).map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

fn checksums_file(folder: &Path) -> PathBuf {
    folder.join(checksums::NAME)
}

/// Prepares the file of checksums. The folder is locked. The checksums of another film are dropped with its frames.
fn begin_checksums(folder: &Path, record: &FilmRecord, is_new: bool) -> Result<(), FilmError> {
    let path = checksums_file(folder);
    let new = || Checksums { film: record.digest.clone(), ..Checksums::default() };
    let write = |checksums: &Checksums| checksums.write(folder).map_err(failed("write", &path));
    if is_new {
        return write(&new());
    }
    match Checksums::read(folder).map_err(failed("read", &path))? {
        None => write(&new()),
        Some(held) if held.film == record.digest => checksums::repair_end(folder).map_err(failed("write", &path)),
        Some(held) => {
            let problem = format!("its {} belongs to the film {:.12}", checksums::NAME, held.film);
            Err(FilmError::OtherFilm { folder: folder.to_owned(), problem })
        }
    }
}

impl FilmFolder {
    /// Opens a folder for a film, and creates it if necessary. With `overwrite`, no frame counts as drawn, and the
    /// frames of another film are removed.
    ///
    /// # Errors
    ///
    /// The folder holds another film or unidentified frames, and `overwrite` is false; or it cannot be read or written.
    pub fn open(folder: &Path, record: &FilmRecord, overwrite: bool) -> Result<Self, FilmError> {
        fs::create_dir_all(folder).map_err(failed("make", folder))?;
        let _lock = locked(folder)?;
        let path = folder.join("film.json");
        let held = held_record(&path)?;
        let mut existing = names(folder)?;
        let is_ours = |name: &str| record.images.iter().any(|stem| is_file_of(name, stem, &record.extension));
        let problem = match &held {
            Some(Ok(held)) if held.digest == record.digest => None,
            Some(Ok(held)) => Some(format!("it holds another film, which differs in {}", record.differences(held))),
            Some(Err(error)) => Some(format!("its film.json does not describe a film ({error})")),
            None if existing.iter().any(|name| is_ours(name)) => {
                Some("it holds frames, but no film.json that identifies their film".to_owned())
            }
            None => None,
        };
        if let Some(problem) = problem {
            if !overwrite {
                return Err(FilmError::OtherFilm { folder: folder.to_owned(), problem });
            }
            // Frames of the other film must not be taken for frames of this one, even beyond the range of this film.
            let is_theirs = |name: &str| match &held {
                Some(Ok(held)) => held.images.iter().any(|stem| is_file_of(name, stem, &held.extension)),
                _ => false,
            };
            for name in existing.iter().filter(|name| is_ours(name) || is_theirs(name)) {
                let path = folder.join(name);
                fs::remove_file(&path).map_err(failed("remove", &path))?;
            }
            existing.clear();
        }
        // For the same film, keep the data that earlier runs have recorded, and extend the ranges of frames.
        let held = held.and_then(Result::ok).filter(|held| held.digest == record.digest);
        let joined = |held: &FilmRecord| {
            let frames = record.frames.iter().fold(held.frames.clone(), |all, range| range.joined_with(&all));
            FilmRecord { frames, ..held.clone() }
        };
        let current = held.as_ref().map_or_else(|| record.clone(), joined);
        if held.as_ref() != Some(&current) {
            write_record(&path, &current)?;
        }
        if overwrite {
            existing.clear();
        }
        begin_checksums(folder, record, held.is_none())?;
        Ok(Self { folder: folder.to_owned(), existing, record: current })
    }

    /// Records the checksum of a file that is about to get its final name.
    ///
    /// # Errors
    ///
    /// The checksums cannot be written.
    pub fn record_checksum(&self, path: &Path, bytes: &[u8]) -> Result<(), FilmError> {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let _lock = locked(&self.folder)?;
        checksums::append(&self.folder, name, &files::sha256(bytes))
            .map_err(failed("write", &checksums_file(&self.folder)))
    }

    /// Sorts the checksums, at the end of a run.
    ///
    /// # Errors
    ///
    /// They cannot be read or written.
    pub fn sort_checksums(&self) -> Result<(), FilmError> {
        let _lock = locked(&self.folder)?;
        let path = checksums_file(&self.folder);
        let sorted = Checksums::read(&self.folder).map_err(failed("read", &path))?;
        sorted.map_or(Ok(()), |sorted| sorted.write(&self.folder)).map_err(failed("write", &path))
    }

    /// Records the load results of the catalogues, unless another run has done so.
    ///
    /// # Errors
    ///
    /// `film.json` cannot be read or written.
    pub fn record_catalogues(&self, catalogues: Vec<UsedCatalogue>) -> Result<(), FilmError> {
        let _lock = locked(&self.folder)?;
        let path = self.folder.join("film.json");
        // If another run has replaced the record in the meantime, that run records the results.
        let held = held_record(&path)?.and_then(Result::ok);
        let held = held.filter(|held| held.digest == self.record.digest && held.catalogues.is_none());
        if let Some(held) = held {
            write_record(&path, &FilmRecord { catalogues: Some(catalogues), ..held })?;
        }
        Ok(())
    }

    /// Whether all files of a frame existed when the folder was opened.
    pub fn has(&self, frame: u32) -> bool {
        let FilmRecord { images, extension, .. } = &self.record;
        images.iter().all(|stem| self.existing.contains(&file_name(stem, frame, extension)))
    }

    /// Returns the file of an image of a frame.
    pub fn file(&self, image: usize, frame: u32) -> PathBuf {
        self.folder.join(file_name(&self.record.images[image], frame, &self.record.extension))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
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
            shutter: None,
            fps: 30.0,
            images: vec!["eyes.left".to_owned(), "eyes.right".to_owned()],
            configuration: UsedConfiguration { folder: "/skies".into(), toml: String::new() },
            path_toml: String::new(),
            files: vec![InputFile { file: "a.csv".to_owned(), bytes: 3, sha256: digest.to_owned() }],
            sources: Vec::new(),
            frames: Vec::new(),
            catalogues: None,
        }
    }

    #[test]
    fn complete_frames_count_as_drawn_and_other_films_are_refused_or_replaced() {
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
        assert!(!open("one", true).unwrap().has(0), "all frames are drawn again");
        assert!(folder.join("eyes.left_00000.png").exists());

        // Ranges of frames grow, and checksums are kept and sorted.
        let range = |text: &str| FilmRecord { frames: vec![text.parse().unwrap()], ..record("one") };
        let opened = |text: &str| FilmFolder::open(&folder, &range(text), false).unwrap();
        for name in ["b.png", "a.png"] {
            opened("6..9").record_checksum(&folder.join(name), b"x").unwrap();
        }
        assert_eq!(opened("0..3").record.frames, ["0..3", "6..9"].map(|text| text.parse().unwrap()));
        held.sort_checksums().unwrap();
        let checksums = Checksums::read(&folder).unwrap().unwrap();
        assert_eq!((checksums.film.as_str(), checksums.by_name.len()), ("one", 2));
        Checksums { film: "two".to_owned(), ..checksums.clone() }.write(&folder).unwrap();
        assert!(open("one", false).unwrap_err().to_string().contains("belongs to the film two"));
        checksums.write(&folder).unwrap();

        let message = open("two", false).unwrap_err().to_string();
        assert!(message.contains("configuration") && message.contains("--overwrite"), "{message}");
        assert!(message.contains("the contents of a.csv"), "{message}");
        let replaced = open("two", true).unwrap();
        assert!(!replaced.has(0) && !folder.join("eyes.left_00000.png").exists());
        assert!(folder.join("notes.png").exists(), "other files remain");
        let held = open("two", false).unwrap();
        let used = |stars| {
            vec![UsedCatalogue { name: "a".to_owned(), stars, rejected_rows: None, first_rejected: Vec::new() }]
        };
        held.record_catalogues(used(7)).unwrap();
        held.record_catalogues(used(8)).unwrap();
        open("two", false).unwrap();
        let json = fs::read_to_string(folder.join("film.json")).unwrap();
        assert_eq!(
            serde_json::from_str::<FilmRecord>(&json).unwrap().catalogues,
            Some(used(7)),
            "the first record remains"
        );

        write("eyes.left_00000.png");
        fs::remove_file(folder.join("film.json")).unwrap();
        assert!(open("two", false).unwrap_err().to_string().contains("no film.json"));
        write("film.json");
        assert!(open("two", false).unwrap_err().to_string().contains("film.json"));
        open("two", true).unwrap();
    }
}
