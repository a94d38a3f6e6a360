//! What the thread of the events and the presenting thread share.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicBool, Ordering::Relaxed},
};

use winit::window::Window;

use super::{monitors::MonitorReport, statistics::WindowState};

/// A window as the events have left it.
#[derive(Clone, Debug)]
pub(super) struct DeskWindow {
    /// `None`: it was not opened yet.
    pub(super) window: Option<Arc<Window>>,
    /// Whether it is on a monitor.
    pub(super) shown: bool,
    /// Width and height, pixels.
    pub(super) size: [u32; 2],
    /// Name of its monitor.
    pub(super) monitor: String,
    pub(super) refresh_hz: Option<f64>,
    pub(super) state: WindowState,
    /// Counts what makes its picture stale: parts that were covered are seen again, it was opened or has another size.
    pub(super) stale: u64,
}

impl DeskWindow {
    /// It is on this monitor, or on none that is known.
    pub(super) fn put_on(&mut self, monitor: Option<&MonitorReport>) {
        self.monitor = monitor.map(|monitor| monitor.name.clone()).unwrap_or_default();
        self.refresh_hz = monitor.and_then(|monitor| monitor.refresh_hz);
    }
}

/// All of it.
#[derive(Clone, Debug)]
pub(super) struct DeskState {
    pub(super) windows: Vec<DeskWindow>,
    /// Everything is black.
    pub(super) blackout: bool,
    /// Each window says what it is.
    pub(super) identify: bool,
}

pub(super) struct Desk {
    state: Mutex<DeskState>,
    /// The events have ended.
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
        // Nothing can panic while the lock is held, so what is poisoned is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes something.
    pub(super) fn change(&self, change: impl FnOnce(&mut DeskState)) {
        change(&mut self.state());
    }

    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Relaxed)
    }
}
