//! Tests of glare on the adapter.

mod display_budget;
mod objects;
mod pyramid;
mod sky_cube;
