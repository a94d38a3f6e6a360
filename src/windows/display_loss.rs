//! What becomes of the program when its X server ends: Xlib exits it, unless somebody keeps it from doing so.
//!
//! The only place of this module where code is not checked by the compiler: each block says why it holds.
#![expect(unsafe_code, reason = "Xlib takes a function of C")]

use std::{ffi::c_int, thread};

use x11_dl::xlib::{Display, Xlib};

/// From now on the program lives on when the connection to an X server breaks. The thread that finds it broken stays where it is for ever, since Xlib
/// exits the program when it is let go; so this is for programs that can do without that thread.
///
/// # Errors
///
/// Xlib cannot be loaded.
pub(super) fn outlive_the_display() -> Result<(), String> {
    let xlib = Xlib::open().map_err(|error| error.to_string())?;
    // SAFETY: the function has the type that Xlib asks for, never returns and touches nothing of the display.
    unsafe { (xlib.XSetIOErrorHandler)(Some(stay)) };
    Ok(())
}

/// Called by Xlib when a connection has broken.
unsafe extern "C" fn stay(_: *mut Display) -> c_int {
    tracing::error!("the X server has ended: there are no windows any more; all else goes on");
    loop {
        thread::park();
    }
}
