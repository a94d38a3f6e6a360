//! Displays of the daemon's machine: the headset and the windows, each driven by its own thread.

pub(crate) mod headset;
pub(crate) mod windows;
