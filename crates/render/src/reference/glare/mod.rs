//! Twins of the passes that draw glare.

pub mod pyramid;
pub mod sky_cube;
