//! The render thread: it alone owns the engine. What it is told stands in [`super::render`].
//!
//! It sleeps until a request is there or a subscriber is due, then begins **one** frame that serves all of them, with the
//! camera that is the newest at that moment. While that frame is drawn, the next one is begun if one is due: as late as it
//! can be without the device having to wait for it ([`super::forecast`]). There are never more than two at a time, and they
//! are finished in order. Failure tests that a client asked for are run one at a time, each after a frame if one is due, and
//! while no frame is drawn.

#[cfg(test)]
mod tests;

use std::{
    collections::VecDeque,
    mem,
    sync::{Arc, Condvar, Mutex, PoisonError},
    thread,
    time::{Duration, Instant, SystemTime},
};

use glam::DVec3;
use tokio::sync::{oneshot, watch};

use super::{
    engine::{Engine, EngineError},
    forecast::{Expected, Forecast},
    objects::Objects,
    render::{Capacity, RenderHandle, Request, Shared, State, Subscriber, Verification},
    scene::SceneState,
    schedule::Revisions,
    slot::{RenderFailure, RenderedFrame, Slot},
    streams::Streams,
};
use crate::{
    plan::{
        adaptation::Adaptation, budget::draws_outputs_apart, glare::sky_cube::map_place_pc, settings::RenderSettings,
    },
    render::{FrameRequest, SkyMapUse, Wanted},
    scene::{Camera, SceneSnapshot},
    units::PARSEC_M,
    view::Rig,
};

/// Frames at a time.
const MOST_IN_FLIGHT: usize = 2;
/// While a frame is about to end, it is looked this often whether the next one is due.
const LOOK_INTERVAL: Duration = Duration::from_millis(1);

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
    spawn_with(engine, scene, objects, rig, settings, capacity, Forecast::default())
}

/// The same with what is known already of how long frames take.
fn spawn_with(
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    objects: Objects,
    rig: Arc<Rig>,
    settings: RenderSettings,
    capacity: Capacity,
    forecast: Forecast,
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
    let worker = Worker {
        shared: Arc::clone(&shared),
        engine,
        scene,
        shown,
        rig,
        settings,
        adaptation: Adaptation::default(),
        last: None,
        checked: false,
        last_exact: false,
        map_place_pc: None,
        in_flight: VecDeque::new(),
        forecast,
        last_drawn: Instant::now(),
    };
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
    /// For HDR images; otherwise for display images alone, within their budget.
    exact: bool,
    camera: Camera,
    pose_time: SystemTime,
    scene: SceneState,
    start: Instant,
}

impl Job {
    fn shows(&self) -> Revisions {
        Revisions { scene: self.scene.revision, camera: self.camera.revision }
    }
}

/// A frame that the engine is at work on.
struct InFlight {
    job: Job,
    submitted: Instant,
    /// The exposure was not given, and the eye adapts from what this frame is going to have.
    starts_adaptation: bool,
}

/// What the thread does next.
enum Work {
    /// A frame is begun.
    Begin(Job),
    /// The oldest frame is waited for and handed out.
    Finish,
    Check(Verification),
}

/// What there is to do at a moment.
struct Tasks {
    scene: SceneState,
    newest: Revisions,
    /// When the next frame is due; `None`: nobody wants one.
    due: Option<Instant>,
}

struct Worker {
    shared: Arc<Shared>,
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    /// What the last frame showed.
    shown: SceneState,
    rig: Arc<Rig>,
    settings: RenderSettings,
    adaptation: Adaptation,
    /// When the last frame that came out was started, and what it showed.
    last: Option<(Instant, Revisions)>,
    /// The last work was a check.
    checked: bool,
    /// The last frame was one for HDR images.
    last_exact: bool,
    /// Where a map of faint light would be made for the camera of the last frame.
    map_place_pc: Option<DVec3>,
    /// The oldest one first.
    in_flight: VecDeque<InFlight>,
    forecast: Forecast,
    /// When the engine was through with the last frame.
    last_drawn: Instant,
}

impl Worker {
    fn run(mut self) -> Result<(), EngineError> {
        while let Some(work) = self.next_work() {
            match work {
                Work::Begin(job) => self.begin(job)?,
                Work::Finish => self.finish()?,
                Work::Check(Verification { check, settings, reply }) => {
                    // A caller that went away meanwhile needs no answer.
                    let _ = reply.send(self.engine.verify(check, &settings));
                    self.checked = true;
                }
            }
        }
        Ok(())
    }

    /// Begins a frame. An error is one that the engine does not outlive.
    fn begin(&mut self, job: Job) -> Result<(), EngineError> {
        self.checked = false;
        self.last_exact = job.exact;
        self.scene.camera = job.camera;
        self.scene.revision = job.scene.revision;
        self.scene.objects = Arc::clone(&job.scene.objects.drawn);
        self.settings.stars = job.scene.stars.clone();
        self.settings.asteroids = job.scene.asteroids.clone();
        self.shown = job.scene.clone();
        // While the camera travels, a map would be out of date when it is there.
        let place_pc = map_place_pc(self.scene.camera.position_m / PARSEC_M);
        let rests = self.map_place_pc.replace(place_pc).is_none_or(|last| last == place_pc);
        let exposure = &self.settings.exposure;
        let adapted_ev100 = self.adapted_ev100(&job);
        let starts_adaptation = Adaptation::adapts(exposure) && adapted_ev100.is_none();
        let request = FrameRequest::new(&self.scene, &self.rig)
            .settings(&self.settings)
            .wanted_of_each(&job.wanted)
            .sky_map(if rests { SkyMapUse::InTurn } else { SkyMapUse::Off })
            .adapted_ev100(adapted_ev100);
        match self.engine.submit(request) {
            Ok(()) => {
                let submitted = Instant::now();
                self.in_flight.push_back(InFlight { job, submitted, starts_adaptation });
                Ok(())
            }
            Err(error) if error.lost => Err(self.lose(job, error)),
            Err(error) => {
                // Those who wait for a frame before this one get it first.
                while !self.in_flight.is_empty() {
                    self.finish()?;
                }
                self.refuse(job, &RenderFailure::Engine(error.to_string()));
                Ok(())
            }
        }
    }

    /// The exposure of a frame, from the last one that came out: the one in flight has not told yet what it asks for.
    fn adapted_ev100(&self, job: &Job) -> Option<f64> {
        let begun = self.in_flight.back().map(|before| (before.job.start, before.job.shows())).or(self.last);
        let new_for = begun.filter(|(_, showed)| *showed != job.shows()).map(|(start, _)| job.start - start);
        let dt = self.last.map_or(Duration::ZERO, |(start, _)| job.start - start);
        self.adaptation.exposure(dt.as_secs_f64(), new_for.unwrap_or_default().as_secs_f64(), &self.settings.exposure)
    }

    /// Waits for the oldest frame and hands it out. An error is one that the engine does not outlive.
    fn finish(&mut self) -> Result<(), EngineError> {
        let Some(InFlight { job, submitted, .. }) = self.in_flight.pop_front() else { return Ok(()) };
        self.engine.is_drawn_within(Duration::MAX);
        let drawn = Instant::now();
        // One frame is drawn after the other.
        let began = mem::replace(&mut self.last_drawn, drawn).max(submitted);
        match self.engine.finish() {
            Ok(frame) => {
                let planned = Duration::try_from_secs_f64(frame.times.plan_ms * 1e-3).unwrap_or_default();
                self.forecast.note(planned, drawn - began);
                self.last = Some((job.start, job.shows()));
                self.adaptation.observe(frame.exposure_ev100, frame.metered_ev100);
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
                Ok(())
            }
            Err(error) if error.lost => Err(self.lose(job, error)),
            Err(error) => {
                self.refuse(job, &RenderFailure::Engine(error.to_string()));
                Ok(())
            }
        }
    }

    /// No frame will come any more, neither of `job` nor of those in flight.
    fn lose(&mut self, job: Job, error: EngineError) -> EngineError {
        let failure = RenderFailure::Engine(error.to_string());
        let jobs: Vec<Job> = self.in_flight.drain(..).map(|frame| frame.job).chain([job]).collect();
        jobs.into_iter().for_each(|job| self.refuse(job, &failure));
        error
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

    /// Sleeps until there is something to do; `None`: the thread is to end.
    fn next_work(&mut self) -> Option<Work> {
        match self.in_flight.back() {
            None => self.next_work_at_rest(),
            Some(frame) if self.in_flight.len() < MOST_IN_FLIGHT && !frame.starts_adaptation => {
                let began = frame.submitted.max(self.last_drawn);
                Some(self.forecast.of(began).map_or(Work::Finish, |expected| self.work_beside_a_frame(expected)))
            }
            Some(_) => Some(Work::Finish),
        }
    }

    /// The next work while no frame is drawn. Frames and checks take turns.
    fn next_work_at_rest(&self) -> Option<Work> {
        let mut state = self.shared.state();
        loop {
            let now = Instant::now();
            let tasks = self.tasks(&mut state, now);
            let frame_due = tasks.due.is_some_and(|due| due <= now);
            if !(frame_due && self.checked)
                && let Some(verification) = state.verifications.pop_front()
            {
                return Some(Work::Check(verification));
            }
            if frame_due {
                return Some(Work::Begin(self.take_job(&mut state, tasks, now)));
            }
            if state.stop {
                return None;
            }
            state = match tasks.due {
                Some(due) => {
                    let wait = self.shared.wake.wait_timeout(state, due - now);
                    wait.unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.shared.wake.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// The next work while a frame is drawn: another one, if one is due before this one is expected to end. A frame that ends
    /// sooner is not kept waiting, and what is due only later has the camera of that time.
    fn work_beside_a_frame(&mut self, Expected { plan_next, end }: Expected) -> Work {
        let mut wait = plan_next.saturating_duration_since(Instant::now());
        loop {
            if self.engine.is_drawn_within(wait) {
                return Work::Finish;
            }
            let mut state = self.shared.state();
            let now = Instant::now();
            let tasks = self.tasks(&mut state, now);
            if !state.verifications.is_empty() {
                return Work::Finish;
            }
            if tasks.due.is_some_and(|due| due <= now) {
                return Work::Begin(self.take_job(&mut state, tasks, now));
            }
            if now >= end {
                return Work::Finish;
            }
            wait = LOOK_INTERVAL;
        }
    }

    /// What there is to do, without those who went away.
    fn tasks(&self, state: &mut State, now: Instant) -> Tasks {
        state.requests.retain(|request| !request.reply.is_closed());
        state.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
        state.verifications.retain(|verification| !verification.reply.is_closed());
        // At the end the scene is as it was in the last frame.
        let scene = state.scene.borrow().clone().unwrap_or_else(|| self.shown.clone());
        let newest = Revisions { scene: scene.revision, camera: state.camera.revision };
        let converged = self.converged();
        let of_streams = state.subscribers.iter().map(|s| s.pace.due_at(newest, converged, now)).min();
        let due = if state.requests.is_empty() { of_streams } else { Some(now) };
        Tasks { scene, newest, due }
    }

    fn converged(&self) -> bool {
        self.adaptation.converged(&self.settings.exposure)
    }

    fn take_job(&self, state: &mut State, Tasks { scene, newest, .. }: Tasks, start: Instant) -> Job {
        let converged = self.converged();
        let mut wanted = vec![Wanted::default(); self.rig.views().len()];
        let mut want = |view: usize, what: Wanted| {
            wanted[view].display |= what.display;
            wanted[view].hdr |= what.hdr;
        };
        let is_due = |subscriber: &Subscriber| subscriber.pace.due_at(newest, converged, start) <= start;
        let due = state.subscribers.iter().filter(|subscriber| is_due(subscriber)).map(|subscriber| subscriber.wanted);
        let exact = self.is_exact(state.requests.iter().map(|request| request.wanted).chain(due));
        let viewports = self.rig.viewports(glam::DQuat::IDENTITY);
        let apart = draws_outputs_apart(&self.settings, &self.scene.objects, &viewports);
        // Images belong to a frame for HDR images or to one without them. An exact budget has them in one.
        let belongs = |wanted: Wanted| wanted.hdr == exact || !apart;
        let (requests, later): (VecDeque<Request>, VecDeque<Request>) =
            mem::take(&mut state.requests).into_iter().partition(|request| belongs(request.wanted));
        let requests = Vec::from(requests);
        state.requests = later;
        for request in &requests {
            want(request.view, request.wanted);
        }
        let mut subscribers = Vec::new();
        for subscriber in &mut state.subscribers {
            if is_due(subscriber)
                && belongs(subscriber.wanted)
                && let Some(slot) = subscriber.slot.upgrade()
            {
                subscriber.pace.served(newest, start);
                want(subscriber.view, subscriber.wanted);
                subscribers.push(slot);
            }
        }
        Job { requests, subscribers, wanted, exact, camera: state.camera, pose_time: state.pose_time, scene, start }
    }

    /// Whether the next frame is one for HDR images. Those of display images have a budget of their own, and who asks for HDR images
    /// beside them must not change them: they are two frames, which take turns.
    fn is_exact(&self, due: impl Iterator<Item = Wanted>) -> bool {
        let (exact, shown): (Vec<Wanted>, Vec<Wanted>) = due.partition(|wanted| wanted.hdr);
        if shown.is_empty() || exact.is_empty() { !exact.is_empty() } else { !self.last_exact }
    }
}
