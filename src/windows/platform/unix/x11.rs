//! Functions that the window library lacks on X11, through a separate connection: monitors by RandR, because the events
//! about their changes do not reach the library; EDIDs; windows that fill monitors unknown to the library; and the
//! keyboard focus if no window manager assigns it.

use x11rb::{
    connection::Connection,
    errors::ReplyError,
    protocol::{
        randr::{self, ConnectionExt as _},
        xproto::{AtomEnum, ClientMessageEvent, ConnectionExt as _, EventMask, InputFocus, MapState, PropMode},
    },
    rust_connection::RustConnection,
    wrapper::ConnectionExt as _,
};

use winit::{
    raw_window_handle::{HasWindowHandle, RawWindowHandle},
    window::Window,
};

use super::edid;
use crate::windows::monitors::MonitorReport;

/// Maximum length of a requested EDID, 32-bit words. It is enough for four blocks.
const EDID_WORDS: u32 = 128;
/// Source indication of `_NET_WM_STATE`: a normal application.
const SOURCE: u32 = 1;

/// A separate connection.
pub(in crate::windows) struct X11 {
    connection: RustConnection,
    root: u32,
    edid: u32,
    manager: u32,
    state: u32,
    fullscreen: u32,
}

impl X11 {
    /// Connects to `DISPLAY`; the error comes from the system.
    pub(super) fn connect() -> Result<Self, String> {
        let (connection, screen) = x11rb::connect(None).map_err(|error| error.to_string())?;
        let root = connection.setup().roots.get(screen).map(|screen| screen.root);
        let root = root.ok_or_else(|| format!("the display has no screen {screen}"))?;
        let named = || -> Result<[u32; 4], ReplyError> {
            let names = ["EDID", "_NET_SUPPORTING_WM_CHECK", "_NET_WM_STATE", "_NET_WM_STATE_FULLSCREEN"];
            let mut atoms = [0; 4];
            for (atom, name) in atoms.iter_mut().zip(names) {
                *atom = connection.intern_atom(false, name.as_bytes())?.reply()?.atom;
            }
            Ok(atoms)
        };
        let [edid, manager, state, fullscreen] = named().map_err(|error| error.to_string())?;
        Ok(Self { connection, root, edid, manager, state, fullscreen })
    }

    /// Returns the active monitors, without numbers.
    pub(in crate::windows) fn monitors(&self) -> Result<Vec<MonitorReport>, ReplyError> {
        let connection = &self.connection;
        let resources = connection.randr_get_screen_resources_current(self.root)?.reply()?;
        let mut monitors = Vec::new();
        for &id in &resources.crtcs {
            let crtc = connection.randr_get_crtc_info(id, resources.config_timestamp)?.reply()?;
            let Some(&output) = crtc.outputs.first().filter(|_| crtc.width > 0 && crtc.height > 0) else { continue };
            let info = connection.randr_get_output_info(output, resources.config_timestamp)?.reply()?;
            let edid =
                connection.randr_get_output_property(output, self.edid, AtomEnum::ANY, 0, EDID_WORDS, false, false)?;
            monitors.push(MonitorReport {
                number: 0,
                name: String::from_utf8_lossy(&info.name).into_owned(),
                position: [i32::from(crtc.x), i32::from(crtc.y)],
                size: [u32::from(crtc.width), u32::from(crtc.height)],
                refresh_hz: resources.modes.iter().find(|mode| mode.id == crtc.mode).and_then(refresh_hz),
                edid: edid::names(&edid.reply()?.data),
            });
        }
        Ok(monitors)
    }

    /// Asks the window manager to let a window fill its monitor, or to undo that. Without a window manager this has no
    /// effect: position and size are then sufficient.
    pub(in crate::windows) fn fill(&self, window: &Window, fills: bool) -> Result<(), ReplyError> {
        let connection = &self.connection;
        let Some(window) = identity(window) else { return Ok(()) };
        if connection.get_window_attributes(window)?.reply()?.map_state == MapState::UNMAPPED {
            // Set the state that the window has when it becomes visible.
            let states = if fills { &[self.fullscreen][..] } else { &[] };
            connection.change_property32(PropMode::REPLACE, window, self.state, AtomEnum::ATOM, states)?;
        } else {
            let data = [u32::from(fills), self.fullscreen, 0, SOURCE, 0];
            let asked = ClientMessageEvent::new(32, window, self.state, data);
            let mask = EventMask::SUBSTRUCTURE_REDIRECT | EventMask::SUBSTRUCTURE_NOTIFY;
            connection.send_event(false, self.root, mask, asked)?;
        }
        connection.sync()
    }

    /// Gives the keyboard focus to a window if there is no window manager and no window has it.
    pub(in crate::windows) fn focus_if_unassigned(&self, window: &Window) -> Result<(), ReplyError> {
        let connection = &self.connection;
        let Some(window) = identity(window) else { return Ok(()) };
        let manager = connection.get_property(false, self.root, self.manager, AtomEnum::WINDOW, 0, 1)?.reply()?;
        // The focus is on the root, or follows the pointer.
        let unassigned = [u32::from(InputFocus::NONE), u32::from(InputFocus::POINTER_ROOT), self.root];
        let focus = connection.get_input_focus()?.reply()?.focus;
        if manager.value_len > 0 || !unassigned.contains(&focus) {
            return Ok(());
        }
        if connection.get_window_attributes(window)?.reply()?.map_state == MapState::VIEWABLE {
            connection.set_input_focus(InputFocus::POINTER_ROOT, window, x11rb::CURRENT_TIME)?.check()?;
        }
        Ok(())
    }
}

/// Returns the X11 identifier of a window; `None` if it is not an X11 window.
fn identity(window: &Window) -> Option<u32> {
    match window.window_handle().ok()?.as_raw() {
        RawWindowHandle::Xlib(handle) => u32::try_from(handle.window).ok(),
        _ => None,
    }
}

/// Returns the refreshes per second of a mode; `None`: unknown.
fn refresh_hz(mode: &randr::ModeInfo) -> Option<f64> {
    let (lines, pixels) = (f64::from(mode.vtotal), f64::from(mode.htotal));
    let lines = match mode.mode_flags {
        flags if flags.contains(randr::ModeFlag::DOUBLE_SCAN) => lines * 2.0,
        flags if flags.contains(randr::ModeFlag::INTERLACE) => lines / 2.0,
        _ => lines,
    };
    (mode.dot_clock > 0 && lines * pixels > 0.0).then(|| f64::from(mode.dot_clock) / (lines * pixels))
}
