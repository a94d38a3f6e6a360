//! Glare in a plan: its settings, what scatters besides the stars, and the numbers of each method.

pub mod objects;
pub mod pyramid;
pub(crate) mod settings;
pub mod sky_cube;
