//! The redb database of a state file: opened, kept in its place, read and written.

use std::{
    panic::AssertUnwindSafe,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use prost::Message;
use redb::{Database, DatabaseError, ReadableDatabase, ReadableTable, StorageError, TableDefinition};

use super::saved::Saved;
use crate::{
    platform::files,
    scene::Camera,
    service::{proto, wire::camera},
};

/// The current state, under the names below.
const STATE: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("state");
/// Snapshots by name.
const SNAPSHOTS: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("snapshots");
const FORMAT: &str = "format";
const SHOWN: &str = "shown";
const CAMERA: &str = "camera";
/// Format version. It grows with every change of the stored data, so that an older program cannot drop data that it does not know.
const VERSION: u8 = 5;
/// Older versions that are still read; such files are then written in the current version. Version 1 has no views of clients, version 2 has no
/// observer, versions up to 3 have the settings of views as TOML text, and version 4 has no pictures. Missing values come from the configuration.
const OLDER: [u8; 4] = [1, 2, 3, 4];
/// Maximum number of snapshots in a file.
const MOST_SNAPSHOTS: u64 = 256;

/// Errors of the state file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The file cannot be opened.
    #[error("server.state = {path}: {source}; the file must be writable and not in use by another program", path = path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: Box<DatabaseError>,
    },
    /// The file cannot be read or written.
    #[error("server.state = {path}: {source}", path = path.display())]
    Access {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: Box<redb::Error>,
    },
    /// The content of the file cannot be used.
    #[error("server.state = {path}: {problem}; use another file, or remove it to begin with the configuration", path = path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        problem: String,
    },
    /// The path leads to another file than before.
    #[error(
        "server.state = {path}: it was replaced by another file while the daemon was running: remove that file to keep the current state, or restart the daemon to use it",
        path = path.display()
    )]
    Replaced {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file holds the maximum number of snapshots.
    #[error(
        "the file holds {MOST_SNAPSHOTS} snapshots, the maximum: overwrite one by saving under its name, or use another file"
    )]
    Full,
}

/// Returns the reason why a file cannot be opened: its content is at fault, or it is in use or not accessible.
fn unopened(path: &Path, source: DatabaseError) -> StateError {
    use std::io::ErrorKind::{InvalidData, UnexpectedEof};
    let is_damage = match &source {
        DatabaseError::Storage(StorageError::Io(error)) => matches!(error.kind(), InvalidData | UnexpectedEof),
        DatabaseError::Storage(StorageError::Corrupted(_))
        | DatabaseError::RepairAborted
        | DatabaseError::UpgradeRequired(_) => true,
        _ => false,
    };
    match is_damage {
        true => StateError::Content {
            path: path.to_owned(),
            problem: format!("it is damaged or not a state file: {source}"),
        },
        false => StateError::Open { path: path.to_owned(), source: Box::new(source) },
    }
}

impl StateError {
    /// Whether the content of the file is at fault.
    pub fn is_damage(&self) -> bool {
        match self {
            Self::Content { .. } => true,
            Self::Access { source, .. } => matches!(**source, redb::Error::Corrupted(_)),
            _ => false,
        }
    }
}

/// Opens the database.
type Opener = Box<dyn Fn() -> Result<Database, DatabaseError> + Send + Sync>;

/// An open state file.
pub(crate) struct StateFile {
    path: PathBuf,
    open: Opener,
    /// `None` after a disk error: redb then refuses all further work, so the database is opened again.
    database: Mutex<Option<Open>>,
}

/// An open database, and the identity of its file.
struct Open {
    database: Database,
    file: [u64; 2],
}

/// Name and time of a snapshot.
pub(crate) struct SnapshotName {
    pub(crate) name: String,
    pub(crate) time: Option<prost_types::Timestamp>,
}

/// Checks whether [`run`](crate::service::run) can use a state file, and creates the file if it is missing. Call this at the start, before slow work.
///
/// # Errors
///
/// The file is damaged, of another format, not writable, or in use.
pub fn check_state(path: &Path) -> Result<(), StateError> {
    // redb panics at some damaged pages. The panic becomes an error, so it is not printed.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let checked = std::panic::catch_unwind(AssertUnwindSafe(|| {
        let file = StateFile::open(path)?;
        file.current_state()?;
        if let Err(error) = file.snapshots() {
            tracing::warn!("snapshots cannot be read: {error}");
        }
        Ok(())
    }));
    std::panic::set_hook(hook);
    checked.unwrap_or_else(|_| {
        let problem = "it is damaged: its pages refer to places that do not exist".to_owned();
        Err(StateError::Content { path: path.to_owned(), problem })
    })
}

impl StateFile {
    /// Opens a file, or creates it.
    pub(crate) fn open(path: &Path) -> Result<Self, StateError> {
        if std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() == 0) {
            tracing::warn!("the state file `{}` is empty: nothing is restored from it", path.display());
        }
        let is_new = std::fs::symlink_metadata(path).is_err();
        let owned = path.to_owned();
        let opened = Self::open_with(path, Box::new(move || Database::create(&owned)));
        if opened.is_err() && is_new && std::fs::symlink_metadata(path).is_ok() {
            // A file that could not be written completely, for instance on a full disk, would be refused at the next start.
            if let Err(error) = std::fs::remove_file(path) {
                tracing::warn!("the incomplete state file `{}` cannot be removed: {error}", path.display());
            }
        }
        opened
    }

    fn open_with(path: &Path, open: Opener) -> Result<Self, StateError> {
        let database = Mutex::new(Some(opened(path, &open)?));
        let file = Self { path: path.to_owned(), open, database };
        match file.get(FORMAT)?.as_deref() {
            Some([VERSION]) => {}
            Some([older]) if OLDER.contains(older) => file.put(STATE, &[(FORMAT, &[VERSION])])?,
            Some(found) => {
                return Err(file.content(format!("its format is {found:?}, this program supports {VERSION}")));
            }
            None => file.put(STATE, &[(FORMAT, &[VERSION])])?,
        }
        Ok(file)
    }

    /// Returns the error for unusable content of the file.
    pub(crate) fn content(&self, problem: String) -> StateError {
        StateError::Content { path: self.path.clone(), problem }
    }

    /// Works with the database. If a disk error, such as a full disk, has closed the database, opens it again.
    fn work<T>(&self, job: impl FnOnce(&Database) -> Result<T, redb::Error>) -> Result<T, StateError> {
        let mut held = self.database.lock().unwrap_or_else(PoisonError::into_inner);
        let was_closed = held.is_none();
        let open = match held.take() {
            Some(open) => open,
            None => opened(&self.path, &self.open)?,
        };
        let result = job(&open.database);
        if !matches!(result, Err(redb::Error::Io(_) | redb::Error::PreviousIo)) {
            *held = Some(open);
            if was_closed && result.is_ok() {
                tracing::info!("server.state = {}: it can be used again", self.path.display());
            }
        }
        result.map_err(|source| StateError::Access { path: self.path.clone(), source: Box::new(source) })
    }

    /// Ensures that the path still leads to the open file, because changes in a file without a name would be lost. A file that was removed is written
    /// again.
    fn keep_in_place(&self) -> Result<(), StateError> {
        let mut held = self.database.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(Open { database, file }) = &*held else { return Ok(()) };
        let failed = |source: redb::Error| StateError::Access { path: self.path.clone(), source: Box::new(source) };
        match files::identity(&self.path) {
            Ok(found) if found == *file => Ok(()),
            Ok(_) => Err(StateError::Replaced { path: self.path.clone() }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let tables = [STATE, SNAPSHOTS].map(|table| Ok((table, entries(database, table)?)));
                let tables = tables.into_iter().collect::<Result<Vec<_>, redb::Error>>().map_err(failed)?;
                let new = opened(&self.path, &self.open)?;
                for (table, entries) in tables {
                    let entries: Vec<(&str, &[u8])> =
                        entries.iter().map(|(key, value)| (&key[..], &value[..])).collect();
                    insert(&new.database, table, &entries).map_err(failed)?;
                }
                *held = Some(new);
                tracing::warn!(
                    "server.state = {}: it was removed while the daemon was running, and is written again",
                    self.path.display()
                );
                Ok(())
            }
            Err(error) => Err(failed(redb::Error::Io(error))),
        }
    }

    fn put(&self, table: TableDefinition<'_, &str, &[u8]>, values: &[(&str, &[u8])]) -> Result<(), StateError> {
        self.keep_in_place()?;
        self.work(|database| insert(database, table, values))
    }

    fn read(&self, table: TableDefinition<'_, &str, &[u8]>, key: &str) -> Result<Option<Vec<u8>>, StateError> {
        self.work(|database| {
            let table = match database.begin_read()?.open_table(table) {
                Ok(table) => table,
                Err(redb::TableError::TableDoesNotExist(_)) => return Ok(None),
                Err(error) => return Err(error.into()),
            };
            Ok(table.get(key)?.map(|value| value.value().to_vec()))
        })
    }

    fn get(&self, key: &str) -> Result<Option<Vec<u8>>, StateError> {
        self.read(STATE, key)
    }

    fn decoded<T: Message + Default>(&self, what: &str, bytes: Option<Vec<u8>>) -> Result<Option<T>, StateError> {
        let decoded = bytes.map(|bytes| T::decode(bytes.as_slice())).transpose();
        decoded.map_err(|error| self.content(format!("{what}: {error}")))
    }

    /// Returns the last state; `None` for a new file.
    pub(crate) fn current_state(&self) -> Result<(Option<Saved>, Option<proto::Camera>), StateError> {
        let camera = self.decoded("the camera", self.get(CAMERA)?)?;
        Ok((self.decoded("the scene", self.get(SHOWN)?)?, camera))
    }

    /// Writes the current state.
    pub(crate) fn save(&self, saved: &Saved) -> Result<(), StateError> {
        self.put(STATE, &[(SHOWN, &saved.encode_to_vec())])
    }

    /// Writes the current camera.
    pub(crate) fn save_camera(&self, camera: &Camera) -> Result<(), StateError> {
        self.put(STATE, &[(CAMERA, &camera::camera_to_pb(camera).encode_to_vec())])
    }

    /// Writes a snapshot, and replaces an existing one of that name.
    pub(crate) fn save_snapshot(&self, name: &str, saved: &Saved) -> Result<(), StateError> {
        let names = self.snapshots()?;
        if names.len() as u64 >= MOST_SNAPSHOTS && names.iter().all(|known| known.name != name) {
            return Err(StateError::Full);
        }
        self.put(SNAPSHOTS, &[(name, &saved.encode_to_vec())])
    }

    /// Returns a snapshot by name.
    pub(crate) fn snapshot(&self, name: &str) -> Result<Option<Saved>, StateError> {
        self.decoded("the snapshot", self.read(SNAPSHOTS, name)?)
    }

    /// Lists all snapshots by name.
    pub(crate) fn snapshots(&self) -> Result<Vec<SnapshotName>, StateError> {
        let entries = self.work(|database| entries(database, SNAPSHOTS))?;
        let named = entries.into_iter().map(|(name, bytes)| {
            let saved = Saved::decode(bytes.as_slice()).map_err(|error| self.content(error.to_string()))?;
            Ok(SnapshotName { name, time: saved.time })
        });
        named.collect()
    }
}

/// Opens the database of a path.
fn opened(path: &Path, open: &Opener) -> Result<Open, StateError> {
    let database = open().map_err(|source| unopened(path, source))?;
    let file = files::identity(path)
        .map_err(|error| StateError::Access { path: path.to_owned(), source: Box::new(redb::Error::Io(error)) })?;
    Ok(Open { database, file })
}

/// Returns all entries of a table; none if the table does not exist yet.
fn entries(
    database: &Database,
    table: TableDefinition<'_, &str, &[u8]>,
) -> Result<Vec<(String, Vec<u8>)>, redb::Error> {
    let table = match database.begin_read()?.open_table(table) {
        Ok(table) => table,
        Err(redb::TableError::TableDoesNotExist(_)) => return Ok(Vec::new()),
        Err(error) => return Err(error.into()),
    };
    let mut entries = Vec::new();
    for entry in table.iter()? {
        let (name, bytes) = entry?;
        entries.push((name.value().to_owned(), bytes.value().to_vec()));
    }
    Ok(entries)
}

/// Writes entries of a table in one transaction, which is on the disk when this returns: redb synchronises by default.
fn insert(
    database: &Database,
    table: TableDefinition<'_, &str, &[u8]>,
    values: &[(&str, &[u8])],
) -> Result<(), redb::Error> {
    let write = database.begin_write()?;
    {
        let mut table = write.open_table(table)?;
        for (key, value) in values {
            table.insert(*key, *value)?;
        }
    }
    Ok(write.commit()?)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    };

    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A disk that fails while a flag is set, as a full disk does.
    #[derive(Debug)]
    struct Disk {
        file: redb::backends::FileBackend,
        is_full: Arc<AtomicBool>,
    }

    impl Disk {
        fn check(&self) -> Result<(), std::io::Error> {
            match self.is_full.load(Relaxed) {
                true => Err(std::io::ErrorKind::StorageFull.into()),
                false => Ok(()),
            }
        }
    }

    impl redb::StorageBackend for Disk {
        fn len(&self) -> Result<u64, std::io::Error> {
            self.file.len()
        }
        fn read(&self, offset: u64, out: &mut [u8]) -> Result<(), std::io::Error> {
            self.file.read(offset, out)
        }
        fn set_len(&self, len: u64) -> Result<(), std::io::Error> {
            self.check()?;
            self.file.set_len(len)
        }
        fn sync_data(&self) -> Result<(), std::io::Error> {
            self.check()?;
            self.file.sync_data()
        }
        fn write(&self, offset: u64, data: &[u8]) -> Result<(), std::io::Error> {
            self.check()?;
            self.file.write(offset, data)
        }
        fn close(&self) -> Result<(), std::io::Error> {
            self.file.close()
        }
    }

    #[test]
    fn a_full_disk_that_has_room_again_takes_changes_and_keeps_the_old_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.redb");
        let is_full = Arc::new(AtomicBool::new(false));
        let (opened, of_disk) = (path.clone(), Arc::clone(&is_full));
        let open = move || {
            let options = std::fs::File::options().read(true).write(true).create(true).truncate(false).open(&opened);
            let file = redb::backends::FileBackend::new(options.map_err(StorageError::from)?)?;
            Database::builder().create_with_backend(Disk { file, is_full: Arc::clone(&of_disk) })
        };
        let file = StateFile::open_with(&path, Box::new(open)).unwrap();
        let camera = |x: f64| Camera { position_m: glam::DVec3::X * x, ..Camera::default() };
        let saved = |file: &StateFile| file.current_state().unwrap().1.unwrap().position_m.unwrap().x;
        file.save_camera(&camera(1.0)).unwrap();
        is_full.store(true, Relaxed);
        for _ in 0..2 {
            assert!(file.save_camera(&camera(2.0)).is_err());
        }
        is_full.store(false, Relaxed);
        assert_eq!(saved(&file), 1.0);
        file.save_camera(&camera(3.0)).unwrap();
        assert_eq!(saved(&file), 3.0);
        drop(file);
        assert_eq!(saved(&StateFile::open(&path).unwrap()), 3.0);
    }

    #[test]
    fn a_removed_file_is_written_anew_and_a_replaced_one_takes_no_change() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.redb");
        let camera = |x: f64| Camera { position_m: glam::DVec3::X * x, ..Camera::default() };
        let saved = |file: &StateFile| file.current_state().unwrap().1.unwrap().position_m.unwrap().x;
        let file = StateFile::open(&path).unwrap();
        file.save_snapshot("important", &Saved::default()).unwrap();
        file.save_camera(&camera(1.0)).unwrap();
        if std::fs::remove_file(&path).is_err() {
            // On Windows an open file keeps its name, so there is nothing to detect.
            return;
        }
        file.save_snapshot("later", &Saved::default()).unwrap();
        drop(file);
        let file = StateFile::open(&path).unwrap();
        assert_eq!(saved(&file), 1.0);
        assert_eq!(file.snapshots().unwrap().len(), 2);
        // If another file has taken its place, that file stays unchanged.
        let backup = folder.path().join("backup.redb");
        std::fs::copy(&path, &backup).unwrap();
        std::fs::rename(&backup, &path).unwrap();
        let error = file.save_camera(&camera(2.0)).unwrap_err();
        assert!(matches!(error, StateError::Replaced { .. }), "{error}");
        assert_eq!(saved(&StateFile::open(&path).unwrap()), 1.0);
        std::fs::remove_file(&path).unwrap();
        file.save_camera(&camera(3.0)).unwrap();
        drop(file);
        assert_eq!(saved(&StateFile::open(&path).unwrap()), 3.0);
    }

    /// Bytes at random places are overwritten: the file must be refused, or its content must be read.
    #[test]
    fn no_damage_ends_the_check_with_a_panic() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.redb");
        let file = StateFile::open(&path).unwrap();
        for name in 0..20 {
            file.save_snapshot(&format!("s{name}"), &Saved::default()).unwrap();
        }
        file.save_camera(&Camera::default()).unwrap();
        drop(file);
        let good = std::fs::read(&path).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut refused = 0;
        for _ in 0..40 {
            let mut bytes = good.clone();
            for _ in 0..200 {
                let at = random.random_range(0..bytes.len());
                bytes[at] = random.random();
            }
            std::fs::write(&path, bytes).unwrap();
            if let Err(error) = check_state(&path) {
                assert!(error.is_damage(), "{error:?}");
                refused += 1;
            }
        }
        assert!(refused > 5, "{refused}");
    }

    #[test]
    fn other_files_are_refused_with_an_explanation() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.redb");
        std::fs::write(&path, b"not a database, but long enough to be examined").unwrap();
        let error = StateFile::open(&path).err().unwrap().to_string();
        assert!(error.contains("server.state") && error.contains("state.redb"), "{error}");
        assert!(error.contains("damaged or not a state file"), "{error}");
        std::fs::remove_file(&path).unwrap();
        let file = StateFile::open(&path).unwrap();
        let error = StateFile::open(&path).err().unwrap();
        assert!(matches!(error, StateError::Open { .. }) && !error.is_damage(), "the file is open already: {error}");
        // Two damaged files: one that was truncated, and one whose head was overwritten.
        let good = std::fs::read(&path).unwrap();
        let mut overwritten = good.clone();
        overwritten[..4096].fill(0x5a);
        for damaged in [&good[..good.len() / 2], &good[..700], &overwritten] {
            let path = folder.path().join("damaged.redb");
            std::fs::write(&path, damaged).unwrap();
            let error = check_state(&path).err().unwrap();
            assert!(error.is_damage(), "{} bytes: {error:?}", damaged.len());
        }
        let missing = StateFile::open(&folder.path().join("none/state.redb")).err().unwrap();
        assert!(!missing.is_damage(), "{missing}");
        // A file of the previous version must be upgraded, and an older program must then refuse it.
        let mut file = file;
        for older in OLDER {
            file.put(STATE, &[(FORMAT, &[older])]).unwrap();
            drop(file);
            file = StateFile::open(&path).unwrap();
            assert_eq!(file.get(FORMAT).unwrap().as_deref(), Some(&[VERSION][..]));
        }
        file.put(STATE, &[(FORMAT, &[VERSION + 1])]).unwrap();
        drop(file);
        let error = StateFile::open(&path).err().unwrap().to_string();
        assert!(error.contains("this program supports 5"), "{error}");
    }

    #[test]
    fn damaged_content_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let file = StateFile::open(&folder.path().join("state.redb")).unwrap();
        assert_eq!(file.current_state().unwrap(), (None, None));
        file.save_camera(&Camera { revision: 7, ..Camera::default() }).unwrap();
        assert_eq!(file.current_state().unwrap().1.unwrap().revision, 7);
        file.put(STATE, &[(SHOWN, &[0xff, 0xff])]).unwrap();
        assert!(file.current_state().unwrap_err().to_string().contains("the scene"));
        for name in 0..MOST_SNAPSHOTS {
            file.save_snapshot(&format!("s{name}"), &Saved::default()).unwrap();
        }
        assert!(matches!(file.save_snapshot("one more", &Saved::default()), Err(StateError::Full)));
        file.save_snapshot("s3", &Saved::default()).unwrap();
        assert!(file.snapshot("s9").unwrap().is_some() && file.snapshot("none").unwrap().is_none());
    }
}
