//! What clients have changed, on disk before they are told: scene, views, and the camera, in one file that a daemon opens alone. Snapshots
//! are the same under names.
//!
//! A change is written and synchronised in one transaction, so that a daemon that is killed comes back with all that was acknowledged, and
//! with nothing by halves.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::SystemTime,
};

use prost::Message;
use redb::{Database, DatabaseError, ReadableDatabase, ReadableTable, TableDefinition};

use super::{convert, proto, scene::SceneState, views::KeptView};
use crate::{
    config::ViewTables,
    plan::settings::RenderSettings,
    scene::{Camera, SceneClock},
};

/// What is shown, by the names below.
const STATE: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("state");
/// Snapshots, by their names.
const SNAPSHOTS: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("snapshots");
const FORMAT: &str = "format";
const SHOWN: &str = "shown";
const CAMERA: &str = "camera";
/// Grows with every change of what is stored, so that no older program drops what it does not know.
const VERSION: u8 = 3;
/// Before clients could make and delete views, and before they could move the observer: what these have left out is as the configuration has it.
const OLDER: [u8; 2] = [1, 2];
/// Snapshots that a file may hold.
const MOST_SNAPSHOTS: u64 = 256;

/// What is wrong with a file of states.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// It cannot be opened.
    #[error("server.state = {path}: {source}; a file that one daemon alone writes is needed", path = path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<DatabaseError>,
    },
    /// It cannot be read or written.
    #[error("server.state = {path}: {source}", path = path.display())]
    Access {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<redb::Error>,
    },
    /// What it holds is of no use.
    #[error("server.state = {path}: {problem}; use another file, or remove it to begin with the configuration", path = path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// There are too many snapshots.
    #[error(
        "there are {MOST_SNAPSHOTS} snapshots, the most there may be: load one and save it under its own name, or use another file"
    )]
    Full,
}

/// What a view has of its own, as tables of a configuration.
#[derive(Clone, PartialEq, Message)]
pub(super) struct SavedView {
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
    /// The keys of its geometry, where a client has given them; else they are the configuration's.
    #[prost(string, optional, tag = "6")]
    definition: Option<String>,
}

/// Scene and views.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Saved {
    #[prost(message, optional, tag = "1")]
    pub(super) scene: Option<proto::Scene>,
    #[prost(message, repeated, tag = "2")]
    views: Vec<SavedView>,
    /// Of snapshots alone: those of the daemon have it by itself, since it changes more often.
    #[prost(message, optional, tag = "3")]
    pub(super) camera: Option<proto::Camera>,
    /// When a snapshot was saved.
    #[prost(message, optional, tag = "4")]
    pub(super) time: Option<prost_types::Timestamp>,
    /// Views of the configuration that were deleted.
    #[prost(string, repeated, tag = "5")]
    deleted: Vec<String>,
}

impl Saved {
    /// What a scene has that clients may change.
    pub(super) fn of(scene: &SceneState, camera: Option<&Camera>) -> Self {
        Self {
            scene: Some(convert::scene_to_pb(scene, &[])),
            views: scene.views.kept().map(SavedView::from).collect(),
            deleted: scene.views.deleted().map(str::to_owned).collect(),
            camera: camera.map(convert::camera_to_pb),
            time: Some(SystemTime::now().into()),
        }
    }

    /// A clock that was set to what is saved as it would be if it had gone on since.
    pub(super) fn clock(&self, set: SceneClock) -> SceneClock {
        let told = self.scene.as_ref().and_then(|scene| scene.time_told?.try_into().ok());
        told.map_or(set, |told| SceneClock { since: told, ..set })
    }

    /// A scene with all of this in place of its own, whichever revision it has. What is not there any more is told.
    pub(super) fn applied(&self, scene: &SceneState, general: &RenderSettings) -> Result<SceneState, String> {
        let mut all = ["stars", "time", "time_rate", "asteroids", "bodies", "asteroid_fields", "overlay"]
            .map(str::to_owned)
            .to_vec();
        // Files of the formats before have its place alone, which nobody could change.
        if self.scene.as_ref().and_then(|scene| scene.observer.as_ref()?.air).is_some() {
            all.push("observer".to_owned());
        }
        let request = proto::UpdateSceneRequest {
            scene: self.scene.clone(),
            update_mask: Some(prost_types::FieldMask { paths: all }),
            expected_revision: None,
        };
        let made = convert::scene_update_from_pb(&request)?.make(scene)?;
        let mut after = scene.clone().changed(&made, None).map_err(|error| error.to_string())?;
        let kept = self.views.iter().map(SavedView::kept).collect::<Result<_, String>>()?;
        after.views = Arc::new(scene.views.restored(general, kept, &self.deleted)?);
        Ok(after)
    }
}

impl From<KeptView> for SavedView {
    fn from(KeptView { name, definition, tables }: KeptView) -> Self {
        let text = |table: Option<toml::Table>| table.map(|table| table.to_string());
        Self {
            name,
            definition: text(definition),
            exposure_group: tables.exposure_group,
            exposure: text(tables.exposure),
            glare: text(tables.glare),
            tone_map: text(tables.tone_map),
        }
    }
}

impl SavedView {
    fn kept(&self) -> Result<KeptView, String> {
        let table = |text: &Option<String>| {
            let parsed = text.as_ref().map(|text| text.parse::<toml::Table>()).transpose();
            parsed.map_err(|error| format!("view `{}`: {error}", self.name))
        };
        Ok(KeptView {
            name: self.name.clone(),
            definition: table(&self.definition)?,
            tables: ViewTables {
                exposure_group: self.exposure_group.clone(),
                exposure: table(&self.exposure)?,
                glare: table(&self.glare)?,
                tone_map: table(&self.tone_map)?,
            },
        })
    }
}

/// A file of states.
pub(super) struct StateFile {
    path: PathBuf,
    database: Database,
}

/// Names and times of snapshots.
pub(super) struct SnapshotName {
    pub(super) name: String,
    pub(super) time: Option<prost_types::Timestamp>,
}

impl StateFile {
    /// Opens a file, or makes it.
    pub(super) fn open(path: &Path) -> Result<Self, StateError> {
        let opened = Database::create(path);
        let database = opened.map_err(|source| StateError::Open { path: path.to_owned(), source: Box::new(source) })?;
        let file = Self { path: path.to_owned(), database };
        match file.get(FORMAT)?.as_deref() {
            Some([VERSION]) => {}
            Some([older]) if OLDER.contains(older) => file.put(STATE, &[(FORMAT, &[VERSION])])?,
            Some(found) => return Err(file.content(format!("its format is {found:?}, this program has {VERSION}"))),
            None => file.put(STATE, &[(FORMAT, &[VERSION])])?,
        }
        Ok(file)
    }

    /// That what it holds is of no use.
    pub(super) fn content(&self, problem: String) -> StateError {
        StateError::Content { path: self.path.clone(), problem }
    }

    fn access<T, E: Into<redb::Error>>(&self, result: Result<T, E>) -> Result<T, StateError> {
        result.map_err(|source| StateError::Access { path: self.path.clone(), source: Box::new(source.into()) })
    }

    fn put(&self, table: TableDefinition<'_, &str, &[u8]>, values: &[(&str, &[u8])]) -> Result<(), StateError> {
        // Synchronised with the disk when it is committed, unless told otherwise.
        let write = self.access(self.database.begin_write())?;
        {
            let mut table = self.access(write.open_table(table))?;
            for (key, value) in values {
                self.access(table.insert(*key, *value))?;
            }
        }
        self.access(write.commit())
    }

    fn read(&self, table: TableDefinition<'_, &str, &[u8]>, key: &str) -> Result<Option<Vec<u8>>, StateError> {
        let read = self.access(self.database.begin_read())?;
        let table = match read.open_table(table) {
            Ok(table) => table,
            Err(redb::TableError::TableDoesNotExist(_)) => return Ok(None),
            Err(error) => return self.access(Err(error)),
        };
        Ok(self.access(table.get(key))?.map(|value| value.value().to_vec()))
    }

    fn get(&self, key: &str) -> Result<Option<Vec<u8>>, StateError> {
        self.read(STATE, key)
    }

    fn decoded<T: Message + Default>(&self, what: &str, bytes: Option<Vec<u8>>) -> Result<Option<T>, StateError> {
        let decoded = bytes.map(|bytes| T::decode(bytes.as_slice())).transpose();
        decoded.map_err(|error| self.content(format!("{what}: {error}")))
    }

    /// What was shown last; `None`: the file is new.
    pub(super) fn shown(&self) -> Result<(Option<Saved>, Option<proto::Camera>), StateError> {
        let camera = self.decoded("the camera", self.get(CAMERA)?)?;
        Ok((self.decoded("the scene", self.get(SHOWN)?)?, camera))
    }

    /// Writes what is shown from now on.
    pub(super) fn save(&self, saved: &Saved) -> Result<(), StateError> {
        self.put(STATE, &[(SHOWN, &saved.encode_to_vec())])
    }

    /// Writes the camera.
    pub(super) fn save_camera(&self, camera: &Camera) -> Result<(), StateError> {
        self.put(STATE, &[(CAMERA, &convert::camera_to_pb(camera).encode_to_vec())])
    }

    /// Writes a snapshot, over one of that name.
    pub(super) fn save_snapshot(&self, name: &str, saved: &Saved) -> Result<(), StateError> {
        let names = self.snapshots()?;
        if names.len() as u64 >= MOST_SNAPSHOTS && names.iter().all(|known| known.name != name) {
            return Err(StateError::Full);
        }
        self.put(SNAPSHOTS, &[(name, &saved.encode_to_vec())])
    }

    /// A snapshot; `None`: there is none of that name.
    pub(super) fn snapshot(&self, name: &str) -> Result<Option<Saved>, StateError> {
        self.decoded("the snapshot", self.read(SNAPSHOTS, name)?)
    }

    /// All snapshots, by name.
    pub(super) fn snapshots(&self) -> Result<Vec<SnapshotName>, StateError> {
        let read = self.access(self.database.begin_read())?;
        let table = match read.open_table(SNAPSHOTS) {
            Ok(table) => table,
            Err(redb::TableError::TableDoesNotExist(_)) => return Ok(Vec::new()),
            Err(error) => return self.access(Err(error)),
        };
        let mut names = Vec::new();
        for entry in self.access(table.iter())? {
            let (name, bytes) = self.access(entry)?;
            let saved = Saved::decode(bytes.value()).map_err(|error| self.content(error.to_string()))?;
            names.push(SnapshotName { name: name.value().to_owned(), time: saved.time });
        }
        Ok(names)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_none_are_refused_with_what_helps() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.redb");
        std::fs::write(&path, b"no database at all, and long enough to be looked at").unwrap();
        let error = StateFile::open(&path).err().unwrap().to_string();
        assert!(error.contains("server.state") && error.contains("state.redb"), "{error}");
        std::fs::remove_file(&path).unwrap();
        let file = StateFile::open(&path).unwrap();
        assert!(StateFile::open(&path).is_err(), "two at once");
        // A file of the version before is taken over, and no older program takes it back.
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
        assert!(error.contains("this program has 3"), "{error}");
    }

    #[test]
    fn what_is_damaged_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = StateFile::open(&folder.path().join("state.redb")).unwrap();
        assert_eq!(file.shown().unwrap(), (None, None));
        file.save_camera(&Camera { revision: 7, ..Camera::default() }).unwrap();
        assert_eq!(file.shown().unwrap().1.unwrap().revision, 7);
        file.put(STATE, &[(SHOWN, &[0xff, 0xff])]).unwrap();
        assert!(file.shown().unwrap_err().to_string().contains("the scene"));
        for name in 0..MOST_SNAPSHOTS {
            file.save_snapshot(&format!("s{name}"), &Saved::default()).unwrap();
        }
        assert!(matches!(file.save_snapshot("one more", &Saved::default()), Err(StateError::Full)));
        file.save_snapshot("s3", &Saved::default()).unwrap();
        assert!(file.snapshot("s9").unwrap().is_some() && file.snapshot("none").unwrap().is_none());
    }
}
