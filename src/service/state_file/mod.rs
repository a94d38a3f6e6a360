//! The file of acknowledged changes: scene, views and camera, in one redb database that one daemon opens exclusively.
//! Snapshots are stored in the same format under their names.
//!
//! A change is written and synchronised in one transaction before it is acknowledged. After a crash, the daemon
//! therefore resumes with every acknowledged change and with no partial change.

mod database;
mod saved;

pub use self::database::{StateError, check_state};
pub(crate) use self::{
    database::{SnapshotName, StateFile},
    saved::Saved,
};
