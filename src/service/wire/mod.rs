//! Conversion between protobuf messages and plain types, and error statuses with details that programs can read.

pub(crate) mod camera;
pub(crate) mod diagnostics;
pub(crate) mod encoding;
pub(crate) mod objects;
pub(crate) mod observer;
pub(crate) mod overlay;
pub(crate) mod refusals;
pub(crate) mod scene;
pub(crate) mod views;
