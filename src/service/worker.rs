//! The render thread: it alone owns the engine. What it is told stands in [`super::render`].
//!
//! It sleeps until a request is there or a subscriber is due, then begins **one** frame that serves all of them, with the
//! camera that is the newest at that moment. Views with settings of their own, and HDR images that are drawn apart, are frames of their own,
//! which take turns. While that frame is drawn, the next one is begun if one is due: as late as it
//! can be without the device having to wait for it ([`super::forecast`]). There are never more than two at a time, and they
//! are finished in order. What takes long is done elsewhere ([`super::workshop`]). What becomes of frames that
//! cannot be drawn is in [`losing`].

mod losing;
#[cfg(test)]
mod tests;

use std::{
    collections::{HashMap, VecDeque},
    mem,
    sync::{Arc, Condvar, Mutex, PoisonError},
    thread,
    time::{Duration, Instant, SystemTime},
};

use glam::DVec3;
use tokio::sync::{oneshot, watch};
use tracing::{Span, field};

use super::{
    SPANS,
    audit::{AuditReport, AuditedFrame, Auditor},
    engine::{Engine, EngineError},
    forecast::{Expected, Forecast},
    objects::Objects,
    order::EncodedImages,
    quality::{self, Quality},
    render::{Capacity, Failures, RenderHandle, Request, Shared, State},
    scene::SceneState,
    schedule::{Pace, Revisions},
    slot::{GivenUp, RenderFailure, RenderedFrame, Slot},
    streams::Streams,
    track::Track,
    views::{ViewId, ViewSet},
};
use crate::{
    catalogue::chunks::StarSet,
    plan::{
        adaptation::Adaptation,
        budget::draws_outputs_apart,
        glare::sky_cube::map_place_pc,
        settings::{ExposureSettings, RenderSettings},
        view_settings::{ExposureGroup, FrameGroup},
    },
    render::{FrameRequest, SkyMapUse, Wanted},
    scene::{Camera, SceneClock, SceneObjects, SceneSnapshot, SeenStars},
    units::PARSEC_M,
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
    scene: (SceneSnapshot, Arc<SeenStars>),
    shown: (Objects, SceneClock, ViewSet),
    settings: RenderSettings,
    capacity: Capacity,
) -> std::io::Result<(RenderHandle, RenderThread)> {
    spawn_with(engine, scene, shown, settings, capacity, Forecast::default())
}

/// The same with what is known already of how long frames take.
fn spawn_with(
    engine: Box<dyn Engine>,
    (scene, stars): (SceneSnapshot, Arc<SeenStars>),
    (objects, clock, views): (Objects, SceneClock, ViewSet),
    settings: RenderSettings,
    capacity: Capacity,
    forecast: Forecast,
) -> std::io::Result<(RenderHandle, RenderThread)> {
    let shown = SceneState {
        revision: scene.revision,
        stars: settings.stars.clone(),
        asteroids: settings.asteroids.clone(),
        objects,
        clock,
        views: Arc::new(views),
        jumps: 0,
    };
    let state = State {
        camera: scene.camera,
        pose_time: SystemTime::now(),
        scene: watch::Sender::new(Some(shown.clone())),
        newest_scene: shown.clone(),
        settings: settings.clone(),
        requests: VecDeque::new(),
        subscribers: Vec::new(),
        frames_rendered: 0,
        last_times: None,
        last_age: None,
        quality: settings.accuracy.frame_ms.map(Quality::new),
        newest: HashMap::new(),
        failures: Failures::default(),
        losses: 0,
        track: Track::default(),
        lease: None,
        watched_camera: watch::Sender::new(Some(scene.camera)),
        limits: engine.limits(),
        draining: false,
        stop: false,
    };
    let shared = Arc::new(Shared {
        state: Mutex::new(state),
        wake: Condvar::new(),
        stars,
        capacity,
        streams: Streams::new(capacity.subscribers),
        audits: AuditReport::default(),
        placed: Mutex::default(),
    });
    let auditor = match settings.accuracy.audit {
        true => Some(Auditor::spawn(shared.audits.clone(), engine.limits())?),
        false => None,
    };
    let (sender, ended) = oneshot::channel();
    let farewell = Farewell { shared: Arc::clone(&shared), _ended: sender };
    let groups = Groups::new(&settings, &shown, 0);
    let worker = Worker {
        shared: Arc::clone(&shared),
        engine,
        scene,
        settings,
        groups: Arc::new(groups),
        eyes: HashMap::new(),
        last_kind: (0, false),
        map_place_pc: HashMap::new(),
        in_flight: VecDeque::new(),
        forecast,
        last_drawn: Instant::now(),
        auditor,
        losses: 0,
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
    /// Of each view of the group.
    wanted: Vec<Wanted>,
    /// The frames of the scene, and which of them this one is.
    groups: Arc<Groups>,
    group: usize,
    camera: Camera,
    pose_time: SystemTime,
    scene: SceneState,
    /// Of the scene's clock.
    step: u64,
    /// The moment that it shows.
    time_s: f64,
    /// As they are at that moment.
    objects: Arc<SceneObjects>,
    stars: Arc<StarSet>,
    start: Instant,
}

impl Job {
    fn frame_group(&self) -> &FrameGroup {
        &self.frame_groups()[self.group]
    }

    /// Who looks at it.
    fn eye(&self) -> &EyeOf {
        &self.groups.eyes[self.group]
    }

    /// What its eye adapts by, and how often the scene has jumped.
    fn adapts_by(&self) -> (ExposureSettings, u64) {
        (self.frame_group().settings.exposure, self.scene.jumps)
    }

    /// The groups of frames like this one: HDR images give up nothing.
    fn frame_groups(&self) -> &[FrameGroup] {
        if self.wanted.iter().any(|wanted| wanted.hdr) { &self.groups.all } else { &self.groups.reduced }
    }

    /// The level of quality that it is drawn at, if it is one that may give up some.
    fn level(&self) -> Option<u32> {
        (!self.wanted.iter().any(|wanted| wanted.hdr)).then_some(self.groups.level)
    }

    fn shows(&self) -> Revisions {
        Revisions { scene: self.scene.revision, camera: self.camera.revision, step: self.step }
    }
}

/// The frames that the views of a scene make.
struct Groups {
    /// Revision of the scene that they are of.
    revision: u64,
    all: Vec<FrameGroup>,
    /// The same groups as display images alone are drawn at the present level of quality.
    reduced: Vec<FrameGroup>,
    /// That level; 0: as configured.
    level: u32,
    /// For each view the number of its group, and its own number there.
    of_view: HashMap<ViewId, (usize, usize)>,
    /// For each group who looks at it.
    eyes: Vec<EyeOf>,
    /// For each group whether images of its frames differ by whether HDR images are asked for.
    apart: Vec<bool>,
}

impl Groups {
    fn new(general: &RenderSettings, scene: &SceneState, level: u32) -> Self {
        let common =
            RenderSettings { stars: scene.stars.clone(), asteroids: scene.asteroids.clone(), ..general.clone() };
        let (all, ids) = (scene.views.frame_groups(&common), scene.views.ids());
        let mut of_view = HashMap::new();
        for (number, group) in all.iter().enumerate() {
            of_view.extend(group.views.iter().enumerate().map(|(own, view)| (ids[*view], (number, own))));
        }
        // Another view of the name of one that was deleted is looked at by another eye.
        let alone =
            |group: &FrameGroup| matches!(group.exposure_group, ExposureGroup::OfView(_)).then(|| ids[group.views[0]]);
        let eyes = all.iter().map(|group| (group.exposure_group.clone(), alone(group))).collect();
        let is_apart = |group: &FrameGroup| {
            let viewports = group.rig.viewports(glam::DQuat::IDENTITY);
            draws_outputs_apart(&group.settings, &scene.objects.drawn, &viewports)
        };
        let apart = all.iter().map(is_apart).collect();
        // The exposure is that of what is configured.
        let at_level =
            |group: &FrameGroup| FrameGroup { settings: quality::settings_at(level, &group.settings), ..group.clone() };
        let reduced = all.iter().map(at_level).collect();
        Self { revision: scene.revision, all, reduced, level, of_view, eyes, apart }
    }

    /// How a view is exposed, and who looks at it.
    fn exposure_of(&self, view: ViewId) -> Option<(&ExposureSettings, &EyeOf)> {
        let (group, _) = self.of_view.get(&view)?;
        Some((&self.all[*group].settings.exposure, &self.eyes[*group]))
    }

    /// Which frame shows what is wanted of a view: the number of its group, and whether that is one for HDR images. Those of display images
    /// have a budget of their own, and who asks for HDR images beside them must not change them: they are two frames. An exact budget
    /// has them in one.
    fn kind_of(&self, view: ViewId, wanted: Wanted) -> Kind {
        // Nobody waits for a view that the scene has not.
        let group = self.of_view[&view].0;
        (group, self.apart[group] && wanted.hdr)
    }
}

/// Number of a group, and whether its frame is one for HDR images that is drawn apart.
type Kind = (usize, bool);

/// Whose eye one is: an exposure group, and which view where it has the exposure of one alone.
type EyeOf = (ExposureGroup, Option<ViewId>);

/// An eye that looks at all views of an exposure group.
#[derive(Default)]
struct AdaptingEye {
    /// What it adapts by, and how often the scene has jumped; one that has changed is another eye.
    of: Option<(ExposureSettings, u64)>,
    adaptation: Adaptation,
    /// When the last frame that came out was started, and what it showed.
    last: Option<(Instant, Revisions)>,
}

/// A frame that the engine is at work on.
struct InFlight {
    job: Job,
    submitted: Instant,
    /// The exposure was not given, and the eye adapts from what this frame is going to have.
    starts_adaptation: bool,
    /// Whether its exposure was given.
    adapted: bool,
    span: Span,
}

/// What the thread does next.
enum Work {
    /// A frame is begun.
    Begin(Box<Job>),
    /// The oldest frame is waited for and handed out.
    Finish,
}

/// How often a camera that moves is told while nobody looks.
const UNSEEN_INTERVAL: Duration = Duration::from_millis(100);

/// What there is to do at a moment.
struct Tasks {
    scene: SceneState,
    newest: Revisions,
    /// When the next frame is due; `None`: nobody wants one.
    due: Option<Instant>,
    /// When the camera begins to move or the scene's clock takes its next step; `None`: they rest.
    moves: Option<Instant>,
    /// The frames of the scene.
    groups: Arc<Groups>,
}

struct Worker {
    shared: Arc<Shared>,
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    /// The settings of views that have none of their own.
    settings: RenderSettings,
    /// The frames of the newest scene.
    groups: Arc<Groups>,
    eyes: HashMap<EyeOf, AdaptingEye>,
    /// What the last frame was.
    last_kind: Kind,
    /// Where a map of faint light would be made for the camera of the last frame of each group.
    map_place_pc: HashMap<usize, DVec3>,
    /// The oldest one first.
    in_flight: VecDeque<InFlight>,
    forecast: Forecast,
    /// When the engine was through with the last frame.
    last_drawn: Instant,
    /// Compares frames with f64, where that is asked for.
    auditor: Option<Auditor>,
    /// How often the engine was lost since the last frame.
    losses: u32,
}

impl Worker {
    fn run(mut self) -> Result<(), EngineError> {
        while let Some(work) = self.next_work() {
            match work {
                Work::Begin(job) => self.begin(*job)?,
                Work::Finish => self.finish()?,
            }
        }
        Ok(())
    }

    /// Begins a frame. An error is one that the engine does not outlive.
    fn begin(&mut self, mut job: Job) -> Result<(), EngineError> {
        job.objects = self.shared.objects_at(&job.scene.objects.drawn, job.time_s);
        self.scene.camera = job.camera;
        self.scene.revision = job.scene.revision;
        self.scene.objects = Arc::clone(&job.objects);
        self.scene.stars = self.shared.stars.at(job.objects.observer.as_ref(), job.time_s);
        job.stars = Arc::clone(&self.scene.stars);
        // While the camera travels, a map would be out of date when it is there.
        let place_pc = map_place_pc(self.scene.camera.position_m / PARSEC_M);
        let rests = self.map_place_pc.insert(job.group, place_pc).is_none_or(|last| last == place_pc);
        let exposure = job.frame_group().settings.exposure;
        let adapted_ev100 = self.adapted_ev100(&job);
        let starts_adaptation = Adaptation::adapts(&exposure) && adapted_ev100.is_none();
        let request = FrameRequest::of_group(&self.scene, job.frame_groups(), job.group)
            .wanted_of_each(&job.wanted)
            .sky_map(if rests { SkyMapUse::InTurn } else { SkyMapUse::Off })
            .adapted_ev100(adapted_ev100);
        let span = tracing::trace_span!(
            target: SPANS,
            "frame",
            scene = job.scene.revision,
            camera = job.camera.revision,
            number = field::Empty,
            plan_ms = field::Empty,
            gpu_ms = field::Empty
        );
        match self.engine.submit(request) {
            Ok(()) => {
                let submitted = Instant::now();
                let adapted = adapted_ev100.is_some();
                self.in_flight.push_back(InFlight { job, submitted, starts_adaptation, adapted, span });
                Ok(())
            }
            Err(error) if error.lost => self.lose(job, error),
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
    fn adapted_ev100(&mut self, job: &Job) -> Option<f64> {
        let exposure = job.frame_group().settings.exposure;
        let eye = self.eyes.entry(job.eye().clone()).or_default();
        let of = job.adapts_by();
        if eye.of.replace(of).is_some_and(|before| before != of) {
            *eye = AdaptingEye { of: Some(of), ..AdaptingEye::default() };
        }
        let shares = |before: &&InFlight| before.job.eye() == job.eye();
        let before = self.in_flight.iter().rev().find(shares);
        let begun = before.map(|before| (before.job.start, before.job.shows())).or(eye.last);
        let new_for = begun.filter(|(_, showed)| *showed != job.shows()).map(|(start, _)| job.start - start);
        let dt = eye.last.map_or(Duration::ZERO, |(start, _)| job.start - start);
        eye.adaptation.exposure(dt.as_secs_f64(), new_for.unwrap_or_default().as_secs_f64(), &exposure)
    }

    /// Waits for the oldest frame and hands it out. An error is one that the engine does not outlive.
    fn finish(&mut self) -> Result<(), EngineError> {
        let Some(InFlight { job, submitted, adapted, span, .. }) = self.in_flight.pop_front() else { return Ok(()) };
        self.engine.is_drawn_within(Duration::MAX);
        let drawn = Instant::now();
        // One frame is drawn after the other.
        let began = mem::replace(&mut self.last_drawn, drawn).max(submitted);
        match self.engine.finish() {
            Ok(frame) => {
                let planned = Duration::try_from_secs_f64(frame.times.plan_ms * 1e-3).unwrap_or_default();
                self.forecast.note(planned, drawn - began);
                span.record("number", frame.number);
                span.record("plan_ms", frame.times.plan_ms);
                span.record("gpu_ms", frame.times.gpu_ms);
                let FrameGroup { views, .. } = job.frame_group();
                // There is none any more of a view that was deleted meanwhile, and one of settings that have changed since is the eye of those.
                if let Some(eye) = self.eyes.get_mut(job.eye())
                    && eye.of.is_none_or(|of| of == job.adapts_by())
                {
                    eye.last = Some((job.start, job.shows()));
                    eye.adaptation.observe(frame.exposure_ev100, frame.metered_ev100);
                }
                let frame = frame.of_views(views);
                self.losses = 0;
                let mut state = self.shared.state();
                state.frames_rendered += 1;
                state.failures.problem = None;
                for (view, wanted) in views.iter().zip(&job.wanted) {
                    let view = job.scene.views.ids()[*view];
                    // What is kept of a view that was deleted meanwhile would be kept for ever.
                    if (wanted.display || wanted.hdr) && state.has_view(view) {
                        state.newest.insert(view, (frame.number, job.shows(), job.start));
                    }
                }
                state.last_times = Some(frame.times.clone());
                state.last_age = job.pose_time.elapsed().ok();
                let given_up = state.quality.as_mut().zip(job.level()).map(|(quality, level)| {
                    quality.note(level, frame.times.total_ms);
                    let of = &job.groups.all[job.group].settings;
                    GivenUp { level, what: quality::given_up(level, of) }
                });
                drop(state);
                let frame = Arc::new(RenderedFrame {
                    frame: Arc::new(frame),
                    views: Arc::clone(job.scene.views.ids()),
                    camera: job.camera,
                    pose_time: job.pose_time,
                    render_time: SystemTime::now(),
                    shows: job.shows(),
                    given_up: given_up.unwrap_or_default(),
                    encoded: EncodedImages::default(),
                });
                if let Some(auditor) = &self.auditor {
                    auditor.offer(|| AuditedFrame {
                        rendered: Arc::clone(&frame),
                        scene: SceneSnapshot {
                            revision: job.scene.revision,
                            stars: Arc::clone(&job.stars),
                            objects: Arc::clone(&job.objects),
                            camera: job.camera,
                        },
                        group: job.frame_group().clone(),
                        adapted,
                    });
                }
                for request in job.requests {
                    // A caller that went away meanwhile needs no answer.
                    let _ = request.reply.send(Ok(Arc::clone(&frame)));
                }
                for slot in job.subscribers {
                    slot.offer(Arc::clone(&frame));
                }
                Ok(())
            }
            Err(error) if error.lost => self.lose(job, error),
            Err(error) => {
                self.refuse(job, &RenderFailure::Engine(error.to_string()));
                Ok(())
            }
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

    /// The next work while no frame is drawn.
    fn next_work_at_rest(&mut self) -> Option<Work> {
        let shared = Arc::clone(&self.shared);
        let mut state = shared.state();
        loop {
            let now = Instant::now();
            let tasks = self.tasks(&mut state, now);
            let frame_due = tasks.due.is_some_and(|due| due <= now);
            if frame_due {
                return Some(Work::Begin(Box::new(self.take_job(&mut state, tasks, now))));
            }
            if state.stop {
                return None;
            }
            state = match tasks.due.into_iter().chain(tasks.moves).min() {
                Some(due) => {
                    let wait = shared.wake.wait_timeout(state, due - now);
                    wait.unwrap_or_else(PoisonError::into_inner).0
                }
                None => shared.wake.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// The next work while a frame is drawn: another one, if one is due before this one is expected to end. A frame that ends
    /// sooner is not kept waiting, and what is due only later has the camera of that time.
    fn work_beside_a_frame(&mut self, Expected { plan_next, end }: Expected) -> Work {
        let mut wait = plan_next.saturating_duration_since(Instant::now());
        let shared = Arc::clone(&self.shared);
        loop {
            if self.engine.is_drawn_within(wait) {
                return Work::Finish;
            }
            let mut state = shared.state();
            let now = Instant::now();
            let tasks = self.tasks(&mut state, now);
            if tasks.due.is_some_and(|due| due <= now) {
                return Work::Begin(Box::new(self.take_job(&mut state, tasks, now)));
            }
            if now >= end {
                return Work::Finish;
            }
            wait = LOOK_INTERVAL;
        }
    }

    /// What there is to do, without those who went away.
    fn tasks(&mut self, state: &mut State, now: Instant) -> Tasks {
        state.requests.retain(|request| !request.reply.is_closed());
        state.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
        // What is still asked for at the end is drawn as it was last.
        let scene = state.newest_scene.clone();
        // Where frames are seen that begin now.
        let seen = SystemTime::now() + self.forecast.frame();
        let moves = state.track.moves().map(|moves| moves.duration_since(seen).unwrap_or_default());
        let is_moving = moves == Some(Duration::ZERO);
        if is_moving && state.subscribers.is_empty() && state.requests.is_empty() {
            // Nobody looks, but somebody may ask where it is.
            state.follow(seen);
        }
        // A camera that moves has another pose in each frame.
        let camera = state.camera.revision + u64::from(is_moving);
        let newest = Revisions { scene: scene.revision, camera, step: scene.clock.step(seen) };
        let level = state.quality.as_ref().map_or(0, Quality::level);
        if (self.groups.revision, self.groups.level) != (scene.revision, level) {
            self.groups = Arc::new(Groups::new(&self.settings, &scene, level));
            let groups = &self.groups;
            self.eyes.retain(|of, _| groups.eyes.contains(of));
            self.map_place_pc.retain(|group, _| *group < groups.all.len());
        }
        let due_at = |pace: &Pace, view: ViewId| pace.due_at(newest, self.converged(view), now);
        let of_streams = state.subscribers.iter().map(|stream| due_at(&stream.pace, stream.view));
        let of_requests = state.requests.iter().map(|request| due_at(&request.pace, request.view));
        let due = of_streams.chain(of_requests).min();
        let moves = moves.map(|moves| now + if is_moving { UNSEEN_INTERVAL } else { moves });
        let is_looked_at = !state.subscribers.is_empty() || !state.requests.is_empty();
        let steps = scene.clock.next_step(seen).filter(|_| is_looked_at).map(|wait| now + wait);
        let moves = moves.into_iter().chain(steps).min();
        Tasks { scene, newest, due, moves, groups: Arc::clone(&self.groups) }
    }

    /// Whether another frame of the same scene would show a view with the same exposure.
    fn converged(&self, view: ViewId) -> bool {
        let exposure = self.groups.exposure_of(view);
        let eye = exposure.and_then(|(exposure, of)| Some((self.eyes.get(of)?, exposure)));
        eye.is_none_or(|(eye, exposure)| eye.adaptation.converged(exposure))
    }

    fn take_job(&mut self, state: &mut State, Tasks { scene, newest, groups, .. }: Tasks, start: Instant) -> Job {
        let seen = SystemTime::now() + self.forecast.frame();
        state.follow(seen);
        let clock = scene.clock;
        let newest = Revisions { camera: state.camera.revision, step: clock.step(seen), ..newest };
        let is_due = |pace: &Pace, view: ViewId| pace.due_at(newest, self.converged(view), start) <= start;
        let due: Vec<bool> = state.subscribers.iter().map(|stream| is_due(&stream.pace, stream.view)).collect();
        let (waiting, later): (VecDeque<Request>, VecDeque<Request>) =
            mem::take(&mut state.requests).into_iter().partition(|request| is_due(&request.pace, request.view));
        state.requests = later;
        let of_requests = waiting.iter().map(|request| groups.kind_of(request.view, request.wanted));
        let of_streams = state.subscribers.iter().zip(&due).filter(|(_, due)| **due);
        let of_streams = of_streams.map(|(subscriber, _)| groups.kind_of(subscriber.view, subscriber.wanted));
        let kind = next_kind(of_requests.chain(of_streams), self.last_kind);
        self.last_kind = kind;
        let mut wanted = vec![Wanted::default(); groups.all.get(kind.0).map_or(0, |group| group.views.len())];
        let mut want = |view: ViewId, what: Wanted| wanted[groups.of_view[&view].1] |= what;
        let (requests, others): (Vec<Request>, Vec<Request>) =
            waiting.into_iter().partition(|request| groups.kind_of(request.view, request.wanted) == kind);
        // Before those that are due later, in their order.
        others.into_iter().rev().for_each(|request| state.requests.push_front(request));
        for request in &requests {
            want(request.view, request.wanted);
        }
        let mut subscribers = Vec::new();
        for (subscriber, due) in state.subscribers.iter_mut().zip(due) {
            if due
                && groups.kind_of(subscriber.view, subscriber.wanted) == kind
                && let Some(slot) = subscriber.slot.upgrade()
            {
                subscriber.pace.served(newest, start);
                want(subscriber.view, subscriber.wanted);
                subscribers.push(slot);
            }
        }
        let (camera, pose_time) = (state.camera, state.pose_time);
        let objects = Arc::clone(&scene.objects.drawn);
        Job {
            requests,
            subscribers,
            wanted,
            groups,
            group: kind.0,
            camera,
            pose_time,
            step: newest.step,
            time_s: clock.time_s(seen),
            objects,
            stars: Arc::clone(&self.scene.stars),
            scene,
            start,
        }
    }
}

/// What the next frame is, of those that are due: they take turns.
fn next_kind(due: impl Iterator<Item = Kind>, last: Kind) -> Kind {
    let due: Vec<Kind> = due.collect();
    let after = due.iter().filter(|kind| **kind > last).min();
    after.or(due.iter().min()).copied().unwrap_or(last)
}
