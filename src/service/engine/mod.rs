//! The render thread, which alone owns the renderer, and the threads that work for it.

pub(crate) mod auditor;
pub(crate) mod background_jobs;
pub(crate) mod camera_path;
pub(crate) mod forecast;
pub(crate) mod interface;
pub(crate) mod led;
pub(crate) mod quality;
pub(crate) mod render_handle;
pub(crate) mod render_thread;
pub(crate) mod shared_state;
pub(crate) mod stage;
