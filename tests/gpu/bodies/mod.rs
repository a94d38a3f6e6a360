//! Bodies on the adapter.

mod light;
