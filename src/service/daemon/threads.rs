//! The end of the daemon's threads.

use std::{sync::Arc, time::Duration};

use tokio::time::{Instant, timeout_at};

use super::ServeError;
use crate::service::{
    displays::{
        headset::{Headset, HeadsetThread},
        windows::{Windows, WindowsThread},
    },
    engine::{render_handle::RenderHandle, render_thread::RenderThread},
    threads::panic_message,
};

/// Minimum time for an idle thread to end, even if clients used up the drain time.
pub(super) const FAREWELL: Duration = Duration::from_millis(500);

/// The threads of a daemon, and what ends them.
pub(super) struct Threads {
    pub(super) handle: RenderHandle,
    pub(super) render: RenderThread,
    pub(super) headset: Option<(Arc<Headset>, HeadsetThread)>,
    pub(super) windows: Option<(Arc<Windows>, WindowsThread)>,
    /// Whether the end of the render thread was received.
    pub(super) render_ended: bool,
}

impl Threads {
    /// Refuses new work, and ends streams.
    pub(super) fn drain(&self) {
        self.handle.drain();
        if let Some((windows, _)) = &self.windows {
            windows.drain();
        }
        if let Some((headset, _)) = &self.headset {
            headset.drain();
        }
    }

    /// Resolves when the render thread has ended by itself.
    pub(super) async fn render_end(&mut self) {
        // A sender that was dropped has ended too.
        let _ = (&mut self.render.ended).await;
        self.render_ended = true;
    }

    /// Waits for all threads, which were told to stop, until `deadline` and at least [`FAREWELL`].
    pub(super) async fn join(self, deadline: Instant) -> Result<(), ServeError> {
        if let Some((_, thread)) = self.headset {
            join_headset(thread, deadline).await;
        }
        if let Some((_, thread)) = self.windows {
            join_windows(thread, deadline).await;
        }
        join(self.render, self.render_ended, deadline).await
    }
}

/// Waits until `deadline`, and at least [`FAREWELL`], for the render thread, which was told to stop. A busy thread is
/// abandoned: it holds nothing that outlives the process.
async fn join(mut thread: RenderThread, ended: bool, deadline: Instant) -> Result<(), ServeError> {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    // The receiver must not be polled again after it has resolved.
    if !ended && timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the render thread is still busy with a frame: ending without it");
        return Ok(());
    }
    match thread.join.join() {
        Ok(end) => end.map_err(ServeError::Lost),
        Err(payload) => Err(ServeError::Panicked { message: panic_message(payload.as_ref()) }),
    }
}

/// Waits for the headset's thread in the same way. Its result is known already.
async fn join_headset(mut thread: HeadsetThread, deadline: Instant) {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    if timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the headset's thread is still busy: ending without it");
    } else if thread.join.join().is_err() {
        tracing::warn!("the headset's thread did not end in order");
    }
}

/// Waits for the thread of the windows in the same way.
async fn join_windows(mut thread: WindowsThread, deadline: Instant) {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    if timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the thread of the windows is still busy: ending without it");
    } else if thread.join.join().is_err() {
        tracing::warn!("the thread of the windows did not end in order");
    }
}
