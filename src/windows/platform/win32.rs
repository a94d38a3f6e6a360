//! Win32. The window library suffices: it lists monitors, fills them and assigns the focus. EDIDs are not read.

use winit::{
    event_loop::{ActiveEventLoop, EventLoopBuilder},
    platform::windows::EventLoopBuilderExtWindows,
    window::Window,
};

use crate::windows::{WindowsError, monitors::MonitorReport};

/// Checks whether windows can be opened: every session of Windows has a desktop. A service without one gets the error when the event loop starts.
///
/// # Errors
///
/// None.
pub fn check_display() -> Result<(), WindowsError> {
    Ok(())
}

/// Nothing to do: the desktop does not end before its programs.
///
/// # Errors
///
/// None.
pub(in crate::windows) fn outlive_the_display() -> Result<(), String> {
    Ok(())
}

/// Lets the event loop run on any thread.
pub(in crate::windows) fn on_any_thread<T>(builder: &mut EventLoopBuilder<T>) {
    builder.with_any_thread(true);
}

/// What the window library lacks: nothing, so no value exists.
pub(in crate::windows) enum Desktop {}

impl Desktop {
    /// Returns none.
    ///
    /// # Errors
    ///
    /// None.
    pub(in crate::windows) fn of(_: &ActiveEventLoop) -> Result<Option<Self>, String> {
        Ok(None)
    }

    /// Returns the active monitors, without numbers.
    pub(in crate::windows) fn monitors(&self) -> Result<Vec<MonitorReport>, String> {
        match *self {}
    }

    /// Lets a window fill its monitor.
    pub(in crate::windows) fn fill(&self, _: &Window, _: bool) -> Result<(), String> {
        match *self {}
    }

    /// Gives the keyboard focus to a window.
    pub(in crate::windows) fn focus_if_unassigned(&self, _: &Window) -> Result<(), String> {
        match *self {}
    }
}
