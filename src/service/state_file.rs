//! The file of acknowledged changes: scene, views and camera, in one redb database that one daemon opens exclusively.
//! Snapshots are stored in the same format under their names.
//!
//! A change is written and synchronised in one transaction before it is acknowledged. After a crash, the daemon
//! therefore resumes with every acknowledged change and with no partial change.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::SystemTime,
};

use prost::Message;
use redb::{Database, DatabaseError, ReadableDatabase, ReadableTable, StorageError, TableDefinition};
use serde::de::DeserializeOwned;

use crate::{
    config::{KeyError, ViewSpec},
    plan::settings::RenderSettings,
    scene::{Camera, SceneClock},
    service::{
        proto,
        scene::state::SceneState,
        time_source::TimeSource,
        wire::{
            camera, scene,
            views::{spec_from_pb, spec_to_pb},
        },
    },
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
/// Older versions that are still read, and then written in the current one: 1 has no views of clients, 2 no observer, those up to 3 have
/// the settings of views as TOML text, and 4 has no pictures. Missing values come from the configuration.
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
    /// The file holds the maximum number of snapshots.
    #[error(
        "the file holds {MOST_SNAPSHOTS} snapshots, the maximum: overwrite one by saving under its name, or use another file"
    )]
    Full,
}

/// View in the formats up to 3, with tables as TOML text.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct TextView {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(string, optional, tag = "2")]
    exposure_group: Option<String>,
    #[prost(string, optional, tag = "3")]
    exposure: Option<String>,
    #[prost(string, optional, tag = "4")]
    glare: Option<String>,
    #[prost(string, optional, tag = "5")]
    tone_map: Option<String>,
    /// Keys of the view's geometry if a client has set them; otherwise the configuration's apply.
    #[prost(string, optional, tag = "6")]
    definition: Option<String>,
}

/// Scene and views.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Saved {
    #[prost(message, optional, tag = "1")]
    pub(crate) scene: Option<proto::Scene>,
    /// Views in the formats up to 3.
    #[prost(message, repeated, tag = "2")]
    text_views: Vec<TextView>,
    /// Camera of a snapshot. The current camera has its own entry, because it changes more often.
    #[prost(message, optional, tag = "3")]
    pub(crate) camera: Option<proto::Camera>,
    /// Time at which a snapshot was saved.
    #[prost(message, optional, tag = "4")]
    pub(crate) time: Option<prost_types::Timestamp>,
    /// Deleted views of the configuration.
    #[prost(string, repeated, tag = "5")]
    deleted: Vec<String>,
    /// All views. Views without a type have the geometry of the configuration.
    #[prost(message, repeated, tag = "6")]
    views: Vec<proto::ViewDefinition>,
    /// Whether the overlay has its pictures, with the files that clients have sent. Older formats have none.
    #[prost(bool, tag = "7")]
    has_pictures: bool,
}

impl Saved {
    /// Copies the parts of a scene that clients may change.
    pub(crate) fn from_scene(scene: &SceneState, camera: Option<&Camera>, time: &TimeSource) -> Self {
        let mut message = scene::scene_to_pb(scene, &[], time);
        if let Some(overlay) = &mut message.overlay {
            for (saved, picture) in overlay.pictures.iter_mut().zip(&scene.objects.drawn.overlay.pictures) {
                saved.png = picture.png.as_ref().map(|png| png.to_vec());
            }
        }
        Self {
            scene: Some(message),
            has_pictures: true,
            // Only a specification with a non-UTF-8 path has no message.
            views: scene.views.kept().filter_map(|spec| spec_to_pb(&spec).ok()).collect(),
            text_views: Vec::new(),
            deleted: scene.views.deleted().map(str::to_owned).collect(),
            camera: camera.map(camera::camera_to_pb),
            time: Some(time.machine_now().into()),
        }
    }

    /// Returns the saved clock, advanced by the time since it was saved. If the machine's clock was set back since then,
    /// it goes on from where it was saved.
    pub(crate) fn clock(&self, set: SceneClock, time: &TimeSource) -> SceneClock {
        let saved_at = self.scene.as_ref().and_then(|scene| scene.time_told?.try_into().ok());
        saved_at.map_or(set, |told| SceneClock { since: time.heard(told).min(time.now()), ..set })
    }

    /// Applies the saved values to a scene at the daemon's time `now`, whatever its revision. Logs the saved objects that no longer exist.
    pub(crate) fn applied(
        &self,
        scene: &SceneState,
        general: &RenderSettings,
        now: SystemTime,
    ) -> Result<SceneState, String> {
        // Older versions have only the timestamp.
        let is_exact = self.scene.as_ref().is_some_and(|scene| scene.time_j2000_s.is_some());
        let time = if is_exact { "time_j2000_s" } else { "time" };
        let mut all =
            ["stars", time, "time_rate", "asteroids", "bodies", "asteroid_fields"].map(str::to_owned).to_vec();
        if self.has_pictures {
            all.push("overlay".to_owned());
        } else {
            let parts = ["grids", "trajectories", "labels", "cardinal_points", "test_patterns"];
            all.extend(parts.map(|part| format!("overlay.{part}")));
        }
        // Older formats have only the place, which no client could change.
        if self.scene.as_ref().and_then(|scene| scene.observer.as_ref()?.air).is_some() {
            all.push("observer".to_owned());
        }
        let request = proto::UpdateSceneRequest {
            scene: self.scene.clone().map(|saved| without_lost_pictures(saved, scene)),
            update_mask: Some(prost_types::FieldMask { paths: all }),
            expected_revision: None,
        };
        let made = scene::scene_update_from_pb(&request)?.make(scene)?;
        let mut after = scene.clone().changed(&made, None, now).map_err(|error| error.to_string())?;
        let older = self.text_views.iter().map(TextView::message).collect::<Result<Vec<_>, String>>()?;
        let kept = older.iter().chain(&self.views).map(kept_spec).collect::<Result<_, String>>()?;
        after.views = Arc::new(scene.views.restored(general, kept, &self.deleted)?);
        Ok(after)
    }
}

/// A saved scene without the pictures of an earlier configuration that the present one lacks: their files are not saved.
fn without_lost_pictures(mut saved: proto::Scene, scene: &SceneState) -> proto::Scene {
    if let Some(overlay) = &mut saved.overlay {
        let there = &scene.objects.drawn.overlay.pictures;
        overlay.pictures.retain(|picture| {
            let is_known = picture.png.is_some() || there.iter().any(|known| known.name == picture.name);
            if !is_known {
                tracing::info!("the configuration no longer has the picture `{}` of the overlay", picture.name);
            }
            is_known
        });
    }
    saved
}

/// The specification of a view that was kept; one without a type has no geometry.
fn kept_spec(message: &proto::ViewDefinition) -> Result<ViewSpec, String> {
    let wrong = |error: KeyError| format!("view `{}`: {error}", message.name());
    if message.r#type.is_some() {
        return spec_from_pb(message).map(|(spec, _)| spec).map_err(wrong);
    }
    ViewSpec::settings_from_keys(message).map_err(wrong)
}

impl TextView {
    fn message(&self) -> Result<proto::ViewDefinition, String> {
        let view = &self.name;
        let definition: Option<proto::ViewDefinition> = parsed(view, self.definition.as_ref())?;
        Ok(proto::ViewDefinition {
            name: Some(view.clone()),
            exposure_group: self.exposure_group.clone(),
            exposure: parsed(view, self.exposure.as_ref())?,
            glare: parsed(view, self.glare.as_ref())?,
            tone_map: parsed(view, self.tone_map.as_ref())?,
            ..definition.unwrap_or_default()
        })
    }
}

/// A message whose keys are TOML text.
fn parsed<M: DeserializeOwned>(view: &str, text: Option<&String>) -> Result<Option<M>, String> {
    text.map(|text| toml::from_str(text)).transpose().map_err(|error| format!("view `{view}`: {error}"))
}

/// Returns why a file cannot be opened: its content, or its use by others and its permissions.
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
        true => {
            StateError::Content { path: path.to_owned(), problem: format!("it is damaged or no state file: {source}") }
        }
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
    /// `None` after an error of the disk: redb refuses all further work, so that it is opened again.
    database: Mutex<Option<Database>>,
}

/// Name and time of a snapshot.
pub(crate) struct SnapshotName {
    pub(crate) name: String,
    pub(crate) time: Option<prost_types::Timestamp>,
}

/// Checks, before slow work at the start, whether [`run`](super::run) can use a state file. Creates it if it is missing.
///
/// # Errors
///
/// The file is damaged, of another format, not writable, or in use.
pub fn check_state(path: &Path) -> Result<(), StateError> {
    StateFile::open(path)?.current_state().map(drop)
}

impl StateFile {
    /// Opens a file, or creates it.
    pub(crate) fn open(path: &Path) -> Result<Self, StateError> {
        if std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() == 0) {
            tracing::warn!("the state file `{}` is empty: nothing is restored from it", path.display());
        }
        let owned = path.to_owned();
        Self::open_with(path, Box::new(move || Database::create(&owned)))
    }

    fn open_with(path: &Path, open: Opener) -> Result<Self, StateError> {
        let database = Mutex::new(Some(open().map_err(|source| unopened(path, source))?));
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

    /// Error for unusable content of the file.
    pub(crate) fn content(&self, problem: String) -> StateError {
        StateError::Content { path: self.path.clone(), problem }
    }

    /// Works with the database, and opens it again if an error of the disk, such as a full one, has closed it.
    fn work<T>(&self, job: impl FnOnce(&Database) -> Result<T, redb::Error>) -> Result<T, StateError> {
        let mut held = self.database.lock().unwrap_or_else(PoisonError::into_inner);
        let was_closed = held.is_none();
        let database = match held.take() {
            Some(database) => database,
            None => (self.open)().map_err(|source| unopened(&self.path, source))?,
        };
        let result = job(&database);
        if !matches!(result, Err(redb::Error::Io(_) | redb::Error::PreviousIo)) {
            *held = Some(database);
            if was_closed && result.is_ok() {
                tracing::info!("server.state = {}: it can be used again", self.path.display());
            }
        }
        result.map_err(|source| StateError::Access { path: self.path.clone(), source: Box::new(source) })
    }

    fn put(&self, table: TableDefinition<'_, &str, &[u8]>, values: &[(&str, &[u8])]) -> Result<(), StateError> {
        self.work(|database| {
            // redb synchronises with the disk on commit by default.
            let write = database.begin_write()?;
            {
                let mut table = write.open_table(table)?;
                for (key, value) in values {
                    table.insert(*key, *value)?;
                }
            }
            Ok(write.commit()?)
        })
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
        let entries = self.work(|database| {
            let table = match database.begin_read()?.open_table(SNAPSHOTS) {
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
        })?;
        let named = entries.into_iter().map(|(name, bytes)| {
            let saved = Saved::decode(bytes.as_slice()).map_err(|error| self.content(error.to_string()))?;
            Ok(SnapshotName { name, time: saved.time })
        });
        named.collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::{
        sync::atomic::{AtomicBool, Ordering::Relaxed},
        time::Duration,
    };

    use super::*;

    #[test]
    fn a_clock_that_was_saved_in_the_future_runs_from_now() {
        let time = TimeSource::default();
        for told in [Duration::ZERO, Duration::from_secs(3600)] {
            let saved = Saved {
                scene: Some(proto::Scene { time_told: Some((time.now() + told).into()), ..Default::default() }),
                ..Saved::default()
            };
            let clock = saved.clock(SceneClock::running(0.0, 1.0, SystemTime::UNIX_EPOCH), &time);
            let after_a_minute_s = clock.time_s(time.now() + Duration::from_secs(60));
            assert!((55.0..100.0).contains(&after_a_minute_s), "{after_a_minute_s}");
        }
        let old = time.now() - Duration::from_secs(100);
        let scene = proto::Scene { time_told: Some(old.into()), ..Default::default() };
        let saved = Saved { scene: Some(scene), ..Saved::default() };
        let clock = saved.clock(SceneClock::running(0.0, 1.0, SystemTime::UNIX_EPOCH), &time);
        assert_eq!(clock.since, old);
    }

    /// A disk that fails while a flag is set, as a full one.
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
    fn other_files_are_refused_with_an_explanation() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.redb");
        std::fs::write(&path, b"not a database, but long enough to be examined").unwrap();
        let error = StateFile::open(&path).err().unwrap().to_string();
        assert!(error.contains("server.state") && error.contains("state.redb"), "{error}");
        assert!(error.contains("damaged or no state file"), "{error}");
        std::fs::remove_file(&path).unwrap();
        let file = StateFile::open(&path).unwrap();
        let error = StateFile::open(&path).err().unwrap();
        assert!(matches!(error, StateError::Open { .. }) && !error.is_damage(), "the file is open already: {error}");
        // A good file that was cut, and one whose head was overwritten.
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
        // A file of the previous version is upgraded; after that, an older program refuses it.
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

    #[test]
    fn views_of_older_formats_are_read_and_broken_ones_are_refused() {
        let older = TextView {
            name: "dome".to_owned(),
            exposure_group: Some("desk".to_owned()),
            exposure: Some("limiting_magnitude = 8.5\n".to_owned()),
            glare: Some("fraction = 0.25\n".to_owned()),
            tone_map: None,
            definition: Some(
                "fov_deg = 0.1\norientation = [0.0, 0.6, 0.0, 0.8]\nsize = [16, 16]\ntype = \"fisheye\"\n".to_owned(),
            ),
        };
        let text = "name = 'dome'\ntype = 'fisheye'\nsize = [16, 16]\nfov_deg = 0.1\norientation = [0.0, 0.6, 0.0, 0.8]\n\
                    exposure_group = 'desk'\nexposure = { limiting_magnitude = 8.5 }\nglare = { fraction = 0.25 }";
        let expected = ViewSpec::from_toml(text).unwrap().0;
        assert_eq!(kept_spec(&older.message().unwrap()), Ok(expected.clone()));
        // In the formats of today and of old, without a geometry.
        let without = TextView { definition: None, ..older.clone() };
        let kept = kept_spec(&without.message().unwrap()).unwrap();
        assert_eq!(kept, ViewSpec { geometry: kept.geometry.clone(), ..expected });
        assert!(!kept.geometry.has_keys());
        assert_eq!(kept_spec(&spec_to_pb(&kept).unwrap()), Ok(kept));
        for (broken, part) in [
            (TextView { glare: Some("fraction = ".to_owned()), ..older.clone() }, "view `dome`: "),
            (TextView { glare: Some("colour = 3".to_owned()), ..older }, "unknown field `colour`"),
        ] {
            let problem = broken.message().unwrap_err();
            assert!(problem.contains(part), "{problem}");
        }
    }
}
