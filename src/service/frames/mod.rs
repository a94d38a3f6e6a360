//! Frames on their way from a rendering thread to clients: subscriptions, pacing, encoding and video.

pub(crate) mod errors;
pub(crate) mod frame_stream;
pub(crate) mod image_encoding;
pub(crate) mod latest_frame;
pub(crate) mod rendered_frame;
pub(crate) mod schedule;
pub(crate) mod stream_budget;
pub(crate) mod subscriptions;
pub(crate) mod video;
