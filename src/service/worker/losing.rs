//! What becomes of frames that cannot be drawn, and of an engine that is lost: it is made anew, and what was asked for is drawn again.

use std::{
    sync::{Arc, PoisonError},
    time::Duration,
};

use super::{Job, Worker};
use crate::service::{engine::EngineError, render::Subscriber, schedule::Revisions, slot::RenderFailure};

/// Losses of the engine without a frame between them, from which on a frame is not tried again.
const MOST_LOSSES: u32 = 3;
/// Waits before the attempts to make a lost engine anew: a driver that resets its device takes a while.
const REOPENS: [Duration; 6] = [
    Duration::ZERO,
    Duration::from_millis(100),
    Duration::from_millis(500),
    Duration::from_secs(1),
    Duration::from_secs(2),
    Duration::from_secs(4),
];

impl Worker {
    /// Neither `job` nor what is in flight will be drawn by this engine: makes it anew, and draws again what was asked for. An error is one that the engine does not
    /// outlive.
    pub(super) fn lose(&mut self, job: Job, error: EngineError) -> Result<(), EngineError> {
        tracing::error!("the renderer was lost: {error}; it is made anew");
        self.losses += 1;
        self.shared.state().losses += 1;
        let failure = RenderFailure::Engine(error.to_string());
        let mut jobs: Vec<Job> = self.in_flight.drain(..).map(|frame| frame.job).chain([job]).collect();
        jobs.sort_by_key(|job| job.start);
        let reopened = self.reopen();
        // A scene that loses every device is not drawn again and again: it waits for the next change.
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

    /// Makes the engine anew; whether that has succeeded.
    fn reopen(&mut self) -> bool {
        for wait in REOPENS {
            let state = self.shared.state();
            let waited = self.shared.wake.wait_timeout_while(state, wait, |state| !state.stop);
            if waited.unwrap_or_else(PoisonError::into_inner).0.stop {
                return false;
            }
            match self.engine.reopen() {
                Ok(()) => {
                    tracing::info!("the renderer is made anew");
                    return true;
                }
                Err(error) => tracing::error!("the renderer cannot be made anew: {error}"),
            }
        }
        false
    }

    /// Those who asked for this frame ask again.
    fn take_back(&self, job: Job) {
        let mut state = self.shared.state();
        for request in job.requests.into_iter().rev() {
            if state.has_view(request.view) {
                state.requests.push_front(request);
                continue;
            }
            let name = job.scene.views.index_of(request.view).map(|index| &job.scene.views.rig().views()[index].name);
            // A caller that went away meanwhile needs no answer.
            let _ = request.reply.send(Err(RenderFailure::Deleted(name.cloned().unwrap_or_default())));
        }
        for slot in &job.subscribers {
            let of_slot = |subscriber: &&mut Subscriber| std::ptr::eq(subscriber.slot.as_ptr(), Arc::as_ptr(slot));
            state.subscribers.iter_mut().filter(of_slot).for_each(|subscriber| subscriber.pace.again());
        }
    }

    /// Tells those who asked for this frame that there is none. Streams go on: they have the frame of the next change that can be drawn.
    pub(super) fn refuse(&self, job: Job, failure: &RenderFailure) {
        let Revisions { scene, camera, .. } = job.shows();
        for request in job.requests {
            // A caller that went away meanwhile needs no answer.
            let _ = request.reply.send(Err(failure.clone()));
        }
        let mut state = self.shared.state();
        state.failures.count += 1;
        let problem = failure.to_string();
        if state.failures.problem.replace(problem.clone()).is_none_or(|before| before != problem) {
            tracing::error!(scene, camera, "{problem}");
        }
    }

    /// The engine is lost: streams end too.
    fn end(&self, job: Job, failure: &RenderFailure) {
        let slots = job.subscribers.clone();
        self.refuse(job, failure);
        let mut state = self.shared.state();
        for slot in slots {
            state.subscribers.retain(|subscriber| !std::ptr::eq(subscriber.slot.as_ptr(), Arc::as_ptr(&slot)));
            slot.end(Err(failure.clone()));
        }
    }
}
