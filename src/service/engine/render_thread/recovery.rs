//! Handling of failed frames and of a lost engine: the engine is reopened, and the frames are requested again.

use std::{
    sync::{Arc, PoisonError},
    time::Duration,
};

use super::{Job, Worker};
use crate::service::{
    engine::{interface::EngineError, shared_state::Subscriber},
    frames::{errors::RenderFailure, schedule::Revisions},
};

/// Number of consecutive losses of the engine after which the lost frames are not drawn again.
const MOST_LOSSES: u32 = 3;
/// Delays before the attempts to reopen a lost engine: a driver that resets its device needs time.
const REOPENS: [Duration; 6] = [
    Duration::ZERO,
    Duration::from_millis(100),
    Duration::from_millis(500),
    Duration::from_secs(1),
    Duration::from_secs(2),
    Duration::from_secs(4),
];

impl Worker {
    /// Handles the loss of the engine with `job` and all frames in flight: reopens it and requests the frames again. An
    /// error means that the engine is lost for good.
    pub(super) fn lose(&mut self, job: Job, error: EngineError) -> Result<(), EngineError> {
        tracing::error!("the renderer was lost: {error}; reopening it");
        self.losses += 1;
        self.shared.state().statistics.losses += 1;
        let failure = RenderFailure::Engine(error.to_string());
        let mut jobs: Vec<Job> = self.in_flight.drain(..).map(|frame| frame.job).chain([job]).collect();
        jobs.sort_by_key(|job| job.start);
        let reopened = self.reopen();
        // If the device is lost each time that this scene is drawn, do not draw it again: the thread waits for the next change.
        let draws_again = reopened && self.losses < MOST_LOSSES;
        for job in jobs.into_iter().rev() {
            match (reopened, draws_again) {
                (true, true) => self.take_back(job),
                (true, false) => self.refuse(job, &failure),
                (false, _) => self.end(job, &failure),
            }
        }
        if reopened || self.shared.state().stop { Ok(()) } else { Err(error) }
    }

    /// Reopens the engine; returns whether it succeeded.
    fn reopen(&mut self) -> bool {
        for wait in REOPENS {
            let state = self.shared.state();
            let waited = self.shared.wake.wait_timeout_while(state, wait, |state| !state.stop);
            if waited.unwrap_or_else(PoisonError::into_inner).0.stop {
                return false;
            }
            match self.engine.reopen() {
                Ok(()) => {
                    tracing::info!("the renderer was reopened");
                    return true;
                }
                Err(error) => tracing::error!("cannot reopen the renderer: {error}"),
            }
        }
        false
    }

    /// Requests a frame again for its recipients.
    fn take_back(&self, job: Job) {
        let mut state = self.shared.state();
        for request in job.requests.into_iter().rev() {
            if state.has_view(request.view) {
                state.queue.requests.push_front(request);
                continue;
            }
            let name = job.scene.views.index_of(request.view).map(|index| &job.scene.views.rig().views()[index].name);
            // The caller may have disconnected.
            let _ = request.reply.send(Err(RenderFailure::Deleted(name.cloned().unwrap_or_default())));
        }
        for slot in &job.subscribers {
            let of_slot = |subscriber: &&mut Subscriber| std::ptr::eq(subscriber.slot.as_ptr(), Arc::as_ptr(slot));
            state.queue.subscribers.iter_mut().filter(of_slot).for_each(|subscriber| subscriber.pace.again());
        }
    }

    /// Sends an error to the callers that requested this frame. Streams continue: they get the frame of the next change
    /// that can be drawn.
    pub(super) fn refuse(&self, job: Job, failure: &RenderFailure) {
        let Revisions { scene, camera, .. } = job.shows();
        for request in job.requests {
            // The caller may have disconnected.
            let _ = request.reply.send(Err(failure.clone()));
        }
        let mut state = self.shared.state();
        state.statistics.failures.count += 1;
        let problem = failure.to_string();
        if state.statistics.failures.problem.replace(problem.clone()).is_none_or(|before| before != problem) {
            tracing::error!(scene, camera, "{problem}");
        }
    }

    /// Reports that the engine is lost for good, which ends streams too.
    fn end(&self, job: Job, failure: &RenderFailure) {
        let slots = job.subscribers.clone();
        self.refuse(job, failure);
        let mut state = self.shared.state();
        for slot in slots {
            state.queue.subscribers.retain(|subscriber| !std::ptr::eq(subscriber.slot.as_ptr(), Arc::as_ptr(&slot)));
            slot.end(Err(failure.clone()));
        }
    }
}
