//! Asteroid fields in a plan: settings, impostors, and the instances that may be visible in each viewport.

pub mod areas;
pub mod bounds;
pub mod classes;
pub mod cpu_cull;
pub mod cut;
pub mod frame;
pub mod glare;
pub mod kinds;
mod settings;
mod technique;
pub mod tiles;
pub mod views;

pub use bounds::{ImpostorDistances, impostor_distances, nearest_distance_m};
pub use frame::{AsteroidInputs, AsteroidPlan, Tables};
pub(super) use technique::Asteroids;

pub use settings::{AsteroidSettings, Culling, ImpostorMethod};
