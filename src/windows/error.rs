//! Why windows cannot be opened.

use crate::gpu::GpuError;

/// Why windows cannot be opened, or not be shown any more.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WindowsError {
    /// There is no display server.
    #[error("no display: {0}")]
    NoDisplay(String),
    /// The display server does not do what windows need.
    #[error("the display cannot be used: {0}")]
    Display(String),
    /// No adapter presents on the display.
    #[error("no Vulkan adapter can show images on this display; found: {0}")]
    NoAdapter(String),
    /// The surface lacks a format.
    #[error(
        "window `{window}`: format = \"{wanted}\": {adapter} does not offer it on this monitor; it offers {offered} (of \"srgb8\", \"rgb10\", \"hdr\")"
    )]
    Format {
        /// The window.
        window: String,
        /// What was asked for.
        wanted: &'static str,
        /// The adapter.
        adapter: String,
        /// What there is.
        offered: String,
    },
    /// A window cannot be made.
    #[error("window `{window}` cannot be opened: {problem}")]
    Window {
        /// The window.
        window: String,
        /// What the system says.
        problem: String,
    },
    /// The device of the windows failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The driver refused something.
    #[error("the adapter of the windows refused a frame: {0}")]
    Refused(String),
}
