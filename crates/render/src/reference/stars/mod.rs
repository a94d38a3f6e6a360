//! Twins of the passes that draw stars.

pub mod billboards;
pub mod cell_sky;
pub mod gaussian;
pub mod packed;
pub mod point_spread;
pub mod splat;
