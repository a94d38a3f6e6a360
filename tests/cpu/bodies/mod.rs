//! Tests of bodies that need no adapter.

mod curves;
mod light;
