//! Bodies without an adapter.

mod curves;
mod light;
