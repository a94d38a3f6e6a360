//! Handles the end of the X server: by default Xlib exits the program.
//!
//! This is the only file of the module with unsafe code: each block states why it is sound.
#![expect(unsafe_code, reason = "Xlib takes a C function")]

use std::{ffi::c_int, thread};

use x11_dl::xlib::{Display, Xlib};

/// Keeps the program alive when the connection to an X server breaks. The thread that detects the loss is blocked forever, because Xlib exits the
/// program if the handler returns. Use this only in programs that can continue without that thread.
///
/// # Errors
///
/// Xlib cannot be loaded.
pub(in crate::windows) fn outlive_the_display() -> Result<(), String> {
    let xlib = Xlib::open().map_err(|error| error.to_string())?;
    // SAFETY: the function has the type that Xlib requires, never returns and does not use the display.
    unsafe { (xlib.XSetIOErrorHandler)(Some(stay)) };
    Ok(())
}

/// Error handler that Xlib calls when a connection has broken.
unsafe extern "C" fn stay(_: *mut Display) -> c_int {
    tracing::error!("the X server has ended: the windows are closed; everything else continues");
    loop {
        thread::park();
    }
}
