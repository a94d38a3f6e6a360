//! The streams of frames: how many there may be, whatever they show, and what they have dropped together.
//!
//! A subscription holds its slot; the thread that renders knows the slot only as long as the subscription lives.

use std::sync::{
    Arc, Weak,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

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
        Self { places: Arc::new(Semaphore::new(most)), most, dropped: Arc::default() }
    }

    /// A new subscription, and its slot for those who render.
    pub(super) fn open(&self) -> Result<(Subscription, Weak<Slot>), Refused> {
        let place = Arc::clone(&self.places).try_acquire_owned().map_err(|_| Refused::Subscribers(self.most))?;
        let slot = Arc::new(Slot::new(Arc::clone(&self.dropped)));
        let known = Arc::downgrade(&slot);
        Ok((Subscription { slot, _place: place }, known))
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

impl Subscription {
    /// See [`Slot::next`].
    pub(super) async fn next(&self) -> Result<Option<(Arc<RenderedFrame>, u64)>, RenderFailure> {
        self.slot.next().await
    }
}
