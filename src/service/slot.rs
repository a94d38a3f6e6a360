//! The latest-wins slot between a thread that renders and one subscriber: it holds the newest frame, counts those that were
//! overwritten before the subscriber took them, and never makes the thread wait.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::SystemTime,
};

use tokio::sync::Notify;

use super::{order::EncodedImages, schedule::Revisions, views::ViewId};
use crate::{
    render::{Frame, FrameImage},
    scene::Camera,
};

/// A frame with its times.
#[derive(Debug)]
pub(super) struct RenderedFrame {
    /// The frame, with the images of every view that was wanted.
    pub(super) frame: Arc<Frame>,
    /// Which views these are: images have their numbers in this list.
    pub(super) views: Arc<[ViewId]>,
    /// The camera that is shown; of a headset: the origin of the room.
    pub(super) camera: Camera,
    /// When the camera was set; of a headset: when the poses of the eyes were asked for.
    pub(super) pose_time: SystemTime,
    /// When the frame was finished.
    pub(super) render_time: SystemTime,
    /// Revisions of what it shows.
    pub(super) shows: Revisions,
    /// What it has given up to be in time.
    pub(super) given_up: GivenUp,
    /// Its images, encoded once for all who ask for the same.
    pub(super) encoded: EncodedImages,
}

impl RenderedFrame {
    /// The images of a view.
    pub(super) fn images_of(&self, view: ViewId) -> impl Iterator<Item = &FrameImage> {
        let number = self.views.iter().position(|known| *known == view);
        self.frame.images.iter().filter(move |image| Some(image.view) == number)
    }
}

/// What a frame has given up.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GivenUp {
    /// Level of quality; 0: as configured.
    pub(super) level: u32,
    /// In words.
    pub(super) what: Vec<String>,
}

/// Why there is no frame.
#[derive(Clone, Debug, thiserror::Error)]
pub(super) enum RenderFailure {
    /// The engine failed.
    #[error("the frame could not be rendered: {0}")]
    Engine(String),
    /// There is no headset, or none any more.
    #[error("the headset shows no frames: {0}")]
    Headset(String),
    /// The view is not there any more.
    #[error("view `{0}` was deleted")]
    Deleted(String),
    /// There is no render thread any more, or it takes no more work.
    #[error("the daemon is shutting down")]
    Ended,
}

#[derive(Debug, Default)]
struct State {
    frame: Option<Arc<RenderedFrame>>,
    dropped: u64,
    end: Option<Result<(), RenderFailure>>,
}

/// One subscriber's slot.
#[derive(Debug)]
pub(super) struct Slot {
    state: Mutex<State>,
    changed: Notify,
    /// Frames that all slots together have dropped.
    dropped_in_all: Arc<AtomicU64>,
}

impl Slot {
    /// An empty slot; what it drops is added to `dropped_in_all` too.
    pub(super) fn new(dropped_in_all: Arc<AtomicU64>) -> Self {
        Self { state: Mutex::default(), changed: Notify::new(), dropped_in_all }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts the newest frame in. One that is still there is dropped and counted.
    pub(super) fn offer(&self, frame: Arc<RenderedFrame>) {
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

    /// No frame will follow. One that is there is still delivered. The first end counts.
    pub(super) fn end(&self, how: Result<(), RenderFailure>) {
        self.state().end.get_or_insert(how);
        self.changed.notify_one();
    }

    /// Waits until no frame will follow. For the same reader.
    pub(super) async fn ended(&self) {
        while self.state().end.is_none() {
            self.changed.notified().await;
        }
    }

    /// Waits for the newest frame; with it comes the number of frames dropped so far. `None`: there will be no more.
    /// For one reader.
    pub(super) async fn next(&self) -> Result<Option<(Arc<RenderedFrame>, u64)>, RenderFailure> {
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
            // A notification that came since the lock was released is stored, so none is lost.
            self.changed.notified().await;
        }
    }
}
