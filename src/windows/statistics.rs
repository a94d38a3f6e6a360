//! Figures of windows: what they show, and how evenly. `recorder` collects them.

use serde::Serialize;

/// How it stands with a window.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "state", content = "reason", rename_all = "snake_case")]
pub enum WindowState {
    /// It is shown.
    Shown,
    /// Its monitor is not there, or another window fills it: why. It comes back with the monitor.
    MonitorMissing(String),
    /// The view that it shows is not there any more: it is black.
    ViewMissing,
    /// Windows cannot be opened, or not this one: why.
    NoDisplay(String),
    /// Somebody has closed it.
    Closed,
}

impl WindowState {
    /// Its name in messages and on the wire.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Shown => "shown",
            Self::MonitorMissing(_) => "monitor_missing",
            Self::ViewMissing => "view_missing",
            Self::NoDisplay(_) => "no_display",
            Self::Closed => "closed",
        }
    }

    /// Why it is not shown, where there is more to say than the name does.
    pub fn reason(&self) -> &str {
        match self {
            Self::MonitorMissing(reason) | Self::NoDisplay(reason) => reason,
            Self::Shown | Self::ViewMissing | Self::Closed => "",
        }
    }
}

/// Times from one frame's being handed to the monitor to the next one's, ms.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Intervals {
    /// Half of the last 600 are below.
    pub median_ms: f64,
    /// Of a hundred of the last 600 one is above.
    pub p99_ms: f64,
    /// The longest since the window was opened.
    pub longest_ms: f64,
}

/// Figures of a window since it was opened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WindowFigures {
    /// Its name.
    pub name: String,
    /// Name of the view.
    pub view: String,
    /// Which image of it; empty for a view's only one.
    pub part: String,
    /// How it stands.
    pub state: WindowState,
    /// Name of the monitor that it is on; empty: not known.
    pub monitor: String,
    /// Refreshes of the monitor per second; `None`: the system does not tell.
    pub refresh_hz: Option<f64>,
    /// Number of the frame that it shows, see [`Frame::number`](crate::render::Frame::number); 0: none yet.
    pub frame_number: u64,
    /// Frames that it has shown.
    pub frames: u64,
    /// `None`: there are no two frames yet, one after the other.
    pub intervals: Option<Intervals>,
    /// Refreshes between two frames that no new one came for, where images wait for refreshes; `None`: it does not wait, or their rate is not
    /// known.
    pub missed: Option<u64>,
}

impl WindowFigures {
    /// A window that shows nothing yet.
    pub fn new(name: &str, view: &str, part: &str, state: WindowState) -> Self {
        Self {
            name: name.to_owned(),
            view: view.to_owned(),
            part: part.to_owned(),
            state,
            monitor: String::new(),
            refresh_hz: None,
            frame_number: 0,
            frames: 0,
            intervals: None,
            missed: None,
        }
    }
}
