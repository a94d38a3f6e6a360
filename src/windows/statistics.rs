//! Statistics of windows: displayed frames and their timing. `recorder` collects them.

use serde::Serialize;

/// State of a window.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "state", content = "reason", rename_all = "snake_case")]
pub enum WindowState {
    /// It is displayed.
    Shown,
    /// Its monitor is missing, or another window fills it, with the reason. It returns with the monitor.
    MonitorMissing(String),
    /// Its view no longer exists, so it is black.
    ViewMissing,
    /// No windows can be opened, or this one cannot be opened, with the reason.
    NoDisplay(String),
    /// It was closed by the user.
    Closed,
}

impl WindowState {
    /// Returns the name that messages contain.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Shown => "shown",
            Self::MonitorMissing(_) => "monitor_missing",
            Self::ViewMissing => "view_missing",
            Self::NoDisplay(_) => "no_display",
            Self::Closed => "closed",
        }
    }

    /// Returns the reason why it is not displayed; empty if the name is the whole reason.
    pub fn reason(&self) -> &str {
        match self {
            Self::MonitorMissing(reason) | Self::NoDisplay(reason) => reason,
            Self::Shown | Self::ViewMissing | Self::Closed => "",
        }
    }
}

/// Intervals between presented frames, ms.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Intervals {
    /// Median of the last 600 intervals.
    pub median_ms: f64,
    /// 99th percentile of the last 600 intervals.
    pub p99_ms: f64,
    /// Maximum since the window was opened.
    pub longest_ms: f64,
}

/// Statistics of a window since it was opened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WindowFigures {
    /// Its name.
    pub name: String,
    /// Name of the view.
    pub view: String,
    /// Part of the view; empty for a view with one image.
    pub part: String,
    /// State.
    pub state: WindowState,
    /// Name of its monitor; empty: unknown.
    pub monitor: String,
    /// Refreshes of the monitor per second; `None`: unknown.
    pub refresh_hz: Option<f64>,
    /// Number of the displayed frame, see [`Frame::number`](crate::render::Frame::number); 0: none yet.
    pub frame_number: u64,
    /// Number of displayed frames.
    pub frames: u64,
    /// `None`: there are no two consecutive frames yet.
    pub intervals: Option<Intervals>,
    /// Refreshes without a new frame between two frames, if images wait for refreshes; `None`: images do not wait, or the rate is unknown.
    pub missed: Option<u64>,
}

impl WindowFigures {
    /// Statistics of a window that shows nothing yet.
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
