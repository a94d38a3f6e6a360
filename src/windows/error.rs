//! Errors of windows.

use crate::gpu::GpuError;

/// Reason why windows cannot be opened, or no longer be shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WindowsError {
    /// There is no display server.
    #[error("no display: {0}")]
    NoDisplay(String),
    /// The display server lacks something that windows need.
    #[error("the display cannot be used: {0}")]
    Display(String),
    /// No adapter can present on the display.
    #[error("no Vulkan adapter can present on this display; found: {0}")]
    NoAdapter(String),
    /// The surface does not support a format.
    #[error(
        "window `{window}`: format = \"{wanted}\": {adapter} does not support it on this monitor, but supports {offered} (of \"srgb8\", \"rgb10\", \"hdr\")"
    )]
    Format {
        /// Name of the window.
        window: String,
        /// Requested format.
        wanted: &'static str,
        /// Name of the adapter.
        adapter: String,
        /// Supported formats.
        offered: String,
    },
    /// A window cannot be created.
    #[error("window `{window}` cannot be opened: {problem}")]
    Window {
        /// Name of the window.
        window: String,
        /// Error of the window system.
        problem: String,
    },
    /// The device of the windows failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The driver refused a frame.
    #[error("the adapter of the windows refused a frame: {0}")]
    Refused(String),
}
