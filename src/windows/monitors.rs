//! The current monitors, and the choice of a monitor for a window.

use serde::Serialize;
use winit::{event_loop::ActiveEventLoop, monitor::MonitorHandle};

use super::platform::Desktop;
use crate::config::MonitorChoice;

/// Description of a monitor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MonitorReport {
    /// Number from 1, from left to right and then from top to bottom.
    pub number: usize,
    /// Name of its connector.
    pub name: String,
    /// Position of its upper left corner on the desktop, pixels.
    pub position: [i32; 2],
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Refreshes per second; `None` if unknown.
    pub refresh_hz: Option<f64>,
    /// Names from its EDID.
    pub edid: Vec<String>,
}

impl MonitorReport {
    /// Whether it has the same name, position and size as another monitor.
    pub(super) fn has_place_of(&self, other: &Self) -> bool {
        (&self.name, self.position, self.size) == (&other.name, other.position, other.size)
    }
}

impl std::fmt::Display for MonitorReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [width, height] = self.size;
        let [x, y] = self.position;
        write!(f, "{} {} {width}x{height} at {x},{y}", self.number, self.name)?;
        if let Some(refresh_hz) = self.refresh_hz {
            write!(f, " {refresh_hz:.2} Hz")?;
        }
        if !self.edid.is_empty() {
            write!(f, " edid {}", self.edid.join(" | "))?;
        }
        Ok(())
    }
}

/// A monitor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Monitor {
    /// Handle of the window library, on Wayland.
    pub(super) handle: Option<MonitorHandle>,
    pub(super) report: MonitorReport,
}

/// Returns all monitors in the order of their numbers: as reported by X11 if there is a connection to it, otherwise by
/// the window library.
///
/// # Errors
///
/// Error of X11.
pub(super) fn monitors(events: &ActiveEventLoop, desktop: Option<&Desktop>) -> Result<Vec<Monitor>, String> {
    let mut found: Vec<Monitor> = match desktop {
        Some(desktop) => {
            let reports = desktop.monitors().map_err(|error| format!("monitors: {error}"))?;
            reports.into_iter().map(|report| Monitor { handle: None, report }).collect()
        }
        None => events.available_monitors().map(of_library).collect(),
    };
    found.sort_by_key(|monitor| monitor.report.position);
    for (index, monitor) in found.iter_mut().enumerate() {
        monitor.report.number = index + 1;
    }
    Ok(found)
}

fn of_library(handle: MonitorHandle) -> Monitor {
    let report = MonitorReport {
        number: 0,
        name: handle.name().unwrap_or_default(),
        position: [handle.position().x, handle.position().y],
        size: [handle.size().width, handle.size().height],
        refresh_hz: handle.refresh_rate_millihertz().filter(|rate| *rate > 0).map(|rate| f64::from(rate) * 1e-3),
        edid: Vec::new(),
    };
    Monitor { handle: Some(handle), report }
}

/// Returns the monitor that contains most of a window.
pub(super) fn below(monitors: &[Monitor], place: [i32; 2], size: [u32; 2]) -> Option<&Monitor> {
    let shared = |monitor: &Monitor| -> i64 {
        let along = |axis: usize| {
            let [first, side] = [i64::from(monitor.report.position[axis]), i64::from(monitor.report.size[axis])];
            let [from, length] = [i64::from(place[axis]), i64::from(size[axis])];
            ((first + side).min(from + length) - first.max(from)).max(0)
        };
        along(0) * along(1)
    };
    monitors.iter().max_by_key(|monitor| shared(monitor)).filter(|monitor| shared(monitor) > 0)
}

/// Returns the chosen monitor; `None` chooses the first one. The error lists the existing monitors.
pub(super) fn chosen<'a>(monitors: &'a [Monitor], choice: Option<&MonitorChoice>) -> Result<&'a Monitor, String> {
    let found = monitors.iter().find(|monitor| match choice {
        None => true,
        Some(MonitorChoice::Number(number)) => monitor.report.number == *number as usize,
        Some(MonitorChoice::Name(name)) => monitor.report.name == *name,
        Some(MonitorChoice::Edid(edid)) => monitor.report.edid.contains(edid),
    });
    found.ok_or_else(|| {
        let all: Vec<String> = monitors.iter().map(|monitor| monitor.report.to_string()).collect();
        let existing = if all.is_empty() { "none".to_owned() } else { all.join("; ") };
        match choice {
            None => "there is no monitor".to_owned(),
            Some(choice) => format!("no monitor {choice}; there are: {existing}"),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor(number: usize, name: &str, position: [i32; 2], edid: &[&str]) -> Monitor {
        let edid = edid.iter().map(|name| (*name).to_owned()).collect();
        let name = name.to_owned();
        let report = MonitorReport { number, name, position, size: [1000, 800], refresh_hz: Some(60.0), edid };
        Monitor { handle: None, report }
    }

    #[test]
    fn monitors_are_chosen_by_number_name_or_edid_and_errors_list_them() {
        let all =
            [monitor(1, "DP-1", [0, 0], &[]), monitor(2, "HDMI-1", [1000, 0], &["DEL-40F1-00000123", "DELL U2720Q"])];
        let number = |choice: Option<MonitorChoice>| chosen(&all, choice.as_ref()).map(|found| found.report.number);
        assert_eq!(number(None), Ok(1));
        assert_eq!(number(Some(MonitorChoice::Number(2))), Ok(2));
        assert_eq!(number(Some(MonitorChoice::Name("HDMI-1".to_owned()))), Ok(2));
        assert_eq!(number(Some(MonitorChoice::Edid("DELL U2720Q".to_owned()))), Ok(2));
        let missing = number(Some(MonitorChoice::Number(3))).expect_err("there are only two monitors");
        assert!(
            missing.contains("no monitor number 3; there are: 1 DP-1 1000x800 at 0,0 60.00 Hz; 2 HDMI-1"),
            "{missing}"
        );
        assert_eq!(chosen(&[], None), Err("there is no monitor".to_owned()));
    }

    #[test]
    fn window_is_on_the_monitor_with_most_of_its_area() {
        let all = [monitor(1, "DP-1", [0, 0], &[]), monitor(2, "HDMI-1", [1000, 0], &[])];
        let on = |place| below(&all, place, [400, 300]).map(|found| found.report.number);
        assert_eq!([on([700, 0]), on([900, 0]), on([5000, 0])], [Some(1), Some(2), None]);
    }
}
