//! The [`RenderHandle`], by which async code reads and changes the state that it shares with the render thread
//! ([`super::shared_state`]).

use std::{
    collections::HashMap,
    sync::Arc,
    time::{Duration, SystemTime},
};

use tokio::sync::{oneshot, watch};

use super::{
    auditor::AuditFigures,
    quality,
    shared_state::{CameraError, Lease, RenderStatistics, Request, Shared, Subscriber},
};
use crate::{
    plan::settings::{RenderSettings, StarMethod},
    render::Wanted,
    scene::{Camera, SceneSnapshot},
    service::{
        frames::{
            errors::{Refused, RenderFailure},
            rendered_frame::RenderedFrame,
            schedule::{Pace, Revisions},
            subscriptions::{Streams, Subscription},
        },
        scene::{
            camera::{CameraUpdate, Horizontal},
            state::{SceneError, SceneState},
            views::ViewId,
        },
        time_source::TimeSource,
    },
    xr::{Flight, Shown},
};

/// A requested frame that has not arrived yet.
type PendingFrame = oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>;

/// Handle of the render thread for async code. None of its methods waits for a frame.
#[derive(Clone)]
pub(crate) struct RenderHandle {
    pub(crate) shared: Arc<Shared>,
}

/// Statistics of the render thread, with quality and audits.
#[derive(Clone, Debug)]
pub(crate) struct RenderFigures {
    /// Counts and times of frames.
    pub(crate) frames: RenderStatistics,
    /// Quality level of display images; `None` if their time is not limited.
    pub(crate) quality: Option<QualityFigures>,
    /// Results of audits; `None` if they are off.
    pub(crate) audits: Option<AuditFigures>,
}

/// Quality level of display images, and the frame times that it depends on.
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
        let now = state.time.now();
        state.follow(now);
        state.camera.newest
    }

    /// Moves the camera if it has the expected revision and no other client holds the lease; returns the camera with its new revision. On an error,
    /// the camera stays unchanged.
    pub(crate) fn set_camera(
        &self,
        update: &CameraUpdate,
        expected_revision: Option<u64>,
        lease: Option<u64>,
    ) -> Result<Camera, CameraError> {
        let mut state = self.shared.state();
        let now = state.time.now();
        state.follow(now);
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

    /// Adds a pose of a stream for a future time of the machine's clock: the camera moves there from the previous pose. Values that the update lacks
    /// come from that pose. Returns the current camera.
    pub(crate) fn plan_camera(
        &self,
        update: &CameraUpdate,
        time: SystemTime,
        (stream, lease): (u64, Option<u64>),
    ) -> Result<Camera, CameraError> {
        let time = self.shared.time.heard(time);
        let mut state = self.shared.state();
        let camera = update.applied_to(&state.camera.path.last().unwrap_or(state.camera.newest))?;
        state.check_camera(&camera, lease)?;
        let now = state.time.now();
        state.camera.path.push(time, camera, now)?;
        state.camera.path_of = stream;
        self.shared.wake.notify_one();
        Ok(state.camera.newest)
    }

    /// Returns the direction of a camera for the scene's observer; `None` without one.
    pub(crate) fn horizontal(&self, camera: &Camera) -> Option<Horizontal> {
        let state = self.shared.state();
        let scene = &state.scene.newest;
        let time_s = if camera.frame.turns() { camera.as_of_s } else { scene.clock.time_s(state.time.now()) };
        Horizontal::new(camera, scene.objects.drawn.observer.as_ref(), time_s)
    }

    /// Returns the daemon's time.
    pub(crate) fn time(&self) -> &TimeSource {
        &self.shared.time
    }

    /// Checks that no other client holds the lease of the camera.
    pub(crate) fn check_lease(&self, lease: Option<u64>) -> Result<(), CameraError> {
        self.shared.state().check_lease(lease)
    }

    /// Moves the camera relative to its current pose; returns the new revision. On an error, the camera stays unchanged.
    pub(crate) fn fly(&self, flight: &Flight) -> Result<u64, CameraError> {
        let mut state = self.shared.state();
        let camera = flight.moved(&state.camera.newest)?;
        state.check_camera(&camera, None)?;
        let camera = state.move_camera(camera);
        self.shared.wake.notify_one();
        Ok(camera.revision)
    }

    /// Begins a stream of poses; returns its number.
    pub(crate) fn begin_stream(&self) -> u64 {
        let mut state = self.shared.state();
        state.camera.streams += 1;
        state.camera.streams
    }

    /// Ends a stream of poses: its waiting poses are removed, and its lease is released unless another stream has it.
    pub(crate) fn end_stream(&self, stream: u64) {
        let mut state = self.shared.state();
        if state.camera.path_of == stream {
            state.rest_camera();
        }
        if state.camera.lease.as_ref().is_some_and(|held| held.number == stream) {
            state.camera.lease = None;
            state.tell_camera();
        }
    }

    /// Takes the lease of the camera for a stream; the lease gets the stream's number. If `over` is true, it is taken from another holder. Waiting
    /// poses of other streams are removed. Returns a receiver that reports a takeover.
    pub(crate) fn lease_camera(
        &self,
        stream: u64,
        holder: &str,
        over: bool,
    ) -> Result<oneshot::Receiver<String>, CameraError> {
        let mut state = self.shared.state();
        if state.draining {
            return Err(CameraError::Ending);
        }
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
        state.camera.lease = Some(Lease { number: stream, holder: holder.to_owned(), taken });
        state.rest_camera();
        state.tell_camera();
        Ok(is_taken)
    }

    /// Returns the holder of the lease of the camera; empty if there is none.
    pub(crate) fn holder(&self) -> String {
        self.shared.state().camera.lease.as_ref().map(|lease| lease.holder.clone()).unwrap_or_default()
    }

    /// Watches the camera; `None` marks the end.
    pub(crate) fn watch_camera(&self) -> watch::Receiver<Option<Camera>> {
        self.shared.state().camera.watched.subscribe()
    }

    /// Returns the content of a frame that begins now; `None` while the daemon ends.
    pub(crate) fn frame_content(&self) -> Option<Shown> {
        let now = self.shared.time.now();
        let (scene, camera, settings, camera_time) = {
            let mut state = self.shared.state();
            let scene = state.scene.published.borrow().clone().filter(|_| !state.draining)?;
            state.follow(now);
            let settings = state.settings_of(&scene);
            (scene, state.camera.newest, settings, state.camera.pose_time)
        };
        let camera_time = self.shared.time.told(camera_time);
        Some(Shown { snapshot: self.shared.snapshot(&scene, camera, now), settings, camera_time })
    }

    /// Returns the revisions of scene and camera; `None` while the daemon ends.
    pub(crate) fn revisions(&self) -> Option<Revisions> {
        let state = self.shared.state();
        let scene = state.scene.published.borrow().as_ref().map(|scene| scene.revision);
        scene.filter(|_| !state.draining).map(|scene| state.shows(scene, self.shared.time.now()))
    }

    /// Returns the streams of frames from all sources.
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

    /// Returns the general settings of frames, for views that set none themselves.
    pub(crate) fn general(&self, scene: &SceneState) -> RenderSettings {
        self.shared.state().settings_of(scene)
    }

    /// Replaces the scene if it still has the revision that the change was made for; the new one has the next revision. Requests for frames of
    /// deleted views end with an error. The outer error means that no more changes are accepted.
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
        let jumps = scene.jumps_after(&now, self.shared.time.now());
        let scene = SceneState { revision: made_for + 1, jumps, ..scene };
        let [before, after] = [&now, &scene].map(|scene| scene.objects.drawn.observer);
        if before != after {
            // A camera in the horizon frame was relative to the previous observer.
            let now = state.time.now();
            state.follow(now);
            let turned = |camera: &Camera| camera.on_horizon_of(before.as_ref(), after.as_ref());
            let camera = turned(&state.camera.newest);
            if camera != state.camera.newest {
                // Turn the waiting poses as well.
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
        self.shared.snapshot(scene, self.camera(), self.shared.time.now())
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
            frames: state.statistics.clone(),
            quality,
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

    /// Requests the next frame of each of these views together, so that views share a frame if possible. If the newest frames of all views are those
    /// `seen`, the frames are due as for a stream, otherwise at once.
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
                // The caller may have dropped the receiver.
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
