//! Whether there is a display to open windows on. Asked beforehand: the library for windows makes one attempt for each process, and a daemon may be
//! started before its display.

use std::{
    env,
    ffi::OsString,
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
};

use super::WindowsError;

/// Whether a display server answers.
///
/// # Errors
///
/// [`WindowsError::NoDisplay`]: there is none, or it does not let this program in.
pub fn check_display() -> Result<(), WindowsError> {
    let given = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    check(given("WAYLAND_DISPLAY"), given("XDG_RUNTIME_DIR"), given("DISPLAY"))
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
    missing("neither WAYLAND_DISPLAY nor DISPLAY is set; start a display server, or name it there".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_told() {
        let told = |wayland: Option<&str>, x11: Option<&str>| {
            let os = |text: Option<&str>| text.map(OsString::from);
            check(os(wayland), os(Some("/nowhere")), os(x11)).map_err(|error| error.to_string())
        };
        let neither = told(None, None).expect_err("there is none");
        assert!(neither.contains("neither WAYLAND_DISPLAY nor DISPLAY"), "{neither}");
        let wayland = told(Some("wayland-9"), None).expect_err("there is none");
        assert!(wayland.contains("/nowhere/wayland-9"), "{wayland}");
        let x11 = told(None, Some(":4711")).expect_err("there is none");
        assert!(x11.contains("DISPLAY is :4711"), "{x11}");
    }
}
