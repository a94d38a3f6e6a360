//! The passes in f64 on the CPU, under the same names: slow and simple, to check the GPU by and to draw through
//! projections of your own.

pub mod billboards;
pub mod cell_sky;
pub mod gaussian;
pub mod stars;
