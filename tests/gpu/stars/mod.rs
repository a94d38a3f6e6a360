//! Tests of stars on the adapter.

mod billboards;
mod cell_sky;
mod deep;
mod deep_audit;
mod light;
mod packed;
mod reference;
mod relativity;
mod sums;
mod whole_sky;
