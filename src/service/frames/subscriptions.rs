//! Subscriptions to frames: their maximum number, and the total of dropped frames.
//!
//! A subscription owns its slot; the rendering thread holds a weak reference, so it notices when the subscription ends.
//! Streams with acknowledgements have a random number that only their client knows.

use std::{
    collections::HashMap,
    hash::{BuildHasher, RandomState},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};

use super::{
    errors::{Refused, RenderFailure},
    latest_frame::LatestFrame,
    rendered_frame::RenderedFrame,
};

/// Places for streams. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct Streams {
    places: Arc<Semaphore>,
    most: usize,
    dropped: Arc<AtomicU64>,
    acknowledged: Arc<Mutex<HashMap<u64, watch::Sender<u64>>>>,
}

/// A subscription: it receives frames until it is dropped or the daemon ends.
#[derive(Debug)]
pub(crate) struct Subscription {
    slot: Arc<LatestFrame>,
    _place: OwnedSemaphorePermit,
}

impl Streams {
    /// Creates places for `most` streams.
    pub(crate) fn new(most: usize) -> Self {
        Self { places: Arc::new(Semaphore::new(most)), most, dropped: Arc::default(), acknowledged: Arc::default() }
    }

    /// Opens a subscription; returns it with its slot for the rendering thread.
    pub(crate) fn open(&self) -> Result<(Subscription, Weak<LatestFrame>), Refused> {
        let place = Arc::clone(&self.places).try_acquire_owned().map_err(|_| Refused::Subscribers(self.most))?;
        let slot = Arc::new(LatestFrame::new(Arc::clone(&self.dropped)));
        let known = Arc::downgrade(&slot);
        Ok((Subscription { slot, _place: place }, known))
    }

    fn acknowledgements(&self) -> MutexGuard<'_, HashMap<u64, watch::Sender<u64>>> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.acknowledged.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Registers a stream with acknowledgements.
    pub(crate) fn acknowledged(&self) -> Acknowledged {
        let mut all = self.acknowledgements();
        // A random number, so that other clients cannot guess it; 0 means none.
        let number = std::iter::repeat_with(|| RandomState::new().hash_one(0))
            .find(|number| *number != 0 && !all.contains_key(number))
            .unwrap_or(1);
        let (sender, newest) = watch::channel(0);
        all.insert(number, sender);
        Acknowledged { streams: self.clone(), number, newest, sent: Vec::new() }
    }

    /// Records that a client has read the frames of a stream up to this one; `false` if the stream does not exist.
    pub(crate) fn acknowledge(&self, stream: u64, frame_number: u64) -> bool {
        let all = self.acknowledgements();
        let sender = all.get(&stream);
        if let Some(sender) = sender {
            sender.send_if_modified(|newest| {
                let is_new = frame_number > *newest;
                *newest = frame_number.max(*newest);
                is_new
            });
        }
        sender.is_some()
    }

    /// Returns the number of open streams.
    pub(crate) fn count(&self) -> usize {
        self.most - self.places.available_permits()
    }

    /// Returns the number of frames that all streams have dropped since the start.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Relaxed)
    }
}

/// Maximum number of sent frames that are not acknowledged yet.
const MOST_ON_THEIR_WAY: usize = 2;

/// Frames of a stream that were sent and have not been acknowledged.
#[derive(Debug)]
pub(crate) struct Acknowledged {
    streams: Streams,
    number: u64,
    newest: watch::Receiver<u64>,
    /// Numbers of these frames.
    sent: Vec<u64>,
}

impl Acknowledged {
    /// Returns the stream's number, with which the client acknowledges frames.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// Waits until another frame may be sent.
    pub(crate) async fn ready(&mut self) {
        loop {
            let newest = *self.newest.borrow_and_update();
            self.sent.retain(|sent| *sent > newest);
            if self.sent.len() < MOST_ON_THEIR_WAY {
                return;
            }
            // The sender lives as long as `self`.
            if self.newest.changed().await.is_err() {
                return;
            }
        }
    }

    /// Records that a frame was sent.
    pub(crate) fn sent(&mut self, frame_number: u64) {
        self.sent.push(frame_number);
    }
}

impl Drop for Acknowledged {
    fn drop(&mut self) {
        self.streams.acknowledgements().remove(&self.number);
    }
}

impl Subscription {
    /// See [`LatestFrame::next`].
    pub(crate) async fn next(&self) -> Result<Option<(Arc<RenderedFrame>, u64)>, RenderFailure> {
        self.slot.next().await
    }

    /// See [`LatestFrame::ended`].
    pub(crate) async fn ended(&self) {
        self.slot.ended().await;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::time::Duration;

    use tokio::time::timeout;

    use super::*;

    #[tokio::test]
    async fn at_most_two_frames_are_sent_without_acknowledgement() {
        let streams = Streams::new(1);
        let mut own = streams.acknowledged();
        let number = own.number();
        for frame in [7, 9] {
            own.ready().await;
            own.sent(frame);
        }
        let waits = |own: &mut Acknowledged| {
            let ready = Box::pin(own.ready());
            futures_are_pending(ready)
        };
        assert!(waits(&mut own));
        assert!(streams.acknowledge(number, 6) && waits(&mut own), "an earlier frame");
        assert!(streams.acknowledge(number, 7));
        timeout(Duration::from_secs(10), own.ready()).await.unwrap();
        own.sent(12);
        assert!(waits(&mut own));
        // A smaller number changes nothing.
        assert!(streams.acknowledge(number, 12) && streams.acknowledge(number, 7));
        timeout(Duration::from_secs(10), own.ready()).await.unwrap();
        assert!(!streams.acknowledge(number ^ 1, 12), "the number of another stream");
        drop(own);
        assert!(!streams.acknowledge(number, 13), "the stream has ended");
    }

    fn futures_are_pending(mut future: std::pin::Pin<Box<dyn Future<Output = ()> + '_>>) -> bool {
        let mut context = std::task::Context::from_waker(std::task::Waker::noop());
        future.as_mut().poll(&mut context).is_pending()
    }
}
