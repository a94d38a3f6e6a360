//! Win32. The window library suffices: it lists monitors, fills them and assigns the focus. EDIDs are not read.
#![expect(unsafe_code, reason = "the window library gives window handles to other threads by an unsafe function only")]

use std::sync::Arc;

use winit::{
    event_loop::{ActiveEventLoop, EventLoopBuilder},
    platform::windows::{EventLoopBuilderExtWindows, WindowExtWindows},
    raw_window_handle::{DisplayHandle, HandleError, HasDisplayHandle, HasWindowHandle, WindowHandle},
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

/// Does nothing, because the desktop does not end before its programs.
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

/// A window for which surfaces can be created on any thread.
#[derive(Debug)]
struct OnAnyThread(Arc<Window>);

impl HasWindowHandle for OnAnyThread {
    fn window_handle(&self) -> Result<WindowHandle<'_>, HandleError> {
        // SAFETY: the handle is only used to create a Vulkan surface and to present to it, which Vulkan allows on any thread, and the window lives as
        // long as this value, which the surface owns.
        unsafe { self.0.window_handle_any_thread() }
    }
}

impl HasDisplayHandle for OnAnyThread {
    fn display_handle(&self) -> Result<DisplayHandle<'_>, HandleError> {
        self.0.display_handle()
    }
}

/// Returns the window in a form from which surfaces can be created on any thread.
pub(in crate::windows) fn surface_target(window: Arc<Window>) -> impl Into<wgpu::SurfaceTarget<'static>> {
    OnAnyThread(window)
}

/// Features that the window library lacks. There are none on Windows, so no value of this type exists.
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
