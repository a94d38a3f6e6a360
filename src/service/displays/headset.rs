//! The headset as an additional view: the [`xr`](crate::xr) host, and the thread that drives the headset.
//!
//! ```text
//! render thread's state  --camera, scene-->  headset thread  --frames of the eyes-->  slots, replies
//! ```
//!
//! The headset produces frames at its own rate and on its own device. Each frame serves the streams that are due and
//! the requests for single frames; images are read back only then. Streams survive losses: there are no frames until
//! the headset is back. They end with an error only when its thread has ended. The headset's state has a separate lock,
//! which is held only briefly: frames are encoded elsewhere, and the render thread never waits for it.

use std::{
    error::Error,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use tokio::sync::{oneshot, watch};

use crate::{
    render::Wanted,
    service::{
        engine::{render_handle::RenderHandle, shared_state::Reply},
        frames::{
            errors::{Refused, RenderFailure},
            image_encoding::EncodedImages,
            latest_frame::LatestFrame,
            rendered_frame::{GivenUp, RenderedFrame},
            schedule::Revisions,
            subscriptions::Subscription,
        },
        scene::views::ViewId,
        threads::{RunningThread, panic_message},
    },
    xr::{Flight, HeadsetStatistics, Host, MirroredFrame, Shown, Status},
};

/// Assumed size of an eye's image while the real size is unknown, pixels.
const LARGEST_EYE_PX: u32 = 4096;

/// Drives a headset for a host, until [`Host::shown`] is `None` or the headset fails.
pub type Drive = Box<dyn FnOnce(Arc<dyn Host>) -> Result<(), Box<dyn Error + Send + Sync>> + Send>;

/// A headset for [`run`](crate::service::run).
pub struct HeadsetOptions {
    /// Name of the view that shows clients the images of the eyes; no other view may have it.
    pub name: String,
    /// Drives the headset on its own thread. The daemon continues if it fails or panics.
    pub drive: Drive,
}

/// A request for one frame.
struct Request {
    wanted: Wanted,
    /// Minimum revisions of the frame.
    at_least: Revisions,
    /// Whether the headset was asked for the image. Only frames that began after this request can serve it.
    asked: bool,
    reply: Reply,
}

/// A subscriber to frames.
struct Subscriber {
    wanted: Wanted,
    /// Minimum interval between the due times of its frames.
    interval: Duration,
    /// Due time of the last frame that it received.
    last: Option<Instant>,
    /// Due time of the requested frame. The request is served by the next frame, or never if that frame is lost.
    asked: Option<Instant>,
    slot: Weak<LatestFrame>,
}

impl Subscriber {
    /// Whether a frame is due. Each frame has a new pose, so this depends only on the interval.
    fn is_due(&self, now: Instant) -> bool {
        self.last.is_none_or(|last| now.duration_since(last) >= self.interval)
    }

    /// Delivers the requested frame. The next one is due an interval after this one was due, not after it arrived:
    /// refreshes of the display rarely match the due times, so the stream would lose up to a refresh each time.
    fn serve(&mut self) {
        let Some(asked) = self.asked.take() else { return };
        let due = self.last.map(|last| last + self.interval).filter(|due| asked.duration_since(*due) < self.interval);
        self.last = Some(due.unwrap_or(asked));
    }
}

#[derive(Default)]
struct State {
    statistics: HeadsetStatistics,
    requests: Vec<Request>,
    subscribers: Vec<Subscriber>,
    /// No new work is accepted.
    draining: bool,
    /// The thread has ended.
    ended: bool,
}

/// The service's view of the headset.
pub(crate) struct Headset {
    name: String,
    render: RenderHandle,
    state: Mutex<State>,
    /// Changes while `state` is locked.
    status: watch::Sender<Status>,
    /// Whether the last movement by the controllers was refused.
    refusing: AtomicBool,
}

fn reason_of(status: &Status) -> Option<&str> {
    match status {
        Status::Disconnected { reason, .. } => Some(reason),
        Status::Connected { .. } => None,
    }
}

/// Whether the images include all requested ones.
fn has(frame: &MirroredFrame, wanted: Wanted) -> bool {
    let images = &frame.frame.images;
    let complete = |display: bool, hdr: bool| (display || !wanted.display) && (hdr || !wanted.reads_hdr());
    !images.is_empty() && images.iter().all(|image| complete(image.display.is_some(), image.hdr.is_some()))
}

impl Headset {
    /// Creates a headset that is not connected yet.
    pub(crate) fn new(name: String, render: RenderHandle) -> Self {
        let status = Status::Disconnected { reason: "not connected yet".to_owned(), retrying: true };
        Self {
            name,
            render,
            state: Mutex::default(),
            status: watch::Sender::new(status),
            refusing: AtomicBool::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the name of its view.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the status, and the statistics so far.
    pub(crate) fn report(&self) -> (Status, HeadsetStatistics) {
        let state = self.state();
        (self.status.borrow().clone(), state.statistics.clone())
    }

    /// Returns the sizes of the images in pixels, or the assumed ones while the headset is not connected.
    pub(crate) fn sizes(&self) -> [[u32; 2]; 2] {
        match *self.status.borrow() {
            Status::Connected { sizes, .. } => sizes,
            Status::Disconnected { .. } => [[LARGEST_EYE_PX; 2]; 2],
        }
    }

    /// Watches the status.
    pub(crate) fn watch_status(&self) -> watch::Receiver<Status> {
        self.status.subscribe()
    }

    /// Requests a frame that begins after the call.
    pub(crate) fn request(
        &self,
        wanted: Wanted,
    ) -> Result<oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>, Refused> {
        let at_least = self.render.revisions().ok_or(Refused::Ending)?;
        let mut state = self.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if let Some(reason) = reason_of(&self.status.borrow()) {
            return Err(Refused::Headset(reason.to_owned()));
        }
        let (reply, receiver) = oneshot::channel();
        state.requests.push(Request { wanted, at_least, asked: false, reply });
        Ok(receiver)
    }

    /// Subscribes to its frames, at least `interval` apart.
    pub(crate) fn subscribe(&self, wanted: Wanted, interval: Duration) -> Result<Subscription, Refused> {
        let mut state = self.state();
        if state.draining {
            return Err(Refused::Ending);
        }
        if let Some(reason) = reason_of(&self.status.borrow()).filter(|_| state.ended) {
            return Err(Refused::Headset(reason.to_owned()));
        }
        let (subscription, slot) = self.render.streams().open()?;
        state.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
        state.subscribers.push(Subscriber { wanted, interval, last: None, asked: None, slot });
        Ok(subscription)
    }

    /// Accepts no new work and ends every subscription. The headset itself ends because the render thread drains.
    pub(crate) fn drain(&self) {
        let mut state = self.state();
        state.draining = true;
        end_streams(&mut state, &Ok(()));
    }

    fn set_status(&self, state: &mut State, status: Status) {
        if let Some(reason) = reason_of(&status) {
            let failure = if state.draining { RenderFailure::Ended } else { RenderFailure::Headset(reason.to_owned()) };
            for request in state.requests.drain(..) {
                // The caller may have disconnected.
                let _ = request.reply.send(Err(failure.clone()));
            }
        }
        self.status.send_if_modified(|old| {
            let changed = *old != status;
            *old = status;
            changed
        });
    }

    /// Ends all requests and streams. `problem` is the reason, unless the headset ended normally.
    fn end(&self, problem: Option<String>) {
        let mut state = self.state();
        match &problem {
            Some(problem) => tracing::error!("{problem}; the other views continue"),
            None if !state.draining => tracing::info!("the headset has ended; the other views continue"),
            None => {}
        }
        state.ended = true;
        let known = reason_of(&self.status.borrow()).map(str::to_owned);
        let reason = problem.or(known).unwrap_or_else(|| "its session has ended".to_owned());
        end_streams(&mut state, &Err(RenderFailure::Headset(reason.clone())));
        self.set_status(&mut state, Status::Disconnected { reason, retrying: false });
    }

    /// Starts the thread that drives the headset.
    pub(crate) fn spawn(self: &Arc<Self>, drive: Drive) -> io::Result<RunningThread> {
        let headset = Arc::clone(self);
        RunningThread::spawn("headset", move || {
            let host: Arc<dyn Host> = Arc::clone(&headset) as Arc<dyn Host>;
            // State left by a panicking driver is not used again.
            headset.end(match catch_unwind(AssertUnwindSafe(move || drive(host))) {
                Ok(Ok(())) => None,
                Ok(Err(error)) => Some(format!("the headset failed: {error}")),
                Err(payload) => Some(format!("the headset's thread panicked: {}", panic_message(payload.as_ref()))),
            });
        })
    }
}

fn end_streams(state: &mut State, how: &Result<(), RenderFailure>) {
    for slot in state.subscribers.drain(..).filter_map(|subscriber| subscriber.slot.upgrade()) {
        slot.end(how.clone());
    }
}

impl Host for Headset {
    fn shown(&self) -> Option<Shown> {
        self.render.frame_content()
    }

    fn fly(&self, flight: &Flight) {
        match self.render.fly(flight) {
            Ok(_) => self.refusing.store(false, Relaxed),
            // A controller repeats its input in every frame, so log the error only once.
            Err(error) if !self.refusing.swap(true, Relaxed) => {
                tracing::warn!("the controllers cannot move the camera: {error}")
            }
            Err(_) => {}
        }
    }

    fn mirror(&self) -> Wanted {
        let now = Instant::now();
        let mut state = self.state();
        state.requests.retain(|request| !request.reply.is_closed());
        state.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
        let mut all = Vec::new();
        for request in &mut state.requests {
            request.asked = true;
            all.push(request.wanted);
        }
        for subscriber in state.subscribers.iter_mut().filter(|subscriber| subscriber.is_due(now)) {
            subscriber.asked = Some(now);
            all.push(subscriber.wanted);
        }
        all.into_iter().fold(Wanted::default(), |sum, one| Wanted {
            display: sum.display || one.display,
            // The headset draws exact images in any case.
            hdr: sum.hdr || one.reads_hdr(),
            ..sum
        })
    }

    fn publish(&self, frame: MirroredFrame) {
        let shows = Revisions { scene: frame.frame.scene_revision, camera: frame.frame.camera_revision, step: 0 };
        let rendered = Arc::new(RenderedFrame {
            frame: Arc::clone(&frame.frame),
            views: Arc::from([ViewId::HEADSET]),
            camera: frame.camera,
            horizontal: None,
            pose_time: frame.pose_time,
            render_time: frame.render_time,
            // The headset must keep its refresh rate, so its frames have no quality levels.
            shows,
            given_up: GivenUp::default(),
            encoded: EncodedImages::default(),
        });
        let mut state = self.state();
        // A frame that began before the request, or lacks its images, leaves the request to the next frame.
        let served = |request: &mut Request| {
            let new = shows.scene >= request.at_least.scene && shows.camera >= request.at_least.camera;
            new && request.asked && has(&frame, request.wanted)
        };
        let served: Vec<Request> = state.requests.extract_if(.., served).collect();
        let mut due = Vec::new();
        for subscriber in &mut state.subscribers {
            if subscriber.asked.is_some() && has(&frame, subscriber.wanted) {
                subscriber.serve();
                due.extend(subscriber.slot.upgrade());
            }
        }
        drop(state);
        for request in served {
            // The caller may have disconnected.
            let _ = request.reply.send(Ok(Arc::clone(&rendered)));
        }
        for slot in due {
            slot.offer(Arc::clone(&rendered));
        }
    }

    fn status(&self, status: Status) {
        self.set_status(&mut self.state(), status);
    }

    fn statistics(&self, statistics: &HeadsetStatistics) {
        self.state().statistics.clone_from(statistics);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_keeps_its_rate_despite_a_similar_refresh_rate() {
        let refresh = Duration::from_nanos(11_111_111);
        for (interval_ms, expected) in [(0.0, 900), (11.111, 900), (33.333, 300), (25.0, 400), (50.0, 200)] {
            let interval = Duration::from_secs_f64(interval_ms * 1e-3);
            let mut subscriber =
                Subscriber { wanted: Wanted::default(), interval, last: None, asked: None, slot: Weak::new() };
            let start = Instant::now();
            let (mut served, mut gaps, mut last) = (0, Vec::new(), None);
            for number in 0..900_u32 {
                // The request times jitter by half a millisecond.
                let now = start + refresh * number + Duration::from_micros(u64::from(number * 7919 % 500));
                if subscriber.is_due(now) {
                    subscriber.asked = Some(now);
                    subscriber.serve();
                    served += 1;
                    gaps.extend(last.replace(now).map(|last| now - last));
                }
            }
            assert!(served * 50 >= expected * 49 && served <= expected + 1, "{interval_ms} ms: {served}");
            // Two frames in quick succession must not make up for a lost one.
            assert!(gaps.iter().all(|gap| *gap + refresh + Duration::from_millis(1) >= interval), "{interval_ms} ms");
        }
    }

    #[test]
    fn after_a_pause_a_stream_keeps_its_rate_without_catching_up() {
        let interval = Duration::from_millis(100);
        let start = Instant::now();
        let mut subscriber =
            Subscriber { wanted: Wanted::default(), interval, last: None, asked: None, slot: Weak::new() };
        for (after_ms, due) in [(0, true), (99, false), (101, true), (5000, true), (5090, false), (5101, true)] {
            let now = start + Duration::from_millis(after_ms);
            assert_eq!(subscriber.is_due(now), due, "after {after_ms} ms");
            if due {
                subscriber.asked = Some(now);
                subscriber.serve();
            }
        }
    }
}
