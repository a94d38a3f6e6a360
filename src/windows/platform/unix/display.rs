//! Checks whether there is a display for windows, before the window library is used: the library makes only one attempt per process, and a daemon may
//! start before its display.

use std::{
    env,
    ffi::OsString,
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
};

use crate::windows::WindowsError;

/// Checks whether a display server answers.
///
/// # Errors
///
/// [`WindowsError::NoDisplay`]: there is none, or it refuses this program.
pub fn check_display() -> Result<(), WindowsError> {
    let variable = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    check(variable("WAYLAND_DISPLAY"), variable("XDG_RUNTIME_DIR"), variable("DISPLAY"))
}

fn check(wayland: Option<OsString>, folder: Option<OsString>, x11: Option<OsString>) -> Result<(), WindowsError> {
    let missing = |problem: String| Err(WindowsError::NoDisplay(problem));
    if let Some(name) = wayland {
        let socket: PathBuf = Path::new(&folder.unwrap_or_default()).join(&name);
        return match UnixStream::connect(&socket) {
            Ok(_) => Ok(()),
            Err(error) => missing(format!("WAYLAND_DISPLAY is {}, and {}: {error}", name.display(), socket.display())),
        };
    }
    if let Some(name) = x11 {
        return match x11rb::connect(name.to_str()) {
            Ok(_) => Ok(()),
            Err(error) => missing(format!("DISPLAY is {}, which does not answer: {error}", name.display())),
        };
    }
    missing("neither WAYLAND_DISPLAY nor DISPLAY is set; start a display server and set one of them".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_display_is_named_in_the_error() {
        let error = |wayland: Option<&str>, x11: Option<&str>| {
            let os = |text: Option<&str>| text.map(OsString::from);
            check(os(wayland), os(Some("/nowhere")), os(x11)).map_err(|error| error.to_string())
        };
        let neither = error(None, None).expect_err("there is no display");
        assert!(neither.contains("neither WAYLAND_DISPLAY nor DISPLAY"), "{neither}");
        let wayland = error(Some("wayland-9"), None).expect_err("there is no display");
        assert!(wayland.contains("/nowhere/wayland-9"), "{wayland}");
        let x11 = error(None, Some(":4711")).expect_err("there is no display");
        assert!(x11.contains("DISPLAY is :4711"), "{x11}");
    }
}
