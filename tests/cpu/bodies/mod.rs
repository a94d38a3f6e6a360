//! Bodies without an adapter.

mod light;
