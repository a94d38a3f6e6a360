//! Glare in a plan: its settings, its sources besides the stars, and the parameters of each method.

pub mod objects;
pub mod pyramid;
pub(crate) mod settings;
pub mod sky_cube;
mod technique;

pub(super) use technique::Glare;
pub use technique::{GlareMap, GlarePlan, VeilInSums};
