//! How fields of asteroids are drawn: settings and, per frame, which of their instances every viewport may see.

mod settings;

pub use settings::{AsteroidSettings, Culling, ImpostorMethod};
