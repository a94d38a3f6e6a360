//! What the render thread ([`super::worker`]) is told, and the [`RenderHandle`] by which it is told.
//!
//! All of it stands under one lock, which is never held while a frame is rendered: the camera (a slot, the latest wins, moved
//! by clients and by a headset's controllers alike), the scene but for its stars and how it is drawn, requests for single
//! frames (a bounded queue), and the subscribers, each with a latest-wins slot of its own.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak},
    time::{Duration, Instant, SystemTime},
};

use glam::DVec3;
use tokio::sync::{oneshot, watch};

use super::{
    audit::{AuditFigures, AuditReport},
    quality::{self, Quality},
    scene::{SceneError, SceneState},
    schedule::{Pace, Revisions},
    slot::{RenderFailure, RenderedFrame, Slot},
    streams::{Streams, Subscription},
    track::{Track, TrackError},
    views::{ViewId, ViewSet},
};
use crate::{
    observer::Frame,
    plan::{
        Limits, check_together,
        settings::{RenderSettings, StarMethod},
    },
    render::{FrameTimes, Wanted},
    scene::{Camera, PoseError, SceneObjects, SceneSnapshot, SeenStars},
    xr::{Flight, Shown},
};

/// A frame that was asked for and has yet to come.
type PendingFrame = oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>;

/// Changes of a camera; what is `None` stays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraUpdate {
    /// ICRS barycentric position, m.
    pub position_m: Option<[f64; 3]>,
    /// Camera axes to world axes, unit quaternion x, y, z, w.
    pub orientation: Option<[f64; 4]>,
    /// Velocity in units of the speed of light, world axes; at most 0.9999 long.
    pub velocity_c: Option<[f64; 3]>,
    /// The axes that it hangs on.
    pub frame: Option<Frame>,
}

impl CameraUpdate {
    /// The camera after the change of another one.
    fn of(&self, old: &Camera) -> Result<Camera, PoseError> {
        let moved = Camera::new(
            self.position_m.unwrap_or(old.position_m.to_array()),
            self.orientation.unwrap_or(old.world_from_camera.to_array()),
            self.velocity_c.unwrap_or(old.velocity_c.to_array()),
        )?;
        Ok(Camera { frame: self.frame.unwrap_or(old.frame), as_of_s: old.as_of_s, ..moved })
    }
}

/// How much the thread takes on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Capacity {
    /// Requests that may wait.
    pub(super) requests: usize,
    /// Subscribers at the same time.
    pub(super) subscribers: usize,
}

pub(super) type Reply = oneshot::Sender<Result<Arc<RenderedFrame>, RenderFailure>>;

/// Why a request is not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// The queue is full.
    Full,
    /// There are as many subscribers as may be.
    Subscribers(usize),
    /// The view is not there any more.
    Deleted,
    /// There is no headset: why.
    Headset(String),
    /// The daemon is shutting down.
    Ending,
}

/// Somebody waits for a frame of a view.
pub(super) struct Request {
    pub(super) view: ViewId,
    pub(super) wanted: Wanted,
    /// When it is due.
    pub(super) pace: Pace,
    /// Whether windows have asked: they need no place among the calls.
    pub(super) of_windows: bool,
    pub(super) reply: Reply,
}

/// Somebody who gets the frames of a view.
pub(super) struct Subscriber {
    pub(super) view: ViewId,
    pub(super) wanted: Wanted,
    pub(super) pace: Pace,
    pub(super) slot: Weak<Slot>,
}

/// Frames that could not be drawn.
#[derive(Clone, Debug, Default)]
pub(super) struct Failures {
    /// How many since the start.
    pub(super) count: u64,
    /// Why the last one could not; `None`: a later one could.
    pub(super) problem: Option<String>,
}

/// The right to move the camera alone.
pub(super) struct Lease {
    pub(super) number: u64,
    pub(super) holder: String,
    /// Tells the holder that it is taken over, and by whom.
    pub(super) taken: oneshot::Sender<String>,
}

/// Why the camera stays where it is.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum CameraError {
    /// The pose is none.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The scene cannot be drawn so.
    #[error("{0}")]
    Scene(String),
    /// The camera has another revision than the one that a change was made for.
    #[error("the camera has revision {found}, not {expected}: read it again")]
    Revision {
        /// What the change was made for.
        expected: u64,
        /// What the camera has.
        found: u64,
    },
    /// Its time is of no use.
    #[error(transparent)]
    Time(#[from] TrackError),
    /// Another client has the lease.
    #[error("`{holder}` steers the camera at present: wait, or take the lease over in StreamCamera")]
    Leased {
        /// Its name.
        holder: String,
    },
    /// The daemon is shutting down.
    #[error("the daemon is shutting down")]
    Ending,
}

/// What the thread is told, and what it tells of itself.
pub(super) struct State {
    pub(super) camera: Camera,
    pub(super) pose_time: SystemTime,
    /// Holds `None` when there will be no more changes.
    pub(super) scene: watch::Sender<Option<SceneState>>,
    /// The newest scene, also then.
    pub(super) newest_scene: SceneState,
    /// The settings of frames but for stars and asteroids, which the scene holds.
    pub(super) settings: RenderSettings,
    pub(super) requests: VecDeque<Request>,
    pub(super) subscribers: Vec<Subscriber>,
    pub(super) frames_rendered: u64,
    /// Where the time of the last frame went.
    pub(super) last_times: Option<FrameTimes>,
    /// Age of its pose when it was finished.
    pub(super) last_age: Option<Duration>,
    /// Chooses what display images give up; `None`: they may take as long as they take.
    pub(super) quality: Option<Quality>,
    /// The newest frame that shows each view: its number, what it shows, and when it was begun.
    pub(super) newest: HashMap<ViewId, (u64, Revisions, Instant)>,
    /// Frames that could not be drawn, and why the last one could not.
    pub(super) failures: Failures,
    /// How often the renderer was lost.
    pub(super) losses: u64,
    /// Poses that are given ahead of their time.
    pub(super) track: Track,
    /// Who alone may move the camera.
    pub(super) lease: Option<Lease>,
    /// The camera, for those who watch it.
    pub(super) watched_camera: watch::Sender<Option<Camera>>,
    /// What plans may ask of the adapter.
    pub(super) limits: Limits,
    /// No new work is taken.
    pub(super) draining: bool,
    /// The thread ends.
    pub(super) stop: bool,
}

impl State {
    /// The settings of frames of a scene.
    pub(super) fn settings_of(&self, scene: &SceneState) -> RenderSettings {
        RenderSettings { stars: scene.stars.clone(), asteroids: scene.asteroids.clone(), ..self.settings.clone() }
    }

    /// What a frame shows of a revision of the scene at a time.
    pub(super) fn shows(&self, scene: u64, now: SystemTime) -> Revisions {
        Revisions { scene, camera: self.camera.revision, step: self.newest_scene.clock.step(now) }
    }

    /// Whether nobody else has the lease.
    fn check_lease(&self, lease: Option<u64>) -> Result<(), CameraError> {
        match self.lease.as_ref().filter(|held| lease != Some(held.number)) {
            Some(held) => Err(CameraError::Leased { holder: held.holder.clone() }),
            None => Ok(()),
        }
    }

    /// Whether a camera can be moved by somebody, to a pose that the scene can be drawn from.
    fn check_camera(&self, camera: &Camera, lease: Option<u64>) -> Result<(), CameraError> {
        self.check_lease(lease)?;
        // What goes with a camera that moves is all that a pose can contradict.
        let moves = camera.velocity_c != DVec3::ZERO;
        if moves && self.camera.velocity_c == DVec3::ZERO {
            let scene = self.scene.borrow().clone().ok_or(CameraError::Ending)?;
            check_together(scene.stars.method, moves, &scene.objects.drawn, &self.limits)
                .map_err(|error| CameraError::Scene(error.to_string()))?;
        }
        Ok(())
    }

    /// Moves the camera in place of the poses that wait.
    fn move_camera(&mut self, camera: Camera) -> Camera {
        self.track.clear();
        self.place_camera(camera)
    }

    fn place_camera(&mut self, camera: Camera) -> Camera {
        self.camera = Camera { revision: self.camera.revision + 1, ..camera };
        self.pose_time = SystemTime::now();
        self.tell_camera();
        self.camera
    }

    /// Moves the camera along the poses that were given for later, to where it is at a time, and turns it with the axes that it hangs on.
    pub(super) fn follow(&mut self, time: SystemTime) {
        let scene = &self.newest_scene;
        let moment_s = scene.clock.time_s(time);
        self.camera = self.camera.carried(&scene.objects.drawn, moment_s);
        if let Some((camera, received)) = self.track.at(time) {
            let (frame, as_of_s) = (self.camera.frame, moment_s);
            self.camera = Camera { revision: self.camera.revision + 1, frame, as_of_s, ..camera };
            self.pose_time = received;
            self.tell_camera();
        }
    }

    /// Tells those who watch, unless that has ended.
    fn tell_camera(&self) {
        let camera = self.camera;
        self.watched_camera.send_if_modified(|watched| watched.as_mut().map(|watched| *watched = camera).is_some());
    }

    /// Requests of calls that wait.
    fn calls_waiting(&self) -> usize {
        self.requests.iter().filter(|request| !request.of_windows).count()
    }

    /// Whether there is a view: those who wait, and what is kept of views, are of such ones alone.
    pub(super) fn has_view(&self, view: ViewId) -> bool {
        self.newest_scene.views.index_of(view).is_some()
    }

    /// Ends what was asked of views that were there before and are not there any more.
    fn end_deleted(&mut self, before: &ViewSet) {
        for (view, name) in before.ids().iter().zip(before.names()) {
            if self.has_view(*view) {
                continue;
            }
            let failure = RenderFailure::Deleted(name.to_owned());
            self.newest.remove(view);
            let waiting = std::mem::take(&mut self.requests).into_iter();
            let (ended, others): (VecDeque<Request>, _) = waiting.partition(|request| request.view == *view);
            self.requests = others;
            for request in ended {
                // A caller that went away meanwhile needs no answer.
                let _ = request.reply.send(Err(failure.clone()));
            }
            let of_view = |subscriber: &mut Subscriber| subscriber.view == *view;
            for slot in self.subscribers.extract_if(.., of_view).filter_map(|subscriber| subscriber.slot.upgrade()) {
                slot.end(Err(failure.clone()));
            }
        }
    }

    /// Takes no new work; nobody is left waiting for what no longer comes.
    pub(super) fn end_streams(&mut self, how: &Result<(), RenderFailure>) {
        self.draining = true;
        self.scene.send_replace(None);
        self.watched_camera.send_replace(None);
        for slot in self.subscribers.drain(..).filter_map(|subscriber| subscriber.slot.upgrade()) {
            slot.end(how.clone());
        }
    }
}

/// What the thread and the handles share.
pub(super) struct Shared {
    pub(super) state: Mutex<State>,
    pub(super) wake: Condvar,
    /// All stars of the scene.
    pub(super) stars: Arc<SeenStars>,
    pub(super) capacity: Capacity,
    pub(super) streams: Streams,
    /// What audits of frames have found.
    pub(super) audits: AuditReport,
    /// The objects that were placed last: from which, and at which moment.
    pub(super) placed: Mutex<Option<(Arc<SceneObjects>, Arc<SceneObjects>)>>,
}

impl Shared {
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        // The engine, which may panic, never runs under this lock: a poisoned state is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Objects at a moment, s since 2000-01-01T12:00:00Z; placed anew, which takes a millisecond, only where the last ones are of another scene or moment.
    pub(super) fn objects_at(&self, drawn: &Arc<SceneObjects>, time_s: f64) -> Arc<SceneObjects> {
        if drawn.time_s == time_s {
            return Arc::clone(drawn);
        }
        let mut placed = self.placed.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, objects)) = placed.as_ref()
            && Arc::ptr_eq(of, drawn)
            && objects.time_s == time_s
        {
            return Arc::clone(objects);
        }
        let objects = Arc::new(drawn.at(time_s));
        *placed = Some((Arc::clone(drawn), Arc::clone(&objects)));
        objects
    }

    /// A scene with a camera as they are at a time.
    fn snapshot(&self, scene: &SceneState, camera: Camera, now: SystemTime) -> SceneSnapshot {
        let time_s = scene.clock.time_s(now);
        let objects = self.objects_at(&scene.objects.drawn, time_s);
        let camera = camera.carried(&objects, time_s);
        let stars = self.stars.at(objects.observer.as_ref(), time_s);
        SceneSnapshot { revision: scene.revision, stars, objects, camera }
    }
}

/// The async side's hold on the render thread. None of its calls waits for a frame.
#[derive(Clone)]
pub(super) struct RenderHandle {
    pub(super) shared: Arc<Shared>,
}

/// What the render thread tells of itself.
#[derive(Clone, Debug)]
pub(super) struct RenderFigures {
    /// Frames rendered since the start.
    pub(super) frames_rendered: u64,
    /// Where the time of the last frame went; `None`: there is none yet.
    pub(super) last_times: Option<FrameTimes>,
    /// What display images give up and how long they take; `None`: they may take as long as they take.
    pub(super) quality: Option<QualityFigures>,
    /// What audits of frames have found; `None`: there are none.
    pub(super) audits: Option<AuditFigures>,
    /// Frames that could not be drawn.
    pub(super) failures: Failures,
    /// How often the renderer was lost.
    pub(super) losses: u64,
    /// Age of the pose of the last frame when it was finished.
    pub(super) last_age: Option<Duration>,
}

/// What display images give up, and how long they take.
#[derive(Clone, Debug)]
pub(super) struct QualityFigures {
    /// How long they may take, ms.
    pub(super) frame_ms: f64,
    /// How long those of this level take, smoothed, ms; `None`: not known yet.
    pub(super) smoothed_ms: Option<f64>,
    pub(super) level: u32,
    /// In words, of views with the general settings.
    pub(super) given_up: Vec<String>,
}

impl RenderHandle {
    /// The camera now.
    pub(super) fn camera(&self) -> Camera {
        let mut state = self.shared.state();
        state.follow(SystemTime::now());
        state.camera
    }

    /// Moves the camera, if it has the revision expected and nobody else has its lease; returns it with its new revision. After an error it is as it
    /// was.
    pub(super) fn set_camera(
        &self,
        update: &CameraUpdate,
        expected_revision: Option<u64>,
        lease: Option<u64>,
    ) -> Result<Camera, CameraError> {
        let mut state = self.shared.state();
        state.follow(SystemTime::now());
        let old = state.camera;
        if let Some(expected) = expected_revision.filter(|expected| *expected != old.revision) {
            return Err(CameraError::Revision { expected, found: old.revision });
        }
        let camera = update.of(&old)?;
        state.check_camera(&camera, lease)?;
        let camera = state.move_camera(camera);
        self.shared.wake.notify_one();
        Ok(camera)
    }

    /// Takes a pose for a time: until then the camera moves there from the one before. What an update leaves open is as in that one. Returns the camera as it
    /// is now.
    pub(super) fn plan_camera(
        &self,
        update: &CameraUpdate,
        time: SystemTime,
        lease: Option<u64>,
    ) -> Result<Camera, CameraError> {
        let mut state = self.shared.state();
        let camera = update.of(&state.track.last().unwrap_or(state.camera))?;
        state.check_camera(&camera, lease)?;
        state.track.push(time, camera, SystemTime::now())?;
        self.shared.wake.notify_one();
        Ok(state.camera)
    }

    /// Whether nobody else has the lease of the camera.
    pub(super) fn check_lease(&self, lease: Option<u64>) -> Result<(), CameraError> {
        self.shared.state().check_lease(lease)
    }

    /// Moves the camera from where it is; returns its new revision. After an error it is as it was.
    pub(super) fn fly(&self, flight: &Flight) -> Result<u64, CameraError> {
        let mut state = self.shared.state();
        let camera = flight.moved(&state.camera)?;
        state.check_camera(&camera, None)?;
        let camera = state.move_camera(camera);
        self.shared.wake.notify_one();
        Ok(camera.revision)
    }

    /// Takes the lease of the camera; `over`: also from whoever has it. With its number comes what tells that it was taken over in turn.
    pub(super) fn lease_camera(
        &self,
        holder: &str,
        over: bool,
    ) -> Result<(u64, oneshot::Receiver<String>), CameraError> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(CameraError::Ending);
        }
        let number = state.lease.as_ref().map_or(1, |held| held.number + 1);
        match state.lease.take() {
            Some(held) if !over => {
                let other = held.holder.clone();
                state.lease = Some(held);
                return Err(CameraError::Leased { holder: other });
            }
            Some(held) => {
                // A holder that has gone meanwhile need not be told.
                let _ = held.taken.send(holder.to_owned());
            }
            None => {}
        }
        let (taken, is_taken) = oneshot::channel();
        state.lease = Some(Lease { number, holder: holder.to_owned(), taken });
        state.tell_camera();
        Ok((number, is_taken))
    }

    /// Gives the lease of the camera back, if it is still this one.
    pub(super) fn release_camera(&self, lease: u64) {
        let mut state = self.shared.state();
        if state.lease.as_ref().is_some_and(|held| held.number == lease) {
            state.lease = None;
            state.tell_camera();
        }
    }

    /// Who has the lease of the camera; empty: nobody.
    pub(super) fn holder(&self) -> String {
        self.shared.state().lease.as_ref().map(|lease| lease.holder.clone()).unwrap_or_default()
    }

    /// The camera and its changes; `None` is the end.
    pub(super) fn watch_camera(&self) -> watch::Receiver<Option<Camera>> {
        self.shared.state().watched_camera.subscribe()
    }

    /// What a frame that begins now is to show; `None` at the end.
    pub(super) fn shown(&self) -> Option<Shown> {
        let now = SystemTime::now();
        let (scene, camera, settings, camera_time) = {
            let mut state = self.shared.state();
            let scene = state.scene.borrow().clone().filter(|_| !state.draining)?;
            state.follow(now);
            let settings = state.settings_of(&scene);
            (scene, state.camera, settings, state.pose_time)
        };
        Some(Shown { snapshot: self.shared.snapshot(&scene, camera, now), settings, camera_time })
    }

    /// Revisions of the scene and of the camera; `None` at the end.
    pub(super) fn revisions(&self) -> Option<Revisions> {
        let state = self.shared.state();
        let scene = state.scene.borrow().as_ref().map(|scene| scene.revision);
        scene.filter(|_| !state.draining).map(|scene| state.shows(scene, SystemTime::now()))
    }

    /// The streams of frames, of all sources.
    pub(super) fn streams(&self) -> &Streams {
        &self.shared.streams
    }

    /// The scene now.
    pub(super) fn scene(&self) -> Result<SceneState, Refused> {
        self.shared.state().scene.borrow().clone().ok_or(Refused::Ending)
    }

    /// The scene and its changes; `None` is the end.
    pub(super) fn watch_scene(&self) -> watch::Receiver<Option<SceneState>> {
        self.shared.state().scene.subscribe()
    }

    /// The settings of frames whose views have none of their own.
    pub(super) fn general(&self, scene: &SceneState) -> RenderSettings {
        self.shared.state().settings_of(scene)
    }

    /// Puts a scene in place of the one that has the revision it was made for; it has the next revision. Who waits for frames of a view that it has
    /// no more is told so. The outer error: it takes no changes any
    /// more.
    pub(super) fn replace_scene(
        &self,
        scene: SceneState,
        made_for: u64,
    ) -> Result<Result<SceneState, SceneError>, Refused> {
        let mut state = self.shared.state();
        let now = state.scene.borrow().clone().ok_or(Refused::Ending)?;
        if let Err(error) = now.expect(Some(made_for)) {
            return Ok(Err(error));
        }
        let jumps = scene.jumps_after(&now, SystemTime::now());
        let scene = SceneState { revision: made_for + 1, jumps, ..scene };
        let [before, after] = [&now, &scene].map(|scene| scene.objects.drawn.observer);
        if before != after {
            // It hangs on the horizon of where its observer was until now.
            state.follow(SystemTime::now());
            let turned = |camera: &Camera| camera.on_horizon_of(before.as_ref(), after.as_ref());
            let camera = turned(&state.camera);
            if camera != state.camera {
                // The poses of whoever steers go along, too.
                state.track.change(turned);
                state.place_camera(camera);
            }
        }
        state.newest_scene = scene.clone();
        state.scene.send_replace(Some(scene.clone()));
        state.end_deleted(&now.views);
        self.shared.wake.notify_one();
        Ok(Ok(scene))
    }

    /// A scene as it is now, with the newest camera.
    pub(super) fn snapshot(&self, scene: &SceneState) -> SceneSnapshot {
        self.shared.snapshot(scene, self.camera(), SystemTime::now())
    }

    /// The settings of failure tests: those of frames, with another star method where one is named.
    pub(super) fn settings_of_checks(&self, method: Option<StarMethod>) -> Result<RenderSettings, Refused> {
        let state = self.shared.state();
        let scene = state.scene.borrow().clone().filter(|_| !state.draining).ok_or(Refused::Ending)?;
        let mut settings = state.settings_of(&scene);
        settings.stars.method = method.unwrap_or(settings.stars.method);
        Ok(settings)
    }

    /// What the thread tells of itself.
    pub(super) fn figures(&self) -> RenderFigures {
        let state = self.shared.state();
        let quality = state.quality.as_ref().map(|quality| QualityFigures {
            frame_ms: quality.frame_ms(),
            smoothed_ms: quality.smoothed_ms(),
            level: quality.level(),
            given_up: quality::given_up(quality.level(), &state.settings),
        });
        RenderFigures {
            frames_rendered: state.frames_rendered,
            last_times: state.last_times.clone(),
            quality,
            failures: state.failures.clone(),
            losses: state.losses,
            last_age: state.last_age,
            audits: state.settings.accuracy.audit.then(|| self.shared.audits.figures()),
        }
    }

    /// Asks for a frame of a view.
    pub(super) fn request(&self, view: ViewId, wanted: Wanted) -> Result<PendingFrame, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if !state.has_view(view) {
            return Err(Refused::Deleted);
        }
        if state.calls_waiting() >= self.shared.capacity.requests {
            // Callers that went away need no place.
            state.requests.retain(|request| !request.reply.is_closed());
        }
        if state.calls_waiting() >= self.shared.capacity.requests {
            return Err(Refused::Full);
        }
        let (reply, receiver) = oneshot::channel();
        state.requests.push_back(Request { view, wanted, pace: Pace::new(Duration::ZERO), of_windows: false, reply });
        self.shared.wake.notify_one();
        Ok(receiver)
    }

    /// Asks for the next frame of each of these views, at the same time: what one frame can show comes in one. They are due as those of a stream,
    /// where the newest frames of all of them are the ones `seen`, and at once otherwise.
    pub(super) fn next_of_views(
        &self,
        views: &[(ViewId, Wanted)],
        seen: &HashMap<ViewId, u64>,
    ) -> Result<Vec<PendingFrame>, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        let paces: Option<Vec<Pace>> = views
            .iter()
            .map(|(view, _)| {
                let (number, shown, start) = state.newest.get(view)?;
                (seen.get(view) == Some(number)).then(|| Pace::after(*shown, *start))
            })
            .collect();
        let paces = paces.unwrap_or_else(|| vec![Pace::new(Duration::ZERO); views.len()]);
        let mut receivers = Vec::with_capacity(views.len());
        for ((view, wanted), pace) in views.iter().zip(paces) {
            let (reply, receiver) = oneshot::channel();
            receivers.push(receiver);
            if state.has_view(*view) {
                state.requests.push_back(Request { view: *view, wanted: *wanted, pace, of_windows: true, reply });
            } else {
                // Whoever asks was told that there is a receiver; it has gone meanwhile.
                let _ = reply.send(Err(RenderFailure::Deleted(String::new())));
            }
        }
        self.shared.wake.notify_one();
        Ok(receivers)
    }

    /// Asks for the frames of a view, at least `interval` apart.
    pub(super) fn subscribe(&self, view: ViewId, wanted: Wanted, interval: Duration) -> Result<Subscription, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if !state.has_view(view) {
            return Err(Refused::Deleted);
        }
        let (subscription, slot) = self.shared.streams.open()?;
        state.subscribers.push(Subscriber { view, wanted, pace: Pace::new(interval), slot });
        self.shared.wake.notify_one();
        Ok(subscription)
    }

    /// Asks for the next frame of a view after the one with a number.
    pub(super) fn subscribe_after(&self, view: ViewId, wanted: Wanted, after: u64) -> Result<Subscription, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if !state.has_view(view) {
            return Err(Refused::Deleted);
        }
        let (subscription, slot) = self.shared.streams.open()?;
        let seen = state.newest.get(&view).filter(|(number, ..)| *number == after);
        let pace = seen.map_or(Pace::new(Duration::ZERO), |(_, shown, start)| Pace::after(*shown, *start));
        state.subscribers.push(Subscriber { view, wanted, pace, slot });
        self.shared.wake.notify_one();
        Ok(subscription)
    }

    /// Requests that wait.
    pub(super) fn requests_waiting(&self) -> usize {
        self.shared.state().calls_waiting()
    }

    /// Takes no new work and ends every subscription; requests that are queued are still answered.
    pub(super) fn drain(&self) {
        self.shared.state().end_streams(&Ok(()));
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
