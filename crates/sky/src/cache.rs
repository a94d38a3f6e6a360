//! Content that takes a long time to make, kept on disk between runs: synthetic stars, tables and blends of projectors, atlases of asteroids.
//!
//! An entry is one file. Its name and its header hold a SHA-256 of the part of the program that makes it, of that part's version and of all inputs.
//! So an entry is used only if making the content again would give the same. If an entry is damaged, its content is made again. Several programs may
//! share a folder: a file appears only when it is complete, and a file that another program has removed counts as absent. When all entries together
//! exceed the size limit, those that were not used for the longest time are removed.
//!
//! The program sets its cache at the start ([`set_for_process`]). Without one nothing is kept; the results are the same.

use std::{
    fs::{self, File, FileTimes, Metadata},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{
        Arc, PoisonError, RwLock,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::SystemTime,
};

use bytemuck::{AnyBitPattern, Pod, Zeroable};
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::files;

/// Suffix of the names of entries; other files in the folder are left alone.
const SUFFIX: &str = ".kept";
const MAGIC: [u8; 8] = *b"STERKEPT";

/// Whether this process has warned that an entry cannot be kept.
static WARNED: AtomicBool = AtomicBool::new(false);

static OF_PROCESS: RwLock<Option<Arc<Cache>>> = RwLock::new(None);

/// Sets the cache that [`kept_or_made`] uses in this process; `None`: nothing is kept.
pub fn set_for_process(cache: Option<Cache>) {
    // No code panics while it holds the lock, so the content is consistent even if the lock is poisoned.
    *OF_PROCESS.write().unwrap_or_else(PoisonError::into_inner) = cache.map(Arc::new);
}

/// Returns the content for these inputs: reads it from the cache of the process, or makes it now and keeps it. See [`Cache::kept_or_made`].
///
/// # Errors
///
/// That of `make`.
pub fn kept_or_made<T, E>(
    part: Part,
    inputs: &[&[u8]],
    form: Form<T>,
    make: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let cache = OF_PROCESS.read().unwrap_or_else(PoisonError::into_inner).clone();
    match cache {
        Some(cache) => cache.kept_or_made(part, inputs, form, make),
        None => make(),
    }
}

/// A part of the program that makes content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name in lower-case letters and hyphens. It is the first part of the names of files.
    pub name: &'static str,
    /// Increase it whenever the same inputs give other content than before.
    pub version: u32,
}

/// Encoding of some content on disk.
#[derive(Clone, Copy)]
pub struct Form<T> {
    /// Encodes some content as bytes.
    pub to_bytes: fn(&T) -> Vec<u8>,
    /// Decodes the content from bytes; `None` if they are not valid.
    pub from_bytes: fn(&[u8]) -> Option<T>,
}

/// Reads values one after the other; `None` if bytes are left over.
pub fn values<T: AnyBitPattern>(bytes: &[u8]) -> Option<Vec<T>> {
    let values = bytes.chunks_exact(size_of::<T>());
    values.remainder().is_empty().then(|| values.map(bytemuck::pod_read_unaligned).collect())
}

/// A folder of entries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cache {
    /// The folder; created when the first entry is kept.
    pub folder: PathBuf,
    /// Size limit of all entries together, bytes.
    pub most_bytes: u64,
}

/// An entry of a cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The file.
    pub path: PathBuf,
    /// Name of the part that made it.
    pub part: String,
    /// Size of the file.
    pub bytes: u64,
    /// When it was last used.
    pub used: SystemTime,
}

/// Reason why an entry cannot be used.
#[derive(Debug, Error)]
enum EntryError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("{found} bytes long, not {expected}")]
    Length { found: u64, expected: u64 },
    #[error("checksum mismatch")]
    Checksum,
    #[error("the header belongs to other content")]
    Header,
    #[error("the content is not valid")]
    Content,
}

/// The first bytes of a file, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    key: [u8; 32],
    bytes: u64,
    crc32: u32,
    reserved: u32,
}

const _: () = assert!(cfg!(target_endian = "little"), "entries are little-endian and read without conversion");

impl Cache {
    /// Returns the content that a part makes from these inputs: reads it from the cache, or makes it now and keeps it. Problems with files are logged
    /// and do not change the result.
    ///
    /// # Errors
    ///
    /// The error of `make`; in this case nothing is kept.
    pub fn kept_or_made<T, E>(
        &self,
        part: Part,
        inputs: &[&[u8]],
        form: Form<T>,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let key = key(part, inputs);
        let path = self.path(part, &key);
        let read = read(&path, &key).and_then(|bytes| match bytes {
            Some(bytes) => (form.from_bytes)(&bytes).map(Some).ok_or(EntryError::Content),
            None => Ok(None),
        });
        match read {
            Ok(Some(content)) => {
                mark_used(&path);
                return Ok(content);
            }
            Ok(None) => {}
            Err(problem) => {
                tracing::warn!(file = %path.display(), %problem, "cannot use the cached {}; making it again", part.name)
            }
        }
        let content = make()?;
        let bytes = (form.to_bytes)(&content);
        if bytes.len() as u64 > self.most_bytes / 2 {
            tracing::info!(
                bytes = bytes.len(),
                limit = self.most_bytes,
                "the {} is larger than half the size limit of the cache and is not kept",
                part.name
            );
        } else if let Err(problem) = self.keep(&path, &key, &bytes) {
            // Other entries will most likely fail for the same reason, so one warning is enough.
            if WARNED.swap(true, Relaxed) {
                tracing::debug!(file = %path.display(), %problem, "cannot keep the {} in the cache", part.name);
            } else {
                tracing::warn!(file = %path.display(), %problem, "cannot keep the {} in the cache", part.name);
            }
        }
        Ok(content)
    }

    /// All entries, in no particular order; none if the folder does not exist.
    ///
    /// # Errors
    ///
    /// The folder cannot be read.
    pub fn entries(&self) -> io::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        let Some(folder) = present(fs::read_dir(&self.folder))? else { return Ok(entries) };
        for entry in folder {
            let path = entry?.path();
            let Some(part) = path.file_name().and_then(|name| name.to_str()).and_then(part_of) else { continue };
            if let Some(metadata) = present(fs::symlink_metadata(&path))?.filter(Metadata::is_file) {
                let used = metadata.accessed().or_else(|_| metadata.modified())?;
                entries.push(Entry { part: part.to_owned(), path, bytes: metadata.len(), used });
            }
        }
        Ok(entries)
    }

    /// Removes all entries and returns them. Other files of the folder stay.
    ///
    /// # Errors
    ///
    /// The folder cannot be read, or a file cannot be removed.
    pub fn clear(&self) -> io::Result<Vec<Entry>> {
        let entries = self.entries()?;
        for entry in &entries {
            present(fs::remove_file(&entry.path))?;
        }
        Ok(entries)
    }

    fn path(&self, part: Part, key: &[u8; 32]) -> PathBuf {
        let key: String = key[..16].iter().map(|byte| format!("{byte:02x}")).collect();
        self.folder.join(format!("{}-{key}{SUFFIX}", part.name))
    }

    fn keep(&self, path: &Path, key: &[u8; 32], bytes: &[u8]) -> io::Result<()> {
        fs::create_dir_all(&self.folder)?;
        let header =
            Header { magic: MAGIC, key: *key, bytes: bytes.len() as u64, crc32: crc32fast::hash(bytes), reserved: 0 };
        let mut file = files::beside(path)?;
        file.write_all(bytemuck::bytes_of(&header))?;
        file.write_all(bytes)?;
        files::publish(file, path)?;
        self.trim(path)
    }

    /// Removes the entries that were not used for the longest time, until all fit into the size limit. `kept` itself stays.
    fn trim(&self, kept: &Path) -> io::Result<()> {
        let mut entries = self.entries()?;
        let mut bytes: u64 = entries.iter().map(|entry| entry.bytes).sum();
        entries.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        for entry in entries.iter().filter(|entry| entry.path != kept) {
            if bytes <= self.most_bytes {
                break;
            }
            present(fs::remove_file(&entry.path))?;
            tracing::info!(file = %entry.path.display(), "removed the cached {} that was not used for the longest time", entry.part);
            bytes -= entry.bytes;
        }
        Ok(())
    }
}

/// Identifies what a part makes from some inputs.
pub type Key = [u8; 32];

/// Digest of a part, its version and its inputs, each with its length.
pub fn key(part: Part, inputs: &[&[u8]]) -> Key {
    let mut digest = Sha256::new();
    let version = part.version.to_le_bytes();
    for input in [part.name.as_bytes(), &version].iter().chain(inputs) {
        digest.update((input.len() as u64).to_le_bytes());
        digest.update(input);
    }
    digest.finalize().into()
}

/// The part that made an entry, taken from the name of its file; `None` if the file is not an entry.
fn part_of(name: &str) -> Option<&str> {
    let (part, key) = name.strip_suffix(SUFFIX)?.rsplit_once('-')?;
    (!part.is_empty() && key.len() == 32 && key.bytes().all(|byte| byte.is_ascii_hexdigit())).then_some(part)
}

/// Reads an entry; `None` if the file does not exist.
fn read(path: &Path, key: &[u8; 32]) -> Result<Option<Vec<u8>>, EntryError> {
    let Some(length) = present(fs::metadata(path))?.map(|metadata| metadata.len()) else { return Ok(None) };
    let Some(mut bytes) = present(files::read_bounded(path, length))? else { return Ok(None) };
    if bytes.len() < size_of::<Header>() {
        return Err(EntryError::Length { found: bytes.len() as u64, expected: size_of::<Header>() as u64 });
    }
    let content = bytes.split_off(size_of::<Header>());
    let header: Header = bytemuck::pod_read_unaligned(&bytes);
    if header.magic != MAGIC || header.key != *key {
        return Err(EntryError::Header);
    }
    if header.bytes != content.len() as u64 {
        return Err(EntryError::Length { found: content.len() as u64, expected: header.bytes });
    }
    if header.crc32 != crc32fast::hash(&content) {
        return Err(EntryError::Checksum);
    }
    Ok(Some(content))
}

/// Records that an entry was used: its time of access decides which files are removed first. The time is set explicitly, because some mounts do not
/// record it.
fn mark_used(path: &Path) {
    let times = FileTimes::new().set_accessed(SystemTime::now());
    // Some systems set times only of files that are open for writing.
    if let Err(problem) = File::options().write(true).open(path).and_then(|file| file.set_times(times)) {
        tracing::debug!(file = %path.display(), %problem, "cannot record the use of a cached file");
    }
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
    use std::{cell::Cell, convert::Infallible, time::Duration};

    use super::*;

    const PART: Part = Part { name: "some-stars", version: 3 };
    const FORM: Form<Vec<u8>> =
        Form { to_bytes: Vec::clone, from_bytes: |bytes| (bytes != b"bad").then(|| bytes.to_vec()) };

    /// Returns a cache, and a function that returns the content for an input and whether it was made.
    fn cache(most_bytes: u64) -> (tempfile::TempDir, Cache) {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache { folder: folder.path().join("cache"), most_bytes };
        (folder, cache)
    }

    fn content(cache: &Cache, part: Part, inputs: &[&[u8]], content: &[u8]) -> (Vec<u8>, bool) {
        let made = Cell::new(false);
        let make = || {
            made.set(true);
            Ok::<_, Infallible>(content.to_vec())
        };
        let Ok(content) = cache.kept_or_made(part, inputs, FORM, make);
        (content, made.get())
    }

    #[test]
    fn content_is_made_once_for_a_part_its_version_and_its_inputs() {
        let (_folder, cache) = cache(10_000);
        assert_eq!(cache.entries().unwrap(), [], "the folder does not exist");
        assert_eq!(content(&cache, PART, &[b"1", b"2"], b"first"), (b"first".to_vec(), true));
        assert_eq!(content(&cache, PART, &[b"1", b"2"], b"other"), (b"first".to_vec(), false));
        for (part, inputs) in [
            (PART, &[&b"12"[..]][..]),
            (PART, &[b"1", b"3"]),
            (Part { version: 4, ..PART }, &[b"1", b"2"]),
            (Part { name: "stars", ..PART }, &[b"1", b"2"]),
        ] {
            assert_eq!(content(&cache, part, inputs, b"other"), (b"other".to_vec(), true), "{part:?} {inputs:?}");
        }
        let parts: Vec<String> = cache.entries().unwrap().into_iter().map(|entry| entry.part).collect();
        assert_eq!(parts.iter().filter(|part| *part == "some-stars").count(), 4);
        assert_eq!(parts.len(), 5);
    }

    #[test]
    fn what_cannot_be_made_is_not_kept() {
        let (_folder, cache) = cache(10_000);
        assert_eq!(cache.kept_or_made(PART, &[], FORM, || Err("no stars")), Err("no stars"));
        assert_eq!(cache.entries().unwrap(), []);
    }

    #[test]
    fn damaged_entries_are_made_anew() {
        let (_folder, cache) = cache(10_000);
        content(&cache, PART, &[], b"the content");
        let path = cache.entries().unwrap()[0].path.clone();
        let valid = fs::read(&path).unwrap();
        let flipped = |at: usize| {
            let mut bytes = valid.clone();
            bytes[at] ^= 1;
            bytes
        };
        let checked = size_of::<Header>() - 4;
        let broken =
            (0..checked).chain(checked + 4..valid.len()).map(flipped).chain([Vec::new(), valid[..60].to_vec()]);
        for broken in broken {
            fs::write(&path, &broken).unwrap();
            assert_eq!(content(&cache, PART, &[], b"the content"), (b"the content".to_vec(), true), "{broken:?}");
            assert_eq!(fs::read(&path).unwrap(), valid);
        }
        // The bytes are those that were written, but they are not valid content.
        content(&cache, PART, &[b"1"], b"bad");
        assert_eq!(content(&cache, PART, &[b"1"], b"good"), (b"good".to_vec(), true));
    }

    #[test]
    fn entries_unused_for_the_longest_time_are_removed_first() {
        let size = 100 + size_of::<Header>() as u64;
        let (_folder, cache) = cache(3 * size);
        fs::create_dir_all(&cache.folder).unwrap();
        let others = ["notes.txt", "stars-1.kept", "0123456789abcdef0123456789abcdef.kept"];
        others.iter().for_each(|name| fs::write(cache.folder.join(name), [0; 500]).unwrap());
        let of = |input: u8| content(&cache, PART, &[&[input]], &[input; 100]).1;
        for (input, hours) in [(1, 3), (2, 2), (3, 1)] {
            assert!(of(input));
            let path = cache.path(PART, &key(PART, &[&[input]]));
            let used = SystemTime::now() - Duration::from_secs(3600 * hours);
            File::options().write(true).open(path).unwrap().set_times(FileTimes::new().set_accessed(used)).unwrap();
        }
        assert!(!of(1), "used again");
        assert!(of(4));
        assert!(!of(1) && !of(3) && !of(4));
        assert!(of(2), "it was removed");
        // Content larger than half the limit is not kept.
        assert!(content(&cache, PART, &[b"large"], &[0; 400]).1);
        assert!(content(&cache, PART, &[b"large"], &[0; 400]).1);
        let removed = cache.clear().unwrap();
        assert_eq!((removed.len(), removed.iter().map(|entry| entry.bytes).sum()), (3, 3 * size));
        assert_eq!(fs::read_dir(&cache.folder).unwrap().count(), others.len());
        assert_eq!(cache.clear().unwrap(), []);
    }

    #[test]
    fn files_that_another_program_removes_are_absent_and_other_errors_are_reported() {
        let gone = || io::Error::from(io::ErrorKind::NotFound);
        assert_eq!(present::<()>(Err(gone())).unwrap(), None);
        assert!(present::<()>(Err(io::ErrorKind::PermissionDenied.into())).is_err());
        let file = tempfile::NamedTempFile::new().unwrap();
        let cache = Cache { folder: file.path().to_owned(), most_bytes: 100 };
        assert!(cache.entries().is_err(), "the folder is a file");
        assert_eq!(content(&cache, PART, &[], b"made"), (b"made".to_vec(), true), "and the content is made");
    }
}
