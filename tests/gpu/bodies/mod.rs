//! Tests of bodies on the adapter.

mod corona;
mod curves;
mod light;
mod rings;
