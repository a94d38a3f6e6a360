//! The render thread, which alone owns the engine. Its input is in [`super::shared_state`].
//!
//! It sleeps until a request arrives or a subscriber is due, then begins **one** frame for all of them, with the newest
//! camera. Views with different settings, and HDR images that are drawn separately, need separate frames, which take
//! turns. While a frame is drawn, the next one begins if it is due, as late as possible without the device having to
//! wait ([`super::forecast`]). At most two frames are in flight, and they are finished in order. Long work runs
//! elsewhere ([`super::background_jobs`]). Failed frames are handled in [`recovery`].

mod cues;
mod job;
mod recovery;
#[cfg(test)]
mod tests;

use std::{
    collections::{HashMap, VecDeque},
    mem,
    sync::{Arc, Condvar, Mutex, PoisonError},
    time::{Duration, Instant},
};

use glam::DVec3;
use tokio::sync::watch;
use tracing::{Span, field};

use self::job::{EyeOf, Groups, Job, Kind, next_kind};
use super::{
    auditor::{AuditReport, AuditedFrame, Auditor},
    camera_path::CameraPath,
    forecast::{Expected, Forecast},
    interface::{Engine, EngineError},
    led::CueRequest,
    quality::{self, Quality},
    render_handle::RenderHandle,
    shared_state::{CameraControl, Capacity, FrameQueue, RenderStatistics, Request, SceneControl, Shared, State},
};
use crate::{
    plan::{
        adaptation::Adaptation,
        glare::sky_cube::map_place_pc,
        settings::{ExposureSettings, RenderSettings},
        view_settings::FrameGroup,
    },
    render::{FrameRequest, SkyMapUse, Wanted},
    scene::{EndNotice, SceneClock, SceneSnapshot, SeenStars},
    service::{
        SPANS,
        frames::{
            errors::RenderFailure,
            image_encoding::EncodedImages,
            rendered_frame::{GivenUp, RenderedFrame},
            schedule::{Pace, Revisions},
            subscriptions::Streams,
        },
        scene::{
            camera::Horizontal,
            objects::Objects,
            state::SceneState,
            views::{ViewId, ViewSet},
        },
        threads::RunningThread,
        time_source::TimeSource,
    },
    units::PARSEC_M,
};

/// Maximum number of frames in flight.
const MOST_IN_FLIGHT: usize = 2;
/// Near the expected end of a frame, the thread checks at this interval whether the next one is due.
const LOOK_INTERVAL: Duration = Duration::from_millis(1);

/// The running thread. Its result is an orderly end, or the error that lost the engine.
pub(crate) type RenderThread = RunningThread<Result<(), EngineError>>;

/// Notifies all waiting callers when the thread ends, even by a panic.
struct Farewell {
    shared: Arc<Shared>,
}

impl Drop for Farewell {
    fn drop(&mut self) {
        let mut state = self.shared.state();
        // Dropping the replies notifies the callers.
        state.queue.requests.clear();
        state.end_streams(&Err(RenderFailure::Ended));
    }
}

/// Starts the thread.
pub(crate) fn spawn(
    engine: Box<dyn Engine>,
    scene: (SceneSnapshot, Arc<SeenStars>),
    scene_parts: (Objects, SceneClock, ViewSet),
    settings: RenderSettings,
    capacity: Capacity,
    time: TimeSource,
) -> std::io::Result<(RenderHandle, RenderThread)> {
    spawn_with(engine, scene, scene_parts, settings, (capacity, time), Forecast::default())
}

/// Starts the thread with known frame times.
fn spawn_with(
    engine: Box<dyn Engine>,
    (scene, stars): (SceneSnapshot, Arc<SeenStars>),
    (objects, clock, views): (Objects, SceneClock, ViewSet),
    settings: RenderSettings,
    (capacity, time): (Capacity, TimeSource),
    forecast: Forecast,
) -> std::io::Result<(RenderHandle, RenderThread)> {
    let initial = SceneState {
        revision: scene.revision,
        stars: settings.stars.clone(),
        asteroids: settings.asteroids.clone(),
        objects,
        clock,
        views: Arc::new(views),
        jumps: 0,
    };
    let state = State {
        camera: CameraControl {
            newest: scene.camera,
            pose_time: time.now(),
            path: CameraPath::default(),
            lease: None,
            streams: 0,
            path_of: 0,
            watched: watch::Sender::new(Some(scene.camera)),
        },
        scene: SceneControl { published: watch::Sender::new(Some(initial.clone())), newest: initial.clone() },
        queue: FrameQueue { requests: VecDeque::new(), subscribers: Vec::new(), newest_frames: HashMap::new() },
        statistics: RenderStatistics::default(),
        settings: settings.clone(),
        quality: settings.accuracy.frame_ms.map(Quality::new),
        led: None,
        time: time.clone(),
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
        time,
        audits: AuditReport::default(),
        placed: Mutex::default(),
    });
    let auditor = match settings.accuracy.audit {
        true => Some(Auditor::spawn(shared.audits.clone(), engine.limits())?),
        false => None,
    };
    let farewell = Farewell { shared: Arc::clone(&shared) };
    let groups = Groups::new(&settings, &initial, 0);
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
        end_notice: EndNotice::default(),
        forecast,
        last_drawn: Instant::now(),
        auditor,
        losses: 0,
    };
    let thread = RunningThread::spawn("render", move || {
        // Dropped after the worker.
        let _farewell = farewell;
        worker.run()
    })?;
    Ok((RenderHandle { shared }, thread))
}

/// Exposure state of all views of an exposure group.
#[derive(Default)]
struct AdaptingEye {
    /// Settings of the adaptation, and the number of jumps; a change resets the state.
    adapted_by: Option<(ExposureSettings, u64)>,
    adaptation: Adaptation,
    /// Start time and revisions of the last finished frame.
    last: Option<(Instant, Revisions)>,
}

/// A frame in flight.
struct InFlight {
    job: Job,
    submitted: Instant,
    /// Whether the adaptation continues from this frame's exposure.
    starts_adaptation: bool,
    /// Whether the adaptation or a cue set its exposure.
    adapted: bool,
    span: Span,
}

/// The next action of the thread.
enum Work {
    /// Begin a frame.
    Begin(Box<Job>),
    /// Wait for the oldest frame and deliver it.
    Finish,
    /// Draw a cue.
    Draw(Box<CueRequest>),
}

/// Interval at which a moving camera is published while no frames are requested.
const UNSEEN_INTERVAL: Duration = Duration::from_millis(100);

/// The work that there is at a given moment.
struct Tasks {
    scene: SceneState,
    newest: Revisions,
    /// Time at which the next frame is due; `None` if none is requested.
    due: Option<Instant>,
    /// Time at which the camera or the scene's clock moves next; `None` if both rest.
    moves: Option<Instant>,
    /// Frame groups of the scene.
    groups: Arc<Groups>,
}

struct Worker {
    shared: Arc<Shared>,
    engine: Box<dyn Engine>,
    scene: SceneSnapshot,
    /// General settings.
    settings: RenderSettings,
    /// Frame groups of the newest scene.
    groups: Arc<Groups>,
    eyes: HashMap<EyeOf, AdaptingEye>,
    /// Group of the last frame.
    last_kind: Kind,
    /// For each group, the place for which the last frame would have computed the map of faint light.
    map_place_pc: HashMap<usize, DVec3>,
    /// Frames in flight, oldest first.
    in_flight: VecDeque<InFlight>,
    /// Reports when the scene's time stops at a limit.
    end_notice: EndNotice,
    forecast: Forecast,
    /// Time at which the device finished the last frame.
    last_drawn: Instant,
    /// Compares frames with f64, if audits are on.
    auditor: Option<Auditor>,
    /// Number of losses of the engine since the last frame.
    losses: u32,
}

impl Worker {
    fn run(mut self) -> Result<(), EngineError> {
        while let Some(work) = self.next_work() {
            match work {
                Work::Begin(job) => self.begin(*job)?,
                Work::Finish => self.finish()?,
                Work::Draw(request) => self.draw_cue(*request)?,
            }
        }
        Ok(())
    }

    /// Begins a frame. An error means that the engine is lost for good.
    fn begin(&mut self, mut job: Job) -> Result<(), EngineError> {
        job.objects = self.shared.objects_at(&job.scene.objects.drawn, job.time_s);
        self.scene.camera = job.camera;
        self.scene.revision = job.scene.revision;
        self.scene.objects = Arc::clone(&job.objects);
        self.scene.stars = self.shared.stars.at(job.objects.observer.as_ref(), job.time_s);
        job.stars = Arc::clone(&self.scene.stars);
        // While the camera changes its place, a map would be outdated as soon as it is finished.
        let place_pc = map_place_pc(self.scene.camera.position_m / PARSEC_M);
        let rests = self.map_place_pc.insert(job.group, place_pc).is_none_or(|last| last == place_pc);
        let rests = job.cued.map_or(rests, |cued| cued.rests);
        let exposure = job.frame_group().settings.exposure;
        let adapted_ev100 = job.cued.map_or_else(|| self.adapted_ev100(&job), |cued| Some(cued.ev100));
        let starts_adaptation = Adaptation::adapts(&exposure) && adapted_ev100.is_none();
        let request = FrameRequest::for_group(&self.scene, job.frame_groups(), job.group)
            .wanted_per_view(&job.wanted)
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
                // Deliver an earlier frame first.
                while !self.in_flight.is_empty() {
                    self.finish()?;
                }
                self.refuse(job, &RenderFailure::Engine(error.to_string()));
                Ok(())
            }
        }
    }

    /// Returns the exposure state of a frame from the last finished frame; the frame in flight has no result yet.
    fn adapted_ev100(&mut self, job: &Job) -> Option<f64> {
        let exposure = job.frame_group().settings.exposure;
        let eye = self.eyes.entry(job.eye().clone()).or_default();
        let adapts_by = job.adapts_by();
        if eye.adapted_by.replace(adapts_by).is_some_and(|before| before != adapts_by) {
            *eye = AdaptingEye { adapted_by: Some(adapts_by), ..AdaptingEye::default() };
        }
        let shares = |before: &&InFlight| before.job.eye() == job.eye();
        let before = self.in_flight.iter().rev().find(shares);
        let begun = before.map(|before| (before.job.start, before.job.shows())).or(eye.last);
        let new_for = begun.filter(|(_, showed)| *showed != job.shows()).map(|(start, _)| job.start - start);
        let dt = eye.last.map_or(Duration::ZERO, |(start, _)| job.start - start);
        eye.adaptation.exposure(dt.as_secs_f64(), new_for.unwrap_or_default().as_secs_f64(), &exposure)
    }

    /// Waits for the oldest frame and delivers it. An error means that the engine is lost for good.
    fn finish(&mut self) -> Result<(), EngineError> {
        let Some(InFlight { job, submitted, adapted, span, .. }) = self.in_flight.pop_front() else { return Ok(()) };
        self.engine.is_drawn_within(Duration::MAX);
        let drawn = Instant::now();
        // Frames are drawn one after the other.
        let began = mem::replace(&mut self.last_drawn, drawn).max(submitted);
        match self.engine.finish() {
            Ok(frame) => {
                let planned = Duration::try_from_secs_f64(frame.times.plan_ms * 1e-3).unwrap_or_default();
                self.forecast.note(planned, drawn - began);
                span.record("number", frame.number);
                span.record("plan_ms", frame.times.plan_ms);
                span.record("gpu_ms", frame.times.gpu_ms);
                let FrameGroup { views, .. } = job.frame_group();
                // The state may be missing if the view was deleted, or differ if its settings changed in the meantime.
                if let Some(eye) = self.eyes.get_mut(job.eye())
                    && eye.adapted_by.is_none_or(|adapted_by| adapted_by == job.adapts_by())
                {
                    eye.last = Some((job.start, job.shows()));
                    eye.adaptation.observe(frame.exposure_ev100, frame.metered_ev100);
                }
                let mut frame = frame.with_views(views);
                frame.number = job.cued.map_or(frame.number, |cued| cued.number);
                self.losses = 0;
                let mut state = self.shared.state();
                state.statistics.frames_rendered += 1;
                state.statistics.failures.problem = None;
                for (view, wanted) in views.iter().zip(&job.wanted) {
                    let view = job.scene.views.ids()[*view];
                    // Store nothing for a deleted view, because it would never be removed.
                    // Frames of cues may not be shown.
                    let is_newest = (wanted.display || wanted.reads_hdr()) && job.cued.is_none();
                    if is_newest && state.has_view(view) {
                        state.queue.newest_frames.insert(view, (frame.number, job.shows(), job.start));
                    }
                }
                state.statistics.last_times = Some(frame.times.clone());
                state.statistics.last_age = state.time.now().duration_since(job.pose_time).ok();
                let given_up = state.quality.as_mut().zip(job.level()).map(|(quality, level)| {
                    if job.cued.is_none() {
                        quality.note(level, frame.times.total_ms);
                    }
                    let settings = &job.groups.all[job.group].settings;
                    GivenUp { level, what: quality::given_up(level, settings) }
                });
                drop(state);
                let frame = Arc::new(RenderedFrame {
                    frame: Arc::new(frame),
                    views: Arc::clone(job.scene.views.ids()),
                    camera: job.camera,
                    horizontal: Horizontal::new(&job.camera, job.objects.observer.as_ref(), job.time_s),
                    pose_time: self.shared.time.told(job.pose_time),
                    render_time: self.shared.time.told(self.shared.time.now()),
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
                    // The caller may have disconnected.
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

    /// Sleeps until there is work; `None` if the thread is to end.
    fn next_work(&mut self) -> Option<Work> {
        match self.in_flight.back() {
            None => self.next_work_when_idle(),
            Some(frame) if self.in_flight.len() < MOST_IN_FLIGHT && !frame.starts_adaptation => {
                let began = frame.submitted.max(self.last_drawn);
                Some(self.forecast.expected(began).map_or(Work::Finish, |expected| self.work_during_a_frame(expected)))
            }
            Some(_) => Some(Work::Finish),
        }
    }

    /// Returns the next work while no frame is in flight.
    fn next_work_when_idle(&mut self) -> Option<Work> {
        let shared = Arc::clone(&self.shared);
        let mut state = shared.state();
        loop {
            if let Some(led) = &mut state.led {
                if let Some(request) = led.next.take() {
                    return Some(Work::Draw(Box::new(request)));
                }
                if state.stop {
                    return None;
                }
                state = shared.wake.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
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

    /// Returns the next work while a frame is drawn: another frame if it is due before this one is expected to end. A frame that ends sooner is thus
    /// delivered without delay, and a frame that is due later uses the camera of that later time.
    fn work_during_a_frame(&mut self, Expected { plan_next, end }: Expected) -> Work {
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

    /// Collects the work, without requests of disconnected callers.
    fn tasks(&mut self, state: &mut State, now: Instant) -> Tasks {
        state.queue.requests.retain(|request| !request.reply.is_closed());
        state.queue.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
        // While the daemon ends, requests are drawn with the last scene.
        let scene = state.scene.newest.clone();
        // Expected completion time of a frame that begins now.
        let seen = state.time.now() + self.forecast.frame();
        self.end_notice.look(&scene.clock, seen);
        let moves = state.camera.path.moves().map(|moves| moves.duration_since(seen).unwrap_or_default());
        let is_moving = moves == Some(Duration::ZERO);
        if is_moving && state.queue.subscribers.is_empty() && state.queue.requests.is_empty() {
            // No frames are requested, but the camera may be queried.
            state.follow(seen);
        }
        // A moving camera has a new pose in each frame.
        let camera = state.camera.newest.revision + u64::from(is_moving);
        let newest = Revisions { scene: scene.revision, camera, step: scene.clock.step(seen) };
        let level = state.quality.as_ref().map_or(0, Quality::level);
        self.keep_groups(&scene, level);
        let due_at = |pace: &Pace, view: ViewId| pace.due_at(newest, self.converged(view), now);
        let of_streams = state.queue.subscribers.iter().map(|stream| due_at(&stream.pace, stream.view));
        let of_requests = state.queue.requests.iter().map(|request| due_at(&request.pace, request.view));
        let due = of_streams.chain(of_requests).min();
        let moves = moves.map(|moves| now + if is_moving { UNSEEN_INTERVAL } else { moves });
        let is_looked_at = !state.queue.subscribers.is_empty() || !state.queue.requests.is_empty();
        let steps = scene.clock.next_step(seen).filter(|_| is_looked_at).map(|wait| now + wait);
        let moves = moves.into_iter().chain(steps).min();
        Tasks { scene, newest, due, moves, groups: Arc::clone(&self.groups) }
    }

    /// Groups the views of a scene into frames, if the scene or the quality level has changed.
    fn keep_groups(&mut self, scene: &SceneState, level: u32) {
        if (self.groups.revision, self.groups.level) != (scene.revision, level) {
            self.groups = Arc::new(Groups::new(&self.settings, scene, level));
            let groups = &self.groups;
            self.eyes.retain(|of, _| groups.eyes.contains(of));
            self.map_place_pc.retain(|group, _| *group < groups.all.len());
        }
    }

    /// Whether another frame of the same scene would show a view with the same exposure.
    fn converged(&self, view: ViewId) -> bool {
        let exposure = self.groups.exposure_of(view);
        let eye = exposure.and_then(|(exposure, of)| Some((self.eyes.get(of)?, exposure)));
        eye.is_none_or(|(eye, exposure)| eye.adaptation.converged(exposure))
    }

    fn take_job(&mut self, state: &mut State, Tasks { scene, newest, groups, .. }: Tasks, start: Instant) -> Job {
        let seen = state.time.now() + self.forecast.frame();
        state.follow(seen);
        let clock = scene.clock;
        let newest = Revisions { camera: state.camera.newest.revision, step: clock.step(seen), ..newest };
        let is_due = |pace: &Pace, view: ViewId| pace.due_at(newest, self.converged(view), start) <= start;
        let due: Vec<bool> = state.queue.subscribers.iter().map(|stream| is_due(&stream.pace, stream.view)).collect();
        let (waiting, later): (VecDeque<Request>, VecDeque<Request>) =
            mem::take(&mut state.queue.requests).into_iter().partition(|request| is_due(&request.pace, request.view));
        state.queue.requests = later;
        let of_requests = waiting.iter().map(|request| groups.kind_of(request.view, request.wanted));
        let of_streams = state.queue.subscribers.iter().zip(&due).filter(|(_, due)| **due);
        let of_streams = of_streams.map(|(subscriber, _)| groups.kind_of(subscriber.view, subscriber.wanted));
        let kind = next_kind(of_requests.chain(of_streams), self.last_kind);
        self.last_kind = kind;
        let mut wanted = vec![Wanted::default(); groups.all.get(kind.0).map_or(0, |group| group.views.len())];
        let mut want = |view: ViewId, what: Wanted| wanted[groups.of_view[&view].1] |= what;
        let (requests, others): (Vec<Request>, Vec<Request>) =
            waiting.into_iter().partition(|request| groups.kind_of(request.view, request.wanted) == kind);
        // Put them back at the front of the queue, in their order.
        others.into_iter().rev().for_each(|request| state.queue.requests.push_front(request));
        for request in &requests {
            want(request.view, request.wanted);
        }
        let mut subscribers = Vec::new();
        for (subscriber, due) in state.queue.subscribers.iter_mut().zip(due) {
            if due
                && groups.kind_of(subscriber.view, subscriber.wanted) == kind
                && let Some(slot) = subscriber.slot.upgrade()
            {
                subscriber.pace.served(newest, start);
                want(subscriber.view, subscriber.wanted);
                subscribers.push(slot);
            }
        }
        let (camera, pose_time) = (state.camera.newest, state.camera.pose_time);
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
            cued: None,
        }
    }
}
