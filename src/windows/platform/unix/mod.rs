//! X11 and Wayland.

mod display;
mod display_loss;
mod edid;
mod x11;

use std::sync::Arc;

use winit::{
    event_loop::{ActiveEventLoop, EventLoopBuilder},
    platform::{
        wayland::EventLoopBuilderExtWayland,
        x11::{ActiveEventLoopExtX11, EventLoopBuilderExtX11},
    },
    window::Window,
};

pub use self::display::check_display;
pub(in crate::windows) use self::{display_loss::outlive_the_display, x11::X11 as Desktop};

/// Lets the event loop run on any thread.
pub(in crate::windows) fn on_any_thread<T>(builder: &mut EventLoopBuilder<T>) {
    EventLoopBuilderExtX11::with_any_thread(builder, true);
    EventLoopBuilderExtWayland::with_any_thread(builder, true);
}

/// Returns the window in a form from which surfaces can be created on any thread.
pub(in crate::windows) fn surface_target(window: Arc<Window>) -> impl Into<wgpu::SurfaceTarget<'static>> {
    window
}

impl Desktop {
    /// Opens a separate connection if the display is X11.
    ///
    /// # Errors
    ///
    /// Error of X11.
    pub(in crate::windows) fn of(events: &ActiveEventLoop) -> Result<Option<Self>, String> {
        events.is_x11().then(Self::connect).transpose()
    }
}
