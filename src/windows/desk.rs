//! State shared by the event thread and the presenting thread.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicBool, Ordering::Relaxed},
};

use winit::window::Window;

use super::{monitors::MonitorReport, statistics::WindowState};

/// State of a window, which events set.
#[derive(Clone, Debug)]
pub(super) struct DeskWindow {
    /// `None`: the window is not open yet.
    pub(super) window: Option<Arc<Window>>,
    /// Whether it is on a monitor.
    pub(super) shown: bool,
    /// Width and height, pixels.
    pub(super) size: [u32; 2],
    /// Name of its monitor.
    pub(super) monitor: String,
    pub(super) refresh_hz: Option<f64>,
    pub(super) state: WindowState,
    /// Number of events that made its picture stale: covered parts became visible, the window was opened, or its size changed.
    pub(super) stale: u64,
}

impl DeskWindow {
    /// Sets the monitor of the window, if known.
    pub(super) fn put_on(&mut self, monitor: Option<&MonitorReport>) {
        self.monitor = monitor.map(|monitor| monitor.name.clone()).unwrap_or_default();
        self.refresh_hz = monitor.and_then(|monitor| monitor.refresh_hz);
    }
}

/// State of all windows.
#[derive(Clone, Debug)]
pub(super) struct DeskState {
    pub(super) windows: Vec<DeskWindow>,
    /// Whether all windows are black.
    pub(super) blackout: bool,
    /// Whether each window displays its name.
    pub(super) identify: bool,
}

pub(super) struct Desk {
    state: Mutex<DeskState>,
    /// Whether the event loop has ended.
    pub(super) ended: AtomicBool,
}

impl Desk {
    pub(super) fn new(windows: usize) -> Self {
        let window = DeskWindow {
            window: None,
            shown: false,
            size: [0; 2],
            monitor: String::new(),
            refresh_hz: None,
            state: WindowState::NoDisplay("it is about to be opened".to_owned()),
            stale: 0,
        };
        let state = DeskState { windows: vec![window; windows], blackout: false, identify: false };
        Self { state: Mutex::new(state), ended: AtomicBool::new(false) }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, DeskState> {
        // No code panics while it holds the lock, so poisoned data is still consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state under its lock.
    pub(super) fn change(&self, change: impl FnOnce(&mut DeskState)) {
        change(&mut self.state());
    }

    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Relaxed)
    }
}
