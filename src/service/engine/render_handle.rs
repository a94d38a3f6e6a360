//! The state shared with the render thread ([`super::render_thread`]), and the [`RenderHandle`] that accesses it.
//!
//! All of it is under one lock, which is never held while a frame is rendered: the camera (the latest pose wins, set by
//! clients and by a headset's controllers), the scene without its stars, the requests for single frames (a bounded
//! queue), and the subscribers, each with its own latest-wins slot.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak},
    time::{Duration, Instant, SystemTime},
};

use glam::DVec3;
use tokio::sync::{oneshot, watch};

use super::{
    auditor::{AuditFigures, AuditReport},
    camera_path::{CameraPath, CameraPathError},
    quality::{self, Quality},
};
use crate::{
    plan::{
        Limits, check_together,
        settings::{RenderSettings, StarMethod},
    },
    render::{FrameTimes, Wanted},
    scene::{Camera, PoseError, SceneObjects, SceneSnapshot, SeenStars},
    service::{
        frames::{
            errors::{Refused, RenderFailure},
            latest_frame::LatestFrame,
            rendered_frame::RenderedFrame,
            schedule::{Pace, Revisions},
            subscriptions::{Streams, Subscription},
        },
        scene::{
            camera::CameraUpdate,
            state::{SceneError, SceneState},
            views::{ViewId, ViewSet},
        },
    },
    xr::{Flight, Shown},
};

/// A requested frame that has not arrived yet.
type PendingFrame = oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>;

/// Limits of the thread's load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capacity {
    /// Maximum number of waiting requests.
    pub(crate) requests: usize,
    /// Maximum number of subscribers.
    pub(crate) subscribers: usize,
}

pub(crate) type Reply = oneshot::Sender<Result<Arc<RenderedFrame>, RenderFailure>>;

/// A request for one frame of a view.
pub(crate) struct Request {
    pub(crate) view: ViewId,
    pub(crate) wanted: Wanted,
    /// Determines when the frame is due.
    pub(crate) pace: Pace,
    /// Whether it comes from windows, which do not count as waiting calls.
    pub(crate) of_windows: bool,
    pub(crate) reply: Reply,
}

/// A subscriber to the frames of a view.
pub(crate) struct Subscriber {
    pub(crate) view: ViewId,
    pub(crate) wanted: Wanted,
    pub(crate) pace: Pace,
    pub(crate) slot: Weak<LatestFrame>,
}

/// Frames that failed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Failures {
    /// Number since the start.
    pub(crate) count: u64,
    /// Reason of the last failure; `None` if a later frame succeeded.
    pub(crate) problem: Option<String>,
}

/// The exclusive right to move the camera.
pub(crate) struct Lease {
    pub(crate) number: u64,
    pub(crate) holder: String,
    /// Notifies the holder of a takeover, with the name of the new holder.
    pub(crate) taken: oneshot::Sender<String>,
}

/// Reasons why a change of the camera is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum CameraError {
    /// The pose is invalid.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The scene cannot be drawn with this camera.
    #[error("{0}")]
    Scene(String),
    /// The revision differs from the expected one.
    #[error("the camera has revision {found}, not {expected}: read it again")]
    Revision {
        /// Revision that the change was made for.
        expected: u64,
        /// Revision of the camera.
        found: u64,
    },
    /// The time of the pose is invalid.
    #[error(transparent)]
    Time(#[from] CameraPathError),
    /// Another client has the lease.
    #[error("`{holder}` holds the lease of the camera: wait, or take the lease over in StreamCamera")]
    Leased {
        /// Name of the holder.
        holder: String,
    },
    /// The daemon is shutting down.
    #[error("the daemon is shutting down")]
    Ending,
}

/// The camera, its planned motion, and the clients that move or watch it.
pub(crate) struct CameraControl {
    pub(crate) newest: Camera,
    /// Time at which the newest camera was set.
    pub(crate) pose_time: SystemTime,
    /// Poses that clients have sent ahead of their time.
    pub(crate) path: CameraPath,
    /// The exclusive right to move the camera, while a client holds it.
    pub(crate) lease: Option<Lease>,
    /// The camera for watching clients; `None` after the last change.
    pub(crate) watched: watch::Sender<Option<Camera>>,
}

/// The scene that frames show.
pub(crate) struct SceneControl {
    /// The scene for watching clients; `None` after the last change.
    pub(crate) published: watch::Sender<Option<SceneState>>,
    /// The newest scene. It stays available after the last change.
    pub(crate) newest: SceneState,
}

/// Requests for frames that the render thread has yet to serve.
pub(crate) struct FrameQueue {
    pub(crate) requests: VecDeque<Request>,
    pub(crate) subscribers: Vec<Subscriber>,
    /// The newest frame of each view: its number, its revisions, and the time at which its rendering began.
    pub(crate) newest_frames: HashMap<ViewId, (u64, Revisions, Instant)>,
}

/// Counts and times of the frames that were rendered since the start.
#[derive(Default)]
pub(crate) struct RenderStatistics {
    pub(crate) frames_rendered: u64,
    /// Times of the passes of the last frame.
    pub(crate) last_times: Option<FrameTimes>,
    /// Age of the last frame's pose when the frame was finished.
    pub(crate) last_age: Option<Duration>,
    /// Frames that failed, and the reason of the last failure.
    pub(crate) failures: Failures,
    /// Number of times that the renderer was lost.
    pub(crate) losses: u64,
}

/// State that the render thread and its handles share under one lock.
pub(crate) struct State {
    pub(crate) camera: CameraControl,
    pub(crate) scene: SceneControl,
    pub(crate) queue: FrameQueue,
    pub(crate) statistics: RenderStatistics,
    /// Settings of frames, except those of stars and asteroids, which are part of the scene.
    pub(crate) settings: RenderSettings,
    /// Chooses the quality level of display images; `None`: their time is not limited.
    pub(crate) quality: Option<Quality>,
    /// Limits of the adapter that plans must respect.
    pub(crate) limits: Limits,
    /// No new work is accepted.
    pub(crate) draining: bool,
    /// The thread is to end.
    pub(crate) stop: bool,
}

impl State {
    /// Returns the settings of frames of a scene.
    pub(crate) fn settings_of(&self, scene: &SceneState) -> RenderSettings {
        RenderSettings { stars: scene.stars.clone(), asteroids: scene.asteroids.clone(), ..self.settings.clone() }
    }

    /// Returns the revisions of a frame of a scene revision at a time.
    pub(crate) fn shows(&self, scene: u64, now: SystemTime) -> Revisions {
        Revisions { scene, camera: self.camera.newest.revision, step: self.scene.newest.clock.step(now) }
    }

    /// Checks that no other client holds the lease.
    fn check_lease(&self, lease: Option<u64>) -> Result<(), CameraError> {
        match self.camera.lease.as_ref().filter(|held| lease != Some(held.number)) {
            Some(held) => Err(CameraError::Leased { holder: held.holder.clone() }),
            None => Ok(()),
        }
    }

    /// Checks that a caller may move the camera to a pose that the scene can be drawn from.
    fn check_camera(&self, camera: &Camera, lease: Option<u64>) -> Result<(), CameraError> {
        self.check_lease(lease)?;
        // Only a moving camera can contradict other settings.
        let moves = camera.velocity_c != DVec3::ZERO;
        if moves && self.camera.newest.velocity_c == DVec3::ZERO {
            let scene = self.scene.published.borrow().clone().ok_or(CameraError::Ending)?;
            check_together(scene.stars.method, moves, &scene.objects.drawn, &self.limits)
                .map_err(|error| CameraError::Scene(error.to_string()))?;
        }
        Ok(())
    }

    /// Moves the camera and removes waiting poses.
    fn move_camera(&mut self, camera: Camera) -> Camera {
        self.camera.path.clear();
        self.place_camera(camera)
    }

    fn place_camera(&mut self, camera: Camera) -> Camera {
        self.camera.newest = Camera { revision: self.camera.newest.revision + 1, ..camera };
        self.camera.pose_time = SystemTime::now();
        self.tell_camera();
        self.camera.newest
    }

    /// Moves the camera along the waiting poses to its place at a time, and turns it with its reference frame.
    pub(crate) fn follow(&mut self, time: SystemTime) {
        let scene = &self.scene.newest;
        let moment_s = scene.clock.time_s(time);
        self.camera.newest = self.camera.newest.carried(&scene.objects.drawn, moment_s);
        if let Some((camera, received)) = self.camera.path.advance(time) {
            let (frame, as_of_s) = (self.camera.newest.frame, moment_s);
            self.camera.newest = Camera { revision: self.camera.newest.revision + 1, frame, as_of_s, ..camera };
            self.camera.pose_time = received;
            self.tell_camera();
        }
    }

    /// Notifies watchers, unless the stream of changes has ended.
    fn tell_camera(&self) {
        let camera = self.camera.newest;
        self.camera.watched.send_if_modified(|watched| watched.as_mut().map(|watched| *watched = camera).is_some());
    }

    /// Returns the number of waiting requests of calls.
    fn calls_waiting(&self) -> usize {
        self.queue.requests.iter().filter(|request| !request.of_windows).count()
    }

    /// Whether a view exists. Requests and stored data refer to existing views only.
    pub(crate) fn has_view(&self, view: ViewId) -> bool {
        self.scene.newest.views.index_of(view).is_some()
    }

    /// Ends the requests and subscriptions of views that were deleted.
    fn end_deleted(&mut self, before: &ViewSet) {
        for (view, name) in before.ids().iter().zip(before.names()) {
            if self.has_view(*view) {
                continue;
            }
            let failure = RenderFailure::Deleted(name.to_owned());
            self.queue.newest_frames.remove(view);
            let waiting = std::mem::take(&mut self.queue.requests).into_iter();
            let (ended, others): (VecDeque<Request>, _) = waiting.partition(|request| request.view == *view);
            self.queue.requests = others;
            for request in ended {
                // The caller may have disconnected.
                let _ = request.reply.send(Err(failure.clone()));
            }
            let of_view = |subscriber: &mut Subscriber| subscriber.view == *view;
            for slot in
                self.queue.subscribers.extract_if(.., of_view).filter_map(|subscriber| subscriber.slot.upgrade())
            {
                slot.end(Err(failure.clone()));
            }
        }
    }

    /// Accepts no new work and ends all streams with a result.
    pub(crate) fn end_streams(&mut self, how: &Result<(), RenderFailure>) {
        self.draining = true;
        self.scene.published.send_replace(None);
        self.camera.watched.send_replace(None);
        for slot in self.queue.subscribers.drain(..).filter_map(|subscriber| subscriber.slot.upgrade()) {
            slot.end(how.clone());
        }
    }
}

/// Data shared by the thread and its handles.
pub(crate) struct Shared {
    pub(crate) state: Mutex<State>,
    pub(crate) wake: Condvar,
    /// All stars of the scene.
    pub(crate) stars: Arc<SeenStars>,
    pub(crate) capacity: Capacity,
    pub(crate) streams: Streams,
    /// Results of audits.
    pub(crate) audits: AuditReport,
    /// The last placed objects, with the objects that they were placed from.
    pub(crate) placed: Mutex<Option<(Arc<SceneObjects>, Arc<SceneObjects>)>>,
}

impl Shared {
    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        // The engine, which may panic, never runs under this lock: a poisoned state is consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the objects at a time, in s since 2000-01-01T12:00:00Z. Placing takes a millisecond, so the last result
    /// is cached.
    pub(crate) fn objects_at(&self, drawn: &Arc<SceneObjects>, time_s: f64) -> Arc<SceneObjects> {
        if drawn.time_s == time_s {
            return Arc::clone(drawn);
        }
        let mut placed = self.placed.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((source, objects)) = placed.as_ref()
            && Arc::ptr_eq(source, drawn)
            && objects.time_s == time_s
        {
            return Arc::clone(objects);
        }
        let objects = Arc::new(drawn.at(time_s));
        *placed = Some((Arc::clone(drawn), Arc::clone(&objects)));
        objects
    }

    /// Returns a scene with a camera at a time.
    fn snapshot(&self, scene: &SceneState, camera: Camera, now: SystemTime) -> SceneSnapshot {
        let time_s = scene.clock.time_s(now);
        let objects = self.objects_at(&scene.objects.drawn, time_s);
        let camera = camera.carried(&objects, time_s);
        let stars = self.stars.at(objects.observer.as_ref(), time_s);
        SceneSnapshot { revision: scene.revision, stars, objects, camera }
    }
}

/// Handle of the render thread for async code. None of its methods waits for a frame.
#[derive(Clone)]
pub(crate) struct RenderHandle {
    pub(crate) shared: Arc<Shared>,
}

/// Statistics of the render thread.
#[derive(Clone, Debug)]
pub(crate) struct RenderFigures {
    /// Frames rendered since the start.
    pub(crate) frames_rendered: u64,
    /// Times of the last frame; `None` before the first.
    pub(crate) last_times: Option<FrameTimes>,
    /// Quality level of display images; `None` if their time is not limited.
    pub(crate) quality: Option<QualityFigures>,
    /// Results of audits; `None` if they are off.
    pub(crate) audits: Option<AuditFigures>,
    /// Frames that failed.
    pub(crate) failures: Failures,
    /// Number of times that the renderer was lost.
    pub(crate) losses: u64,
    /// Age of the last frame's pose when the frame was finished.
    pub(crate) last_age: Option<Duration>,
}

/// Quality level of display images, and their times.
#[derive(Clone, Debug)]
pub(crate) struct QualityFigures {
    /// Allowed frame time, ms.
    pub(crate) frame_ms: f64,
    /// Smoothed frame time of this level, ms; `None` if unknown.
    pub(crate) smoothed_ms: Option<f64>,
    pub(crate) level: u32,
    /// Descriptions of the reductions, for views with the general settings.
    pub(crate) given_up: Vec<String>,
}

impl RenderHandle {
    /// Returns the current camera.
    pub(crate) fn camera(&self) -> Camera {
        let mut state = self.shared.state();
        state.follow(SystemTime::now());
        state.camera.newest
    }

    /// Moves the camera if it has the expected revision and no other client holds the lease; returns it with its new
    /// revision. On an error, it stays unchanged.
    pub(crate) fn set_camera(
        &self,
        update: &CameraUpdate,
        expected_revision: Option<u64>,
        lease: Option<u64>,
    ) -> Result<Camera, CameraError> {
        let mut state = self.shared.state();
        state.follow(SystemTime::now());
        let old = state.camera.newest;
        if let Some(expected) = expected_revision.filter(|expected| *expected != old.revision) {
            return Err(CameraError::Revision { expected, found: old.revision });
        }
        let camera = update.applied_to(&old)?;
        state.check_camera(&camera, lease)?;
        let camera = state.move_camera(camera);
        self.shared.wake.notify_one();
        Ok(camera)
    }

    /// Adds a pose for a future time: the camera moves there from the previous pose. Values that the update lacks come
    /// from that pose. Returns the current camera.
    pub(crate) fn plan_camera(
        &self,
        update: &CameraUpdate,
        time: SystemTime,
        lease: Option<u64>,
    ) -> Result<Camera, CameraError> {
        let mut state = self.shared.state();
        let camera = update.applied_to(&state.camera.path.last().unwrap_or(state.camera.newest))?;
        state.check_camera(&camera, lease)?;
        state.camera.path.push(time, camera, SystemTime::now())?;
        self.shared.wake.notify_one();
        Ok(state.camera.newest)
    }

    /// Checks that no other client holds the lease of the camera.
    pub(crate) fn check_lease(&self, lease: Option<u64>) -> Result<(), CameraError> {
        self.shared.state().check_lease(lease)
    }

    /// Moves the camera relative to its current pose; returns its new revision. On an error, it stays unchanged.
    pub(crate) fn fly(&self, flight: &Flight) -> Result<u64, CameraError> {
        let mut state = self.shared.state();
        let camera = flight.moved(&state.camera.newest)?;
        state.check_camera(&camera, None)?;
        let camera = state.move_camera(camera);
        self.shared.wake.notify_one();
        Ok(camera.revision)
    }

    /// Takes the lease of the camera; `over` takes it from another holder. Returns its number, and a receiver that
    /// reports a takeover.
    pub(crate) fn lease_camera(
        &self,
        holder: &str,
        over: bool,
    ) -> Result<(u64, oneshot::Receiver<String>), CameraError> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(CameraError::Ending);
        }
        let number = state.camera.lease.as_ref().map_or(1, |held| held.number + 1);
        match state.camera.lease.take() {
            Some(held) if !over => {
                let other = held.holder.clone();
                state.camera.lease = Some(held);
                return Err(CameraError::Leased { holder: other });
            }
            Some(held) => {
                // The holder may have disconnected.
                let _ = held.taken.send(holder.to_owned());
            }
            None => {}
        }
        let (taken, is_taken) = oneshot::channel();
        state.camera.lease = Some(Lease { number, holder: holder.to_owned(), taken });
        state.tell_camera();
        Ok((number, is_taken))
    }

    /// Releases the lease of the camera, unless another one has replaced it.
    pub(crate) fn release_camera(&self, lease: u64) {
        let mut state = self.shared.state();
        if state.camera.lease.as_ref().is_some_and(|held| held.number == lease) {
            state.camera.lease = None;
            state.tell_camera();
        }
    }

    /// Returns the holder of the lease of the camera; empty if there is none.
    pub(crate) fn holder(&self) -> String {
        self.shared.state().camera.lease.as_ref().map(|lease| lease.holder.clone()).unwrap_or_default()
    }

    /// Watches the camera; `None` marks the end.
    pub(crate) fn watch_camera(&self) -> watch::Receiver<Option<Camera>> {
        self.shared.state().camera.watched.subscribe()
    }

    /// Returns the content of a frame that begins now; `None` at the end.
    pub(crate) fn frame_content(&self) -> Option<Shown> {
        let now = SystemTime::now();
        let (scene, camera, settings, camera_time) = {
            let mut state = self.shared.state();
            let scene = state.scene.published.borrow().clone().filter(|_| !state.draining)?;
            state.follow(now);
            let settings = state.settings_of(&scene);
            (scene, state.camera.newest, settings, state.camera.pose_time)
        };
        Some(Shown { snapshot: self.shared.snapshot(&scene, camera, now), settings, camera_time })
    }

    /// Returns the revisions of scene and camera; `None` at the end.
    pub(crate) fn revisions(&self) -> Option<Revisions> {
        let state = self.shared.state();
        let scene = state.scene.published.borrow().as_ref().map(|scene| scene.revision);
        scene.filter(|_| !state.draining).map(|scene| state.shows(scene, SystemTime::now()))
    }

    /// Returns the streams of frames, of all sources.
    pub(crate) fn streams(&self) -> &Streams {
        &self.shared.streams
    }

    /// Returns the current scene.
    pub(crate) fn scene(&self) -> Result<SceneState, Refused> {
        self.shared.state().scene.published.borrow().clone().ok_or(Refused::Ending)
    }

    /// Watches the scene; `None` marks the end.
    pub(crate) fn watch_scene(&self) -> watch::Receiver<Option<SceneState>> {
        self.shared.state().scene.published.subscribe()
    }

    /// Returns the settings of frames whose views have no own settings.
    pub(crate) fn general(&self, scene: &SceneState) -> RenderSettings {
        self.shared.state().settings_of(scene)
    }

    /// Replaces the scene if it still has the revision that the change was made for; the new one has the next revision.
    /// Requests for frames of deleted views end with an error. The outer error: no more changes are accepted.
    pub(crate) fn replace_scene(
        &self,
        scene: SceneState,
        made_for: u64,
    ) -> Result<Result<SceneState, SceneError>, Refused> {
        let mut state = self.shared.state();
        let now = state.scene.published.borrow().clone().ok_or(Refused::Ending)?;
        if let Err(error) = now.expect(Some(made_for)) {
            return Ok(Err(error));
        }
        let jumps = scene.jumps_after(&now, SystemTime::now());
        let scene = SceneState { revision: made_for + 1, jumps, ..scene };
        let [before, after] = [&now, &scene].map(|scene| scene.objects.drawn.observer);
        if before != after {
            // A camera in the horizon frame was relative to the previous observer.
            state.follow(SystemTime::now());
            let turned = |camera: &Camera| camera.on_horizon_of(before.as_ref(), after.as_ref());
            let camera = turned(&state.camera.newest);
            if camera != state.camera.newest {
                // Poses that are waiting turn with it.
                state.camera.path.change(turned);
                state.place_camera(camera);
            }
        }
        state.scene.newest = scene.clone();
        state.scene.published.send_replace(Some(scene.clone()));
        state.end_deleted(&now.views);
        self.shared.wake.notify_one();
        Ok(Ok(scene))
    }

    /// Returns a scene at the current time, with the newest camera.
    pub(crate) fn snapshot(&self, scene: &SceneState) -> SceneSnapshot {
        self.shared.snapshot(scene, self.camera(), SystemTime::now())
    }

    /// Returns the settings for failure tests: those of frames, with another star method if one is given.
    pub(crate) fn settings_of_checks(&self, method: Option<StarMethod>) -> Result<RenderSettings, Refused> {
        let state = self.shared.state();
        let scene = state.scene.published.borrow().clone().filter(|_| !state.draining).ok_or(Refused::Ending)?;
        let mut settings = state.settings_of(&scene);
        settings.stars.method = method.unwrap_or(settings.stars.method);
        Ok(settings)
    }

    /// Returns the statistics of the render thread.
    pub(crate) fn figures(&self) -> RenderFigures {
        let state = self.shared.state();
        let quality = state.quality.as_ref().map(|quality| QualityFigures {
            frame_ms: quality.frame_ms(),
            smoothed_ms: quality.smoothed_ms(),
            level: quality.level(),
            given_up: quality::given_up(quality.level(), &state.settings),
        });
        RenderFigures {
            frames_rendered: state.statistics.frames_rendered,
            last_times: state.statistics.last_times.clone(),
            quality,
            failures: state.statistics.failures.clone(),
            losses: state.statistics.losses,
            last_age: state.statistics.last_age,
            audits: state.settings.accuracy.audit.then(|| self.shared.audits.figures()),
        }
    }

    /// Requests a frame of a view.
    pub(crate) fn request(&self, view: ViewId, wanted: Wanted) -> Result<PendingFrame, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if !state.has_view(view) {
            return Err(Refused::Deleted);
        }
        if state.calls_waiting() >= self.shared.capacity.requests {
            // Drop the requests of disconnected callers.
            state.queue.requests.retain(|request| !request.reply.is_closed());
        }
        if state.calls_waiting() >= self.shared.capacity.requests {
            return Err(Refused::Full);
        }
        let (reply, receiver) = oneshot::channel();
        state.queue.requests.push_back(Request {
            view,
            wanted,
            pace: Pace::new(Duration::ZERO),
            of_windows: false,
            reply,
        });
        self.shared.wake.notify_one();
        Ok(receiver)
    }

    /// Requests the next frame of each of these views together, so that views share a frame if possible. The frames are
    /// due as for a stream if the newest frames of all views are those `seen`, and at once otherwise.
    pub(crate) fn next_of_views(
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
                let (number, shown, start) = state.queue.newest_frames.get(view)?;
                (seen.get(view) == Some(number)).then(|| Pace::after(*shown, *start))
            })
            .collect();
        let paces = paces.unwrap_or_else(|| vec![Pace::new(Duration::ZERO); views.len()]);
        let mut receivers = Vec::with_capacity(views.len());
        for ((view, wanted), pace) in views.iter().zip(paces) {
            let (reply, receiver) = oneshot::channel();
            receivers.push(receiver);
            if state.has_view(*view) {
                state.queue.requests.push_back(Request { view: *view, wanted: *wanted, pace, of_windows: true, reply });
            } else {
                // The caller holds the receiver, but may have dropped it.
                let _ = reply.send(Err(RenderFailure::Deleted(String::new())));
            }
        }
        self.shared.wake.notify_one();
        Ok(receivers)
    }

    /// Subscribes to the frames of a view, at least `interval` apart.
    pub(crate) fn subscribe(&self, view: ViewId, wanted: Wanted, interval: Duration) -> Result<Subscription, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if !state.has_view(view) {
            return Err(Refused::Deleted);
        }
        let (subscription, slot) = self.shared.streams.open()?;
        state.queue.subscribers.push(Subscriber { view, wanted, pace: Pace::new(interval), slot });
        self.shared.wake.notify_one();
        Ok(subscription)
    }

    /// Subscribes to the next frame of a view after a frame number.
    pub(crate) fn subscribe_after(&self, view: ViewId, wanted: Wanted, after: u64) -> Result<Subscription, Refused> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if !state.has_view(view) {
            return Err(Refused::Deleted);
        }
        let (subscription, slot) = self.shared.streams.open()?;
        let seen = state.queue.newest_frames.get(&view).filter(|(number, ..)| *number == after);
        let pace = seen.map_or(Pace::new(Duration::ZERO), |(_, shown, start)| Pace::after(*shown, *start));
        state.queue.subscribers.push(Subscriber { view, wanted, pace, slot });
        self.shared.wake.notify_one();
        Ok(subscription)
    }

    /// Returns the number of waiting requests.
    pub(crate) fn requests_waiting(&self) -> usize {
        self.shared.state().calls_waiting()
    }

    /// Accepts no new work and ends every subscription; queued requests are still answered.
    pub(crate) fn drain(&self) {
        self.shared.state().end_streams(&Ok(()));
    }

    /// Ends the thread after the current frame; queued requests are refused.
    pub(crate) fn stop(&self) {
        self.drain();
        let mut state = self.shared.state();
        state.stop = true;
        // Dropping the replies notifies the callers.
        state.queue.requests.clear();
        drop(state);
        self.shared.wake.notify_one();
    }
}
