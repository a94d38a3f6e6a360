//! The render thread: it alone owns the engine. What it is told stands in [`super::render`].
//!
//! It sleeps until a request is there or a subscriber is due, then renders **one** frame that serves all of them, with the
//! camera that is the newest at that moment. Failure tests that a client asked for are run one at a time, each after a frame
//! if one is due.

use std::{
    collections::VecDeque,
    mem,
    sync::{Arc, Condvar, Mutex, PoisonError},
    thread,
    time::{Duration, Instant, SystemTime},
};

use tokio::sync::{oneshot, watch};

use super::{
    engine::{Engine, EngineError},
    objects::Objects,
    render::{Capacity, RenderHandle, Request, Shared, State, Verification},
    scene::SceneState,
    schedule::Revisions,
    slot::{RenderFailure, RenderedFrame, Slot},
    streams::Streams,
};
use crate::{
    plan::{adaptation::Adaptation, settings::RenderSettings},
    render::Wanted,
    scene::{Camera, SceneSnapshot},
    view::Rig,
};

/// The running thread.
pub(super) struct RenderThread {
    /// Its end: in order, with the error that made the engine useless, or with its panic.
    pub(super) join: thread::JoinHandle<Result<(), EngineError>>,
    /// Resolves (with an error, since nothing is sent) when the thread has ended.
    pub(super) ended: oneshot::Receiver<()>,
}

/// When the thread ends, by panic or by order, nobody is left waiting for it.
struct Farewell {
    shared: Arc<Shared>,
    _ended: oneshot::Sender<()>,
}

impl Drop for Farewell {
    fn drop(&mut self) {
        let mut state = self.shared.state();
        // Dropped replies tell their callers.
        state.requests.clear();
        state.end_streams(&Err(RenderFailure::Ended));
    }
}

/// Starts the thread.
pub(super) fn spawn(
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    objects: Objects,
    rig: Arc<Rig>,
    settings: RenderSettings,
    capacity: Capacity,
) -> std::io::Result<(RenderHandle, RenderThread)> {
    let shown = SceneState {
        revision: scene.revision,
        stars: settings.stars.clone(),
        asteroids: settings.asteroids.clone(),
        objects,
    };
    let state = State {
        camera: scene.camera,
        pose_time: SystemTime::now(),
        scene: watch::Sender::new(Some(shown.clone())),
        settings: settings.clone(),
        verifications: VecDeque::new(),
        requests: VecDeque::new(),
        subscribers: Vec::new(),
        frames_rendered: 0,
        last_times: None,
        draining: false,
        stop: false,
    };
    let shared = Arc::new(Shared {
        state: Mutex::new(state),
        wake: Condvar::new(),
        stars: Arc::clone(&scene.stars),
        capacity,
        streams: Streams::new(capacity.subscribers),
    });
    let (sender, ended) = oneshot::channel();
    let farewell = Farewell { shared: Arc::clone(&shared), _ended: sender };
    let worker = Worker { shared: Arc::clone(&shared), engine, scene, shown, rig, settings };
    let join = thread::Builder::new().name("render".to_owned()).spawn(move || {
        // Dropped after the worker: whoever sees the end knows that the engine is gone too.
        let _farewell = farewell;
        worker.run()
    })?;
    Ok((RenderHandle { shared }, RenderThread { join, ended }))
}

/// Who gets the next frame, and of what.
struct Job {
    requests: Vec<Request>,
    subscribers: Vec<Arc<Slot>>,
    wanted: Vec<Wanted>,
    camera: Camera,
    pose_time: SystemTime,
    scene: SceneState,
    start: Instant,
}

/// What the thread does next.
enum Work {
    Frame(Job),
    Check(Verification),
}

struct Worker {
    shared: Arc<Shared>,
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    /// What the last frame showed.
    shown: SceneState,
    rig: Arc<Rig>,
    settings: RenderSettings,
}

impl Worker {
    fn run(mut self) -> Result<(), EngineError> {
        let mut adaptation = Adaptation::default();
        // When the last frame that came out was started, and what it showed.
        let mut last: Option<(Instant, Revisions)> = None;
        let mut checked = false;
        while let Some(work) = self.next_work(adaptation.converged(&self.settings.exposure), checked) {
            let job = match work {
                Work::Check(Verification { check, settings, reply }) => {
                    // A caller that went away meanwhile needs no answer.
                    let _ = reply.send(self.engine.verify(check, &settings));
                    checked = true;
                    continue;
                }
                Work::Frame(job) => job,
            };
            checked = false;
            self.scene.camera = job.camera;
            self.scene.revision = job.scene.revision;
            self.scene.objects = Arc::clone(&job.scene.objects.drawn);
            self.settings.stars = job.scene.stars.clone();
            self.settings.asteroids = job.scene.asteroids.clone();
            self.shown = job.scene.clone();
            let shown = Revisions { scene: self.scene.revision, camera: job.camera.revision };
            let (dt, changed) = last.map_or((Duration::ZERO, true), |(start, last)| (job.start - start, last != shown));
            let adapted_ev100 = adaptation.exposure(dt.as_secs_f64(), changed, &self.settings.exposure);
            let result = self.engine.render(&self.scene, &self.rig, &self.settings, &job.wanted, adapted_ev100);
            match result {
                Ok(frame) => {
                    last = Some((job.start, shown));
                    adaptation.observe(frame.exposure_ev100, frame.metered_ev100);
                    let mut state = self.shared.state();
                    state.frames_rendered += 1;
                    state.last_times = Some(frame.times.clone());
                    drop(state);
                    let frame = Arc::new(RenderedFrame {
                        frame: Arc::new(frame),
                        pose_time: job.pose_time,
                        render_time: SystemTime::now(),
                    });
                    for request in job.requests {
                        // A caller that went away meanwhile needs no answer.
                        let _ = request.reply.send(Ok(Arc::clone(&frame)));
                    }
                    for slot in job.subscribers {
                        slot.offer(Arc::clone(&frame));
                    }
                }
                Err(error) => {
                    self.refuse(job, &RenderFailure::Engine(error.to_string()));
                    if error.lost {
                        return Err(error);
                    }
                }
            }
        }
        Ok(())
    }

    /// Tells everyone who waited for a frame that there is none.
    fn refuse(&self, job: Job, failure: &RenderFailure) {
        for request in job.requests {
            // A caller that went away meanwhile needs no answer.
            let _ = request.reply.send(Err(failure.clone()));
        }
        let mut state = self.shared.state();
        for slot in job.subscribers {
            state.subscribers.retain(|subscriber| !std::ptr::eq(subscriber.slot.as_ptr(), Arc::as_ptr(&slot)));
            slot.end(Err(failure.clone()));
        }
    }

    /// Sleeps until there is something to do; `None`: the thread is to end. Frames and checks take turns: `checked` says that
    /// the last work was a check.
    fn next_work(&self, exposure_converged: bool, checked: bool) -> Option<Work> {
        let mut state = self.shared.state();
        loop {
            state.requests.retain(|request| !request.reply.is_closed());
            state.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
            state.verifications.retain(|verification| !verification.reply.is_closed());
            let scene = state.scene.borrow().clone();
            // At the end the scene is as it was in the last frame.
            let revision = scene.as_ref().map_or(self.scene.revision, |scene| scene.revision);
            let newest = Revisions { scene: revision, camera: state.camera.revision };
            let now = Instant::now();
            let due = state.subscribers.iter().map(|s| s.pace.due_at(newest, exposure_converged, now)).min();
            let frame_due = !state.requests.is_empty() || due.is_some_and(|due| due <= now);
            if !(frame_due && checked)
                && let Some(verification) = state.verifications.pop_front()
            {
                return Some(Work::Check(verification));
            }
            if frame_due {
                let scene = scene.unwrap_or_else(|| self.shown.clone());
                return Some(Work::Frame(self.take_job(&mut state, scene, newest, exposure_converged, now)));
            }
            if state.stop {
                return None;
            }
            state = match due {
                Some(due) => {
                    let wait = self.shared.wake.wait_timeout(state, due - now);
                    wait.unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.shared.wake.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    fn take_job(
        &self,
        state: &mut State,
        scene: SceneState,
        newest: Revisions,
        exposure_converged: bool,
        start: Instant,
    ) -> Job {
        let mut wanted = vec![Wanted::default(); self.rig.views().len()];
        let mut want = |view: usize, what: Wanted| {
            wanted[view].display |= what.display;
            wanted[view].hdr |= what.hdr;
        };
        let requests: Vec<Request> = mem::take(&mut state.requests).into();
        for request in &requests {
            want(request.view, request.wanted);
        }
        let mut subscribers = Vec::new();
        for subscriber in &mut state.subscribers {
            if subscriber.pace.due_at(newest, exposure_converged, start) <= start
                && let Some(slot) = subscriber.slot.upgrade()
            {
                subscriber.pace.served(newest, start);
                want(subscriber.view, subscriber.wanted);
                subscribers.push(slot);
            }
        }
        Job { requests, subscribers, wanted, camera: state.camera, pose_time: state.pose_time, scene, start }
    }
}
