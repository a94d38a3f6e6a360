//! Asteroids on the adapter.

mod fields;
