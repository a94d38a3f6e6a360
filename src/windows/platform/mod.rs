//! Window systems: X11 and Wayland on Unix, Win32 on Windows, with the same interface.
//!
//! - [`check_display`] checks whether windows can be opened,
//! - [`outlive_the_display`] keeps the program alive when the display ends,
//! - [`on_any_thread`] lets the event loop run on a thread that is not the main one,
//! - [`surface_target`] returns a window in a form that allows surfaces to be created outside of the event thread,
//! - [`Desktop`] has features that the window library lacks: on X11 monitors with EDIDs, windows that fill them, and the keyboard focus.

#[cfg(all(unix, not(target_vendor = "apple")))]
mod unix;
#[cfg(all(unix, not(target_vendor = "apple")))]
pub use self::unix::check_display;
#[cfg(all(unix, not(target_vendor = "apple")))]
pub(super) use self::unix::{Desktop, on_any_thread, outlive_the_display, surface_target};

#[cfg(windows)]
mod win32;
#[cfg(windows)]
pub use self::win32::check_display;
#[cfg(windows)]
pub(super) use self::win32::{Desktop, on_any_thread, outlive_the_display, surface_target};

#[cfg(not(any(windows, all(unix, not(target_vendor = "apple")))))]
compile_error!("the feature `windows` supports only X11, Wayland and Win32: build without it");
