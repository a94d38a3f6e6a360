//! The twins of overlays.

pub mod draw;
