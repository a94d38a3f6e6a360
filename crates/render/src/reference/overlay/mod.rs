//! Twins of the overlay passes.

pub mod draw;
