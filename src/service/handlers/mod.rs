//! The gRPC methods: each converts a request to plain values, asks the render thread, and converts the answer to a message.

pub(crate) mod camera;
pub(crate) mod diagnostics;
pub(crate) mod find;
pub(crate) mod identify;
pub(crate) mod metrics;
pub(crate) mod next_frame;
pub(crate) mod scene_changes;
pub(crate) mod service;
pub(crate) mod stats;
pub(crate) mod test_pattern_key;
pub(crate) mod view_changes;
