//! The end of the daemon's threads.

use std::{sync::Arc, time::Duration};

use tokio::time::Instant;

use super::ServeError;
use crate::service::{
    displays::{headset::Headset, windows::Windows},
    engine::{render_handle::RenderHandle, render_thread::RenderThread},
    threads::{RunningThread, panic_message},
};

/// Minimum time for an idle thread to end, even if clients used up the drain time.
pub(super) const FAREWELL: Duration = Duration::from_millis(500);

/// The threads of a daemon, with the handles that end them.
pub(super) struct Threads {
    pub(super) handle: RenderHandle,
    pub(super) render: RenderThread,
    pub(super) headset: Option<(Arc<Headset>, RunningThread)>,
    pub(super) windows: Option<(Arc<Windows>, RunningThread)>,
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
        // If the sender was dropped, the thread has ended too.
        let _ = (&mut self.render.ended).await;
        self.render_ended = true;
    }

    /// Waits for all threads, which have been asked to stop, until `deadline`. If little time is left until then, waits up to [`FAREWELL`].
    pub(super) async fn join(self, deadline: Instant) -> Result<(), ServeError> {
        let latest = || deadline.max(Instant::now() + FAREWELL);
        if let Some((_, thread)) = self.headset {
            join_display("the headset's thread", thread, latest()).await;
        }
        if let Some((_, thread)) = self.windows {
            join_display("the thread of the windows", thread, latest()).await;
        }
        join(self.render, self.render_ended, latest()).await
    }
}

/// Waits until `deadline` for the render thread, which has been asked to stop. A busy thread is abandoned: it holds nothing that outlives the
/// process.
async fn join(thread: RenderThread, ended: bool, deadline: Instant) -> Result<(), ServeError> {
    let result = match ended {
        true => Some(thread.join.join()),
        false => thread.result(deadline).await,
    };
    match result {
        None => {
            tracing::warn!("the render thread is still busy with a frame: ending without it");
            Ok(())
        }
        Some(Ok(end)) => end.map_err(ServeError::Lost),
        Some(Err(payload)) => Err(ServeError::Panicked { message: panic_message(payload.as_ref()) }),
    }
}

/// Waits for the thread `name` of a display in the same way. Its result is known already.
async fn join_display(name: &str, thread: RunningThread, deadline: Instant) {
    match thread.result(deadline).await {
        None => tracing::warn!("{name} is still busy: ending without it"),
        Some(Ok(())) => {}
        Some(Err(_)) => tracing::warn!("{name} did not end normally"),
    }
}
