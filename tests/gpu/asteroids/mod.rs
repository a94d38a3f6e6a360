//! Asteroids on the adapter.

mod fields;
mod splats;
