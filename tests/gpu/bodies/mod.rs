//! Bodies on the adapter.

mod light;
mod rings;
