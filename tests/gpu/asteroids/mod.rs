//! Tests of asteroids on the adapter.

mod fields;
mod splats;
