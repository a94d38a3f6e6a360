//! Bodies on the adapter.

mod corona;
mod light;
mod rings;
