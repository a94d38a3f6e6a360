//! Twins of the passes that draw asteroids.

pub mod impostors;
pub mod mesh;
