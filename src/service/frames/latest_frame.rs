//! Latest-wins slot between a rendering thread and one subscriber: it holds the newest frame, counts the frames that
//! were replaced before the subscriber took them, and never blocks the thread.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use tokio::sync::Notify;

use super::{errors::RenderFailure, rendered_frame::RenderedFrame};

#[derive(Debug, Default)]
struct State {
    frame: Option<Arc<RenderedFrame>>,
    dropped: u64,
    end: Option<Result<(), RenderFailure>>,
}

/// The slot of one subscriber.
#[derive(Debug)]
pub(crate) struct LatestFrame {
    state: Mutex<State>,
    changed: Notify,
    /// Number of frames dropped by all slots.
    dropped_in_all: Arc<AtomicU64>,
}

impl LatestFrame {
    /// Creates an empty slot; its dropped frames are also added to `dropped_in_all`.
    pub(crate) fn new(dropped_in_all: Arc<AtomicU64>) -> Self {
        Self { state: Mutex::default(), changed: Notify::new(), dropped_in_all }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores the newest frame. A frame that was not taken is dropped and counted.
    pub(crate) fn offer(&self, frame: Arc<RenderedFrame>) {
        let mut state = self.state();
        if state.end.is_some() {
            return;
        }
        let overwritten = state.frame.replace(frame);
        if overwritten.is_some() {
            state.dropped += 1;
            self.dropped_in_all.fetch_add(1, Relaxed);
        }
        drop(state);
        self.changed.notify_one();
    }

    /// Ends the slot: no frame will follow. A stored frame is still delivered. Only the first end counts.
    pub(crate) fn end(&self, how: Result<(), RenderFailure>) {
        self.state().end.get_or_insert(how);
        self.changed.notify_one();
    }

    /// Waits until no frame will follow. Must be called only by the slot's reader.
    pub(crate) async fn ended(&self) {
        while self.state().end.is_none() {
            self.changed.notified().await;
        }
    }

    /// Waits for the newest frame; returns it with the number of frames dropped so far. `None`: no frame will follow. Must be called by one reader
    /// only.
    pub(crate) async fn next(&self) -> Result<Option<(Arc<RenderedFrame>, u64)>, RenderFailure> {
        loop {
            {
                let mut state = self.state();
                if let Some(frame) = state.frame.take() {
                    return Ok(Some((frame, state.dropped)));
                }
                if let Some(end) = &state.end {
                    return end.clone().map(|()| None);
                }
            }
            // A notification after the release of the lock is stored, so none is lost.
            self.changed.notified().await;
        }
    }
}
