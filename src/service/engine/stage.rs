//! The stage: hands frames of a led worker to its windows in two steps. A frame is prepared before the node is ready (uploaded, the device polled,
//! the surfaces' next textures acquired), and presented after COMMIT. A frame that is skipped never reaches a surface.
//!
//! The node's thread pushes work and never waits; the presenting thread carries it out in order. Without windows there is nothing to prepare.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use super::led::Pictures;

/// Callback when a frame is prepared; `false` if the device of the windows was lost in the process.
pub(crate) type Prepared = Box<dyn FnOnce(bool) + Send>;

/// Work of the presenting thread. Numbers are those of [`Stage::prepare`].
#[derive(Debug)]
pub(crate) enum StageWork {
    /// Prepare these pictures, then call [`Stage::prepared`].
    Prepare(u64, Pictures),
    /// Present a prepared frame.
    Present(u64),
    /// Keep the textures of a prepared frame for another one.
    Discard(u64),
    /// Show black.
    Black,
}

#[derive(Default)]
struct State {
    has_windows: bool,
    work: VecDeque<StageWork>,
    waiting: HashMap<u64, Prepared>,
}

/// See the module documentation.
#[derive(Default)]
pub(crate) struct Stage {
    state: Mutex<State>,
    wake: Condvar,
    /// Whether the presenting thread asks for real-time scheduling.
    pub(crate) real_time: bool,
}

impl Stage {
    pub(crate) fn new(real_time: bool) -> Self {
        Self { real_time, ..Self::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, work: StageWork) {
        let mut state = self.state();
        // The lock of the cluster bounds the number of pictures, so the queue is bounded.
        if state.has_windows {
            state.work.push_back(work);
            drop(state);
            self.wake.notify_one();
        }
    }

    /// Has pictures prepared under a number that is not in use. The reply comes from the presenting thread. Returns `false` without windows: there is
    /// nothing to prepare, and no reply.
    pub(crate) fn prepare(&self, number: u64, pictures: &Pictures, reply: Prepared) -> bool {
        let mut state = self.state();
        if !state.has_windows {
            return false;
        }
        state.waiting.insert(number, reply);
        state.work.push_back(StageWork::Prepare(number, pictures.clone()));
        drop(state);
        self.wake.notify_one();
        true
    }

    /// Has a prepared frame presented.
    pub(crate) fn present(&self, number: u64) {
        self.push(StageWork::Present(number));
    }

    /// Gives up a prepared frame.
    pub(crate) fn discard(&self, number: u64) {
        self.push(StageWork::Discard(number));
    }

    /// Shows black until the next frame is presented.
    pub(crate) fn black(&self) {
        self.push(StageWork::Black);
    }

    /// Called by the windows: waits for work for at most `patience`. From the first call on, frames are prepared.
    pub(crate) fn next(&self, patience: Duration) -> Option<StageWork> {
        let mut state = self.state();
        state.has_windows = true;
        let waited = self.wake.wait_timeout_while(state, patience, |state| state.work.is_empty());
        waited.unwrap_or_else(PoisonError::into_inner).0.work.pop_front()
    }

    /// Called by the windows when a frame is prepared, or when the device was lost in the process.
    pub(crate) fn prepared(&self, number: u64, is_ready: bool) {
        let reply = self.state().waiting.remove(&number);
        if let Some(reply) = reply {
            reply(is_ready);
        }
    }

    /// Called by the windows when they have ended. Callers that are waiting for the windows continue without them.
    pub(crate) fn end_windows(&self) {
        let mut state = self.state();
        state.has_windows = false;
        state.work.clear();
        let waiting = std::mem::take(&mut state.waiting);
        drop(state);
        waiting.into_values().for_each(|reply| reply(true));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::{
        sync::{
            Arc,
            mpsc::{Receiver, channel},
        },
        time::Instant,
    };

    use super::*;

    fn pictures() -> Pictures {
        Pictures { frames: Vec::new(), start: Instant::now() }
    }

    fn prepare(stage: &Stage, number: u64) -> Receiver<bool> {
        let (sender, receiver) = channel();
        assert!(stage.prepare(number, &pictures(), Box::new(move |is_ready| sender.send(is_ready).unwrap())));
        receiver
    }

    #[test]
    fn without_windows_nothing_is_prepared() {
        let stage = Stage::default();
        assert!(!stage.prepare(1, &pictures(), Box::new(|_| panic!("a reply"))));
        stage.present(1);
        assert!(stage.next(Duration::ZERO).is_none(), "nothing was kept for windows that did not exist");
    }

    #[test]
    fn frames_are_ready_when_the_windows_have_prepared_them() {
        let stage = Arc::new(Stage::default());
        assert!(stage.next(Duration::ZERO).is_none());
        let (first, second, third) = (prepare(&stage, 1), prepare(&stage, 2), prepare(&stage, 3));
        assert!(first.try_recv().is_err());
        assert!(matches!(stage.next(Duration::ZERO), Some(StageWork::Prepare(1, _))));
        assert!(first.try_recv().is_err(), "taken, but not prepared");
        stage.prepared(1, true);
        assert_eq!(first.try_recv(), Ok(true));
        assert!(matches!(stage.next(Duration::ZERO), Some(StageWork::Prepare(2, _))));
        stage.prepared(2, false);
        assert_eq!(second.try_recv(), Ok(false));
        stage.present(1);
        assert!(third.try_recv().is_err());
        // The windows end. Callers that wait continue, and no work is left over for the next windows.
        stage.end_windows();
        assert_eq!(third.try_recv(), Ok(true));
        assert!(stage.next(Duration::ZERO).is_none());
    }

    #[test]
    fn work_keeps_its_order() {
        let stage = Stage::default();
        assert!(stage.next(Duration::ZERO).is_none());
        let _first = prepare(&stage, 1);
        stage.present(1);
        let _second = prepare(&stage, 2);
        stage.discard(2);
        stage.black();
        let order: Vec<String> = std::iter::from_fn(|| stage.next(Duration::ZERO))
            .map(|work| match work {
                StageWork::Prepare(number, _) => format!("prepare {number}"),
                StageWork::Present(number) => format!("present {number}"),
                StageWork::Discard(number) => format!("discard {number}"),
                StageWork::Black => "black".to_owned(),
            })
            .collect();
        assert_eq!(order, ["prepare 1", "present 1", "prepare 2", "discard 2", "black"]);
    }
}
