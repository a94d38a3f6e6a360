//! The state shared by the render thread ([`super::render_thread`]) and its handles ([`super::render_handle`]).
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
    auditor::AuditReport,
    camera_path::{CameraPath, CameraPathError},
    led::Led,
    quality::Quality,
};
use crate::{
    plan::{Limits, check_together, settings::RenderSettings},
    render::{FrameTimes, Wanted},
    scene::{Camera, PoseError, SceneObjects, SceneSnapshot, SeenStars},
    service::{
        frames::{
            errors::RenderFailure,
            latest_frame::LatestFrame,
            rendered_frame::RenderedFrame,
            schedule::{Pace, Revisions},
            subscriptions::Streams,
        },
        scene::{
            state::SceneState,
            views::{ViewId, ViewSet},
        },
        time_source::TimeSource,
    },
};

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
    /// Time of the daemon at which the newest camera was set.
    pub(crate) pose_time: SystemTime,
    /// Poses that clients have sent ahead of their time.
    pub(crate) path: CameraPath,
    /// The exclusive right to move the camera, while a client holds it.
    pub(crate) lease: Option<Lease>,
    /// Number of the last stream of poses; leases have the numbers of their streams.
    pub(crate) streams: u64,
    /// Number of the stream whose poses are waiting.
    pub(crate) path_of: u64,
    /// The camera as watching clients get it; `None` after the last change.
    pub(crate) watched: watch::Sender<Option<Camera>>,
}

/// The scene that frames show.
pub(crate) struct SceneControl {
    /// The scene as watching clients get it; `None` after the last change.
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
#[derive(Clone, Debug, Default)]
pub(crate) struct RenderStatistics {
    pub(crate) frames_rendered: u64,
    /// Times of the passes of the last frame; `None` before the first frame.
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
    /// State of a led worker, which draws cues instead of working at its own pace; `None`: the worker is not led.
    pub(crate) led: Option<Led>,
    /// The daemon's time.
    pub(crate) time: TimeSource,
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

    /// Returns the revisions of a frame that shows revision `scene` of the scene at a time.
    pub(crate) fn shows(&self, scene: u64, now: SystemTime) -> Revisions {
        Revisions { scene, camera: self.camera.newest.revision, step: self.scene.newest.clock.step(now) }
    }

    /// Checks that no other client holds the lease.
    pub(super) fn check_lease(&self, lease: Option<u64>) -> Result<(), CameraError> {
        match self.camera.lease.as_ref().filter(|held| lease != Some(held.number)) {
            Some(held) => Err(CameraError::Leased { holder: held.holder.clone() }),
            None => Ok(()),
        }
    }

    /// Checks that a caller may move the camera to a pose that the scene can be drawn from.
    pub(super) fn check_camera(&self, camera: &Camera, lease: Option<u64>) -> Result<(), CameraError> {
        self.check_lease(lease)?;
        // Of all changes of the camera, only the start of a movement can contradict other settings.
        let moves = camera.velocity_c != DVec3::ZERO;
        if moves && self.camera.newest.velocity_c == DVec3::ZERO {
            let scene = self.scene.published.borrow().clone().ok_or(CameraError::Ending)?;
            check_together(scene.stars.method, moves, &scene.objects.drawn, &self.limits)
                .map_err(|error| CameraError::Scene(error.to_string()))?;
        }
        Ok(())
    }

    /// Removes waiting poses; the camera rests where it is.
    pub(super) fn rest_camera(&mut self) {
        self.follow(self.time.now());
        self.camera.path.clear();
    }

    /// Moves the camera and removes waiting poses.
    pub(super) fn move_camera(&mut self, camera: Camera) -> Camera {
        self.camera.path.clear();
        self.place_camera(camera)
    }

    pub(super) fn place_camera(&mut self, camera: Camera) -> Camera {
        self.camera.newest = Camera { revision: self.camera.newest.revision + 1, ..camera };
        self.camera.pose_time = self.time.now();
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
    pub(super) fn tell_camera(&self) {
        let camera = self.camera.newest;
        self.camera.watched.send_if_modified(|watched| watched.as_mut().map(|watched| *watched = camera).is_some());
    }

    /// Returns the number of waiting requests of calls.
    pub(super) fn calls_waiting(&self) -> usize {
        self.queue.requests.iter().filter(|request| !request.of_windows).count()
    }

    /// Whether a view exists. Requests and stored data refer to existing views only.
    pub(crate) fn has_view(&self, view: ViewId) -> bool {
        self.scene.newest.views.index_of(view).is_some()
    }

    /// Ends the requests and subscriptions of views that were deleted.
    pub(super) fn end_deleted(&mut self, before: &ViewSet) {
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

/// Data that the thread and its handles share.
pub(crate) struct Shared {
    pub(crate) state: Mutex<State>,
    pub(crate) wake: Condvar,
    /// The stars of the scene.
    pub(crate) stars: Arc<SeenStars>,
    pub(crate) capacity: Capacity,
    pub(crate) streams: Streams,
    /// The daemon's time, without the lock.
    pub(crate) time: TimeSource,
    /// Results of audits.
    pub(crate) audits: AuditReport,
    /// The objects that were placed last, before and after the placing.
    pub(crate) placed: Mutex<Option<(Arc<SceneObjects>, Arc<SceneObjects>)>>,
}

impl Shared {
    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        // The engine, which may panic, never runs while this lock is held, so the state is consistent even if the lock is poisoned.
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
    pub(super) fn snapshot(&self, scene: &SceneState, camera: Camera, now: SystemTime) -> SceneSnapshot {
        let time_s = scene.clock.time_s(now);
        let objects = self.objects_at(&scene.objects.drawn, time_s);
        let camera = camera.carried(&objects, time_s);
        let stars = self.stars.at(objects.observer.as_ref(), time_s);
        SceneSnapshot { revision: scene.revision, stars, objects, camera }
    }
}
