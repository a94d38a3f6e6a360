//! The headset and the windows of a daemon, and the start of their threads.

use std::{io, sync::Arc};

use tokio::sync::mpsc;

use crate::{
    config::WindowConfig,
    service::{
        displays::{
            headset::{Drive, Headset, HeadsetOptions},
            windows::{OpenWindows, Windows, WindowsOptions},
        },
        engine::render_handle::RenderHandle,
        handlers::service::Service,
        threads::RunningThread,
    },
};

/// A display with its running thread.
type Running<T> = Option<(Arc<T>, RunningThread)>;

/// Displays whose threads have not started.
pub(super) struct Displays {
    headset: Option<(Arc<Headset>, Drive)>,
    windows: Option<(Arc<Windows>, PendingWindows)>,
}

/// The function that opens the windows, the definitions of the windows, and the receiver of presses of the test pattern key.
struct PendingWindows {
    open: OpenWindows,
    definitions: Vec<WindowConfig>,
    pressed: mpsc::Receiver<()>,
}

impl Displays {
    /// Creates the displays. Needs a tokio runtime.
    pub(super) fn new(headset: Option<HeadsetOptions>, windows: Option<WindowsOptions>, render: &RenderHandle) -> Self {
        let headset =
            headset.map(|HeadsetOptions { name, drive }| (Arc::new(Headset::new(name, render.clone())), drive));
        let windows = windows.map(|WindowsOptions { windows: definitions, open }| {
            let (windows, pressed) = Windows::new(definitions.clone(), render.clone());
            (Arc::new(windows), PendingWindows { open, definitions, pressed })
        });
        Self { headset, windows }
    }

    /// Returns the displays as the service sees them.
    pub(super) fn shared(&self) -> (Option<Arc<Headset>>, Option<Arc<Windows>>) {
        let headset = self.headset.as_ref().map(|(headset, _)| Arc::clone(headset));
        (headset, self.windows.as_ref().map(|(windows, _)| Arc::clone(windows)))
    }

    /// Starts the threads, and the task that applies the test pattern key to the scene.
    ///
    /// # Errors
    ///
    /// The system refuses a thread.
    pub(super) fn spawn(self, service: &Service) -> io::Result<(Running<Headset>, Running<Windows>)> {
        let headset = match self.headset {
            Some((headset, drive)) => {
                let thread = headset.spawn(drive)?;
                Some((headset, thread))
            }
            None => None,
        };
        let windows = match self.windows {
            Some((windows, PendingWindows { open, definitions, pressed })) => {
                // The task ends with the windows.
                tokio::spawn(service.clone().keep_test_patterns(definitions, pressed));
                let thread = windows.spawn(open)?;
                Some((windows, thread))
            }
            None => None,
        };
        Ok((headset, windows))
    }
}
