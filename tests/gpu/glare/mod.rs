//! Glare on the adapter.

mod objects;
mod pyramid;
mod sky_cube;
