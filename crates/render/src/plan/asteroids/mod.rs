//! How fields of asteroids are drawn: settings, impostors and, per frame, which of their instances every viewport may see.

pub mod areas;
pub mod bounds;
pub mod classes;
pub mod cpu_cull;
pub mod cut;
pub mod frame;
pub mod glare;
pub mod kinds;
mod settings;
pub mod tiles;
pub mod views;

pub use bounds::{ImpostorDistances, impostor_distances, nearest_distance_m};
pub use frame::{AsteroidInputs, AsteroidPlan, Tables};
pub use settings::{AsteroidSettings, Culling, ImpostorMethod};
