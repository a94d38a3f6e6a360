//! Windows on the monitors of this machine: each shows an image of a view, full screen or decorated.
//!
//! ```text
//! host (scene, views)  --frames-->  presenting thread  --surfaces-->  monitors
//! event thread (winit)  --windows, sizes, keys, monitors-->  presenting thread, host
//! ```
//!
//! The thread that calls `open` runs the event loop. The presenting thread takes one frame at a time, draws the images of all windows from it, and
//! presents them together, so that all windows show the same frame. It has a separate device, which is on the adapter of the renderer if that adapter
//! can present: images come from the renderer's host memory, as for encoding and files, including the shares of projectors. Windows are thus
//! independent of a lost device, of a headset, and of an adapter that can only compute.
//!
//! `open` needs the feature `windows`; without it this module contains only the types with which the service describes
//! windows.

#[cfg(feature = "windows")]
mod adapter;
#[cfg(feature = "windows")]
mod desk;
#[cfg(feature = "windows")]
mod error;
#[cfg(feature = "windows")]
mod events;
mod host;
#[cfg(feature = "windows")]
mod monitors;
#[cfg(feature = "windows")]
mod picture;
#[cfg(feature = "windows")]
mod pixels;
#[cfg(feature = "windows")]
mod plate;
#[cfg(feature = "windows")]
mod platform;
#[cfg(feature = "windows")]
mod presenter;
#[cfg(feature = "windows")]
mod recorder;
#[cfg(feature = "windows")]
mod screen;
mod statistics;

#[cfg(feature = "windows")]
pub use self::{
    error::WindowsError,
    events::{WithoutDisplay, monitors, open},
    monitors::MonitorReport,
    platform::check_display,
};
pub use self::{
    host::{Command, Host, Next, ShownImage, WindowFrame, WindowImage},
    statistics::{Intervals, WindowFigures, WindowState},
};
