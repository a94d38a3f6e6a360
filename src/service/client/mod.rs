//! A client of the daemon in plain Rust types.

pub(crate) mod camera;
pub(crate) mod connection;
pub(crate) mod credentials;
pub(crate) mod delivery;
pub(crate) mod director;
pub(crate) mod scene;
pub(crate) mod stats;
