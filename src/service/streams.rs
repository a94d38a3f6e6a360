//! The streams of frames: how many there may be, whatever they show, and what they have dropped together.
//!
//! A subscription holds its slot; the thread that renders knows the slot only as long as the subscription lives. Streams whose frames are acknowledged are
//! known by a number that only their client is told.

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
    render::Refused,
    slot::{RenderFailure, RenderedFrame, Slot},
};

/// The places for streams. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Streams {
    places: Arc<Semaphore>,
    most: usize,
    dropped: Arc<AtomicU64>,
    acknowledged: Arc<Mutex<HashMap<u64, watch::Sender<u64>>>>,
}

/// A subscription: frames come until it is dropped or the daemon ends.
#[derive(Debug)]
pub(super) struct Subscription {
    slot: Arc<Slot>,
    _place: OwnedSemaphorePermit,
}

impl Streams {
    /// Places for `most` streams.
    pub(super) fn new(most: usize) -> Self {
        Self { places: Arc::new(Semaphore::new(most)), most, dropped: Arc::default(), acknowledged: Arc::default() }
    }

    /// A new subscription, and its slot for those who render.
    pub(super) fn open(&self) -> Result<(Subscription, Weak<Slot>), Refused> {
        let place = Arc::clone(&self.places).try_acquire_owned().map_err(|_| Refused::Subscribers(self.most))?;
        let slot = Arc::new(Slot::new(Arc::clone(&self.dropped)));
        let known = Arc::downgrade(&slot);
        Ok((Subscription { slot, _place: place }, known))
    }

    fn acknowledgements(&self) -> MutexGuard<'_, HashMap<u64, watch::Sender<u64>>> {
        // Nothing can panic while the lock is held, so a poisoned state is whole.
        self.acknowledged.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a stream whose frames are acknowledged waits for.
    pub(super) fn acknowledged(&self) -> Acknowledged {
        let mut all = self.acknowledgements();
        // Not to be guessed by other clients; 0 is none.
        let number = std::iter::repeat_with(|| RandomState::new().hash_one(0))
            .find(|number| *number != 0 && !all.contains_key(number))
            .unwrap_or(1);
        let (sender, newest) = watch::channel(0);
        all.insert(number, sender);
        Acknowledged { streams: self.clone(), number, newest, sent: Vec::new() }
    }

    /// A client has read the frames of a stream up to this one; `false`: there is no such stream.
    pub(super) fn acknowledge(&self, stream: u64, frame_number: u64) -> bool {
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

    /// Streams now.
    pub(super) fn count(&self) -> usize {
        self.most - self.places.available_permits()
    }

    /// Frames that streams have dropped since the start.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Relaxed)
    }
}

/// Frames of a stream that may be on their way.
const MOST_ON_THEIR_WAY: usize = 2;

/// The frames of a stream that are on their way.
#[derive(Debug)]
pub(super) struct Acknowledged {
    streams: Streams,
    number: u64,
    newest: watch::Receiver<u64>,
    /// Numbers of the frames that are on their way.
    sent: Vec<u64>,
}

impl Acknowledged {
    /// By which the client acknowledges.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Waits until another frame may go.
    pub(super) async fn room(&mut self) {
        loop {
            let newest = *self.newest.borrow_and_update();
            self.sent.retain(|sent| *sent > newest);
            if self.sent.len() < MOST_ON_THEIR_WAY {
                return;
            }
            // The sender lives as long as this one.
            if self.newest.changed().await.is_err() {
                return;
            }
        }
    }

    /// A frame goes.
    pub(super) fn sent(&mut self, frame_number: u64) {
        self.sent.push(frame_number);
    }
}

impl Drop for Acknowledged {
    fn drop(&mut self) {
        self.streams.acknowledgements().remove(&self.number);
    }
}

impl Subscription {
    /// See [`Slot::next`].
    pub(super) async fn next(&self) -> Result<Option<(Arc<RenderedFrame>, u64)>, RenderFailure> {
        self.slot.next().await
    }

    /// See [`Slot::ended`].
    pub(super) async fn ended(&self) {
        self.slot.ended().await;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use std::time::Duration;

    use tokio::time::timeout;

    use super::*;

    #[tokio::test]
    async fn two_frames_are_on_their_way_and_no_more_until_one_is_read() {
        let streams = Streams::new(1);
        let mut own = streams.acknowledged();
        let number = own.number();
        for frame in [7, 9] {
            own.room().await;
            own.sent(frame);
        }
        let waits = |own: &mut Acknowledged| {
            let room = Box::pin(own.room());
            futures_are_pending(room)
        };
        assert!(waits(&mut own));
        assert!(streams.acknowledge(number, 6) && waits(&mut own), "a frame before those");
        assert!(streams.acknowledge(number, 7));
        timeout(Duration::from_secs(10), own.room()).await.unwrap();
        own.sent(12);
        assert!(waits(&mut own));
        // An older number takes nothing back.
        assert!(streams.acknowledge(number, 12) && streams.acknowledge(number, 7));
        timeout(Duration::from_secs(10), own.room()).await.unwrap();
        assert!(!streams.acknowledge(number ^ 1, 12), "another's number");
        drop(own);
        assert!(!streams.acknowledge(number, 13), "it has ended");
    }

    fn futures_are_pending(mut future: std::pin::Pin<Box<dyn Future<Output = ()> + '_>>) -> bool {
        let mut context = std::task::Context::from_waker(std::task::Waker::noop());
        future.as_mut().poll(&mut context).is_pending()
    }
}
