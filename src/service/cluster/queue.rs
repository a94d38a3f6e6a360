//! A bounded queue into the thread of a director or node. Callbacks of the network never wait.

use std::sync::{
    atomic::{AtomicU64, Ordering::Relaxed},
    mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
};

/// Maximum number of waiting events. If the thread falls further behind, messages are lost, as in a network.
const MOST_EVENTS: usize = 4096;

/// The sending side.
pub(super) struct Queue<T> {
    sender: SyncSender<T>,
    lost: AtomicU64,
}

impl<T> Queue<T> {
    pub(super) fn new() -> (Self, Receiver<T>) {
        let (sender, receiver) = sync_channel(MOST_EVENTS);
        (Self { sender, lost: AtomicU64::new(0) }, receiver)
    }

    /// Adds an event. It is lost if the queue is full, or the thread has ended.
    pub(super) fn push(&self, event: T) {
        if let Err(TrySendError::Full(_)) = self.sender.try_send(event)
            && self.lost.fetch_add(1, Relaxed) == 0
        {
            tracing::warn!("cluster: the queue of events is full, messages are lost");
        }
    }

    /// Adds an event that must not be lost; waits while the queue is full.
    pub(super) fn push_surely(&self, event: T) {
        // The thread has ended.
        let _ = self.sender.send(event);
    }
}
