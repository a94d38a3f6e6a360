//! Twins of the passes that draw bodies.

pub mod rays;
