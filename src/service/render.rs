//! The render thread: it alone owns the engine. The other side reaches it through [`RenderHandle`].
//!
//! All that it is told stands under one lock, which is never held while a frame is rendered: the camera (a slot, the latest
//! wins), the scene but for its stars and how it is drawn, requests for single frames (a bounded queue), and the subscribers, each with a latest-wins slot of its own. The
//! thread sleeps until a request is there or a subscriber is due, then renders **one** frame that serves all of them, with
//! the camera that is the newest at that moment. Failure tests that a client asked for are run one at a time, each after a frame
//! if one is due.

use std::{
    collections::VecDeque,
    mem,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant, SystemTime},
};

use tokio::sync::{oneshot, watch};

use super::{
    engine::{Engine, EngineError},
    objects::Objects,
    scene::{MadeUpdate, SceneError, SceneState},
    schedule::{Pace, Shown},
    slot::{RenderFailure, RenderedFrame, Slot},
};
use crate::{
    frame::Wanted,
    plan::{
        adaptation::Adaptation,
        settings::{RenderSettings, StarMethod},
    },
    scene::{Camera, PoseError, SceneSnapshot},
    verify::{Check, CheckResult},
    view::Rig,
};

/// Changes of a camera; what is `None` stays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraUpdate {
    /// ICRS barycentric position, m.
    pub position_m: Option<[f64; 3]>,
    /// Camera axes to world axes, unit quaternion x, y, z, w.
    pub orientation: Option<[f64; 4]>,
    /// Velocity in units of the speed of light, world axes; at most 0.9999 long.
    pub velocity_c: Option<[f64; 3]>,
}

/// How much the thread takes on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// Requests that may wait.
    pub(super) requests: usize,
    /// Subscribers at the same time.
    pub(super) subscribers: usize,
}

type Reply = oneshot::Sender<Result<Arc<RenderedFrame>, RenderFailure>>;

/// Why a request is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// The queue is full.
    Full,
    /// There are as many subscribers as may be.
    Subscribers(usize),
    /// The daemon is shutting down.
    Ending,
}

struct Request {
    view: usize,
    wanted: Wanted,
    reply: Reply,
}

/// A failure test that waits for its turn.
struct Verification {
    check: &'static Check,
    settings: RenderSettings,
    reply: oneshot::Sender<CheckResult>,
}

struct Subscriber {
    id: u64,
    view: usize,
    wanted: Wanted,
    pace: Pace,
    slot: Arc<Slot>,
}

struct State {
    camera: Camera,
    pose_time: SystemTime,
    /// Holds `None` when there will be no more changes.
    scene: watch::Sender<Option<SceneState>>,
    /// The settings of frames but for stars and asteroids, which the scene holds.
    settings: RenderSettings,
    verifications: VecDeque<Verification>,
    requests: VecDeque<Request>,
    subscribers: Vec<Subscriber>,
    next_id: u64,
    frames_rendered: u64,
    /// No new work is taken.
    draining: bool,
    /// The thread ends.
    stop: bool,
}

struct Shared {
    state: Mutex<State>,
    wake: Condvar,
    room: Room,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // The engine, which may panic, never runs under this lock: a poisoned state is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The async side's hold on the render thread. None of its calls waits for a frame.
#[derive(Clone)]
pub(super) struct RenderHandle {
    shared: Arc<Shared>,
}

/// A subscription: frames come until it is dropped or the daemon ends.
pub(super) struct Subscription {
    id: u64,
    slot: Arc<Slot>,
    handle: RenderHandle,
}

impl Subscription {
    /// See [`Slot::next`].
    pub(super) async fn next(&self) -> Result<Option<(Arc<RenderedFrame>, u64)>, RenderFailure> {
        self.slot.next().await
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        self.handle.shared.state().subscribers.retain(|subscriber| subscriber.id != self.id);
    }
}

impl RenderHandle {
    /// The camera now.
    pub(super) fn camera(&self) -> Camera {
        self.shared.state().camera
    }

    /// Moves the camera; returns it with its new revision. After an error it is as it was.
    pub(super) fn set_camera(&self, update: &CameraUpdate) -> Result<Camera, PoseError> {
        let mut state = self.shared.state();
        let old = state.camera;
        let camera = Camera::new(
            update.position_m.unwrap_or(old.position_m.to_array()),
            update.orientation.unwrap_or(old.world_from_camera.to_array()),
            update.velocity_c.unwrap_or(old.velocity_c.to_array()),
        )?;
        state.camera = Camera { revision: old.revision + 1, ..camera };
        state.pose_time = SystemTime::now();
        self.shared.wake.notify_one();
        Ok(state.camera)
    }

    /// The scene now.
    pub(super) fn scene(&self) -> Result<SceneState, Refused> {
        self.shared.state().scene.borrow().clone().ok_or(Refused::Ending)
    }

    /// The scene and its changes; `None` is the end.
    pub(super) fn watch_scene(&self) -> watch::Receiver<Option<SceneState>> {
        self.shared.state().scene.subscribe()
    }

    /// Changes the scene, if it still has the revision expected; returns it with its new one. The outer error: it takes no
    /// changes any more.
    pub(super) fn update_scene(
        &self,
        update: &MadeUpdate,
        expected_revision: Option<u64>,
    ) -> Result<Result<SceneState, SceneError>, Refused> {
        let state = self.shared.state();
        let scene = state.scene.borrow().clone().ok_or(Refused::Ending)?;
        let changed = scene.changed(update, expected_revision);
        if let Ok(scene) = &changed {
            state.scene.send_replace(Some(scene.clone()));
            self.shared.wake.notify_one();
        }
        Ok(changed)
    }

    /// Asks for a failure test, of the method in use unless another is named.
    pub(super) fn verify(
        &self,
        check: &'static Check,
        method: Option<StarMethod>,
    ) -> Result<oneshot::Receiver<CheckResult>, Refused> {
        let mut state = self.shared.state();
        let scene = state.scene.borrow().clone().filter(|_| !state.draining).ok_or(Refused::Ending)?;
        let mut settings = RenderSettings { stars: scene.stars, asteroids: scene.asteroids, ..state.settings.clone() };
        settings.stars.method = method.unwrap_or(settings.stars.method);
        let (reply, receiver) = oneshot::channel();
        state.verifications.push_back(Verification { check, settings, reply });
        self.shared.wake.notify_one();
        Ok(receiver)
    }

    /// Frames rendered since the start.
    pub(super) fn frames_rendered(&self) -> u64 {
        self.shared.state().frames_rendered
    }

    /// Asks for a frame of a view.
    pub(super) fn request(
        &self,
        view: usize,
        wanted: Wanted,
    ) -> Result<oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if state.requests.len() >= self.shared.room.requests {
            // Callers that went away need no place.
            state.requests.retain(|request| !request.reply.is_closed());
        }
        if state.requests.len() >= self.shared.room.requests {
            return Err(Refused::Full);
        }
        let (reply, receiver) = oneshot::channel();
        state.requests.push_back(Request { view, wanted, reply });
        self.shared.wake.notify_one();
        Ok(receiver)
    }

    /// Asks for the frames of a view, at least `interval` apart.
    pub(super) fn subscribe(&self, view: usize, wanted: Wanted, interval: Duration) -> Result<Subscription, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if state.subscribers.len() >= self.shared.room.subscribers {
            return Err(Refused::Subscribers(self.shared.room.subscribers));
        }
        let id = state.next_id;
        state.next_id += 1;
        let slot = Arc::new(Slot::default());
        state.subscribers.push(Subscriber { id, view, wanted, pace: Pace::new(interval), slot: Arc::clone(&slot) });
        self.shared.wake.notify_one();
        Ok(Subscription { id, slot, handle: self.clone() })
    }

    /// Takes no new work and ends every subscription; requests that are queued are still answered.
    pub(super) fn drain(&self) {
        let mut state = self.shared.state();
        state.draining = true;
        state.scene.send_replace(None);
        // Dropped replies tell their callers.
        state.verifications.clear();
        for subscriber in state.subscribers.drain(..) {
            subscriber.slot.end(Ok(()));
        }
    }

    /// Lets the thread end after the frame in the works; requests that are still queued are refused.
    pub(super) fn stop(&self) {
        self.drain();
        let mut state = self.shared.state();
        state.stop = true;
        // Dropped replies tell their callers.
        state.requests.clear();
        drop(state);
        self.shared.wake.notify_one();
    }
}

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
        state.draining = true;
        state.scene.send_replace(None);
        // Dropped replies tell their callers.
        state.requests.clear();
        state.verifications.clear();
        for subscriber in state.subscribers.drain(..) {
            subscriber.slot.end(Err(RenderFailure::Ended));
        }
    }
}

/// Starts the thread.
pub(super) fn spawn(
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    objects: Objects,
    rig: Arc<Rig>,
    settings: RenderSettings,
    room: Room,
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
        next_id: 0,
        frames_rendered: 0,
        draining: false,
        stop: false,
    };
    let shared = Arc::new(Shared { state: Mutex::new(state), wake: Condvar::new(), room });
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
    subscribers: Vec<(u64, Arc<Slot>)>,
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
        let mut last: Option<(Instant, Shown)> = None;
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
            let shown = Shown { scene: self.scene.revision, camera: job.camera.revision };
            let (dt, changed) = last.map_or((Duration::ZERO, true), |(start, last)| (job.start - start, last != shown));
            let adapted_ev100 = adaptation.exposure(dt.as_secs_f64(), changed, &self.settings.exposure);
            let result = self.engine.render(&self.scene, &self.rig, &self.settings, &job.wanted, adapted_ev100);
            match result {
                Ok(frame) => {
                    last = Some((job.start, shown));
                    adaptation.observe(frame.exposure_ev100, frame.metered_ev100);
                    self.shared.state().frames_rendered += 1;
                    let frame =
                        Arc::new(RenderedFrame { frame, pose_time: job.pose_time, render_time: SystemTime::now() });
                    for request in job.requests {
                        // A caller that went away meanwhile needs no answer.
                        let _ = request.reply.send(Ok(Arc::clone(&frame)));
                    }
                    for (_, slot) in job.subscribers {
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
        for (id, slot) in job.subscribers {
            state.subscribers.retain(|subscriber| subscriber.id != id);
            slot.end(Err(failure.clone()));
        }
    }

    /// Sleeps until there is something to do; `None`: the thread is to end. Frames and checks take turns: `checked` says that
    /// the last work was a check.
    fn next_work(&self, exposure_converged: bool, checked: bool) -> Option<Work> {
        let mut state = self.shared.state();
        loop {
            state.requests.retain(|request| !request.reply.is_closed());
            state.verifications.retain(|verification| !verification.reply.is_closed());
            let scene = state.scene.borrow().clone();
            // At the end the scene is as it was in the last frame.
            let revision = scene.as_ref().map_or(self.scene.revision, |scene| scene.revision);
            let newest = Shown { scene: revision, camera: state.camera.revision };
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
        newest: Shown,
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
            if subscriber.pace.due_at(newest, exposure_converged, start) <= start {
                subscriber.pace.served(newest, start);
                want(subscriber.view, subscriber.wanted);
                subscribers.push((subscriber.id, Arc::clone(&subscriber.slot)));
            }
        }
        Job { requests, subscribers, wanted, camera: state.camera, pose_time: state.pose_time, scene, start }
    }
}
