//! The headset as one more view: whom [`xr`](crate::xr) drives it for, and the thread on which that is done.
//!
//! ```text
//! render thread's state  --camera, scene-->  headset thread  --frames of the eyes-->  slots, replies
//! ```
//!
//! The headset's frames come at its own pace and from a device of its own. Each of them serves the streams that are due
//! and whoever waits for a single one; images leave the device only then. Streams live through losses: there are no frames until
//! the headset is back. Only when its thread has ended do they end with an error. What is known of the headset stands
//! under a lock of its own, which is held for moments: frames are encoded elsewhere, and the render thread never waits for it.

use std::{
    any::Any,
    error::Error,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    thread,
    time::{Duration, Instant},
};

use tokio::sync::{oneshot, watch};

use super::{
    order::EncodedImages,
    render::{Refused, RenderHandle, Reply},
    schedule::Revisions,
    slot::{GivenUp, RenderFailure, RenderedFrame, Slot},
    streams::Subscription,
    views::ViewId,
};
use crate::{
    render::Wanted,
    xr::{Flight, HeadsetStatistics, Host, MirroredFrame, Shown, Status},
};

/// Side of the images of an eye that are reckoned with while nobody knows them, pixels.
const LARGEST_EYE_PX: u32 = 4096;

/// Drives a headset for a host, until [`Host::shown`] is `None` or it cannot go on.
pub type Drive = Box<dyn FnOnce(Arc<dyn Host>) -> Result<(), Box<dyn Error + Send + Sync>> + Send>;

/// A headset for [`run`](super::run).
pub struct HeadsetOptions {
    /// Name of the view that shows clients what the eyes see; no other view has it.
    pub name: String,
    /// Drives it, on a thread of its own. The daemon goes on when it fails or panics.
    pub drive: Drive,
}

/// Somebody waits for one frame.
struct Request {
    wanted: Wanted,
    /// What the frame must show at least.
    at_least: Revisions,
    /// It was asked for, so a frame that comes was begun after the call.
    asked: bool,
    reply: Reply,
}

/// Somebody who gets frames.
struct Subscriber {
    wanted: Wanted,
    /// Shortest time between two of its frames, from one's being asked for to the other's.
    interval: Duration,
    /// When the last one that it got was due.
    last: Option<Instant>,
    /// When the next one was asked for; it comes with the frame after, or never where that is lost.
    asked: Option<Instant>,
    slot: Weak<Slot>,
}

impl Subscriber {
    /// Every frame shows another pose, so only the interval counts.
    fn is_due(&self, now: Instant) -> bool {
        self.last.is_none_or(|last| now.duration_since(last) >= self.interval)
    }

    /// It gets the frame that it has asked for. The next is due an interval after this one was, not after it came: a display's
    /// refreshes seldom fall on what is due, and would slow the stream down by up to a refresh each time.
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
    /// No new work is taken.
    draining: bool,
    /// The thread has ended.
    ended: bool,
}

/// What the service knows of the headset.
pub(super) struct Headset {
    name: String,
    render: RenderHandle,
    state: Mutex<State>,
    /// Changes while `state` is locked.
    status: watch::Sender<Status>,
    /// The last flight was refused.
    refusing: AtomicBool,
}

fn reason_of(status: &Status) -> Option<&str> {
    match status {
        Status::Disconnected { reason, .. } => Some(reason),
        Status::Connected { .. } => None,
    }
}

/// Whether the images have everything that is wanted of them.
fn has(frame: &MirroredFrame, wanted: Wanted) -> bool {
    let images = &frame.frame.images;
    let complete = |display: bool, hdr: bool| (display || !wanted.display) && (hdr || !wanted.hdr);
    !images.is_empty() && images.iter().all(|image| complete(image.display.is_some(), image.hdr.is_some()))
}

impl Headset {
    /// A headset that is not connected yet.
    pub(super) fn new(name: String, render: RenderHandle) -> Self {
        let status = Status::Disconnected { reason: "it has not been connected yet".to_owned(), retrying: true };
        Self {
            name,
            render,
            state: Mutex::default(),
            status: watch::Sender::new(status),
            refusing: AtomicBool::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Its view's name.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// How it stands, and its figures so far.
    pub(super) fn report(&self) -> (Status, HeadsetStatistics) {
        let state = self.state();
        (self.status.borrow().clone(), state.statistics.clone())
    }

    /// Sizes of its images, pixels: those that there may be while it is not connected.
    pub(super) fn sizes(&self) -> [[u32; 2]; 2] {
        match *self.status.borrow() {
            Status::Connected { sizes, .. } => sizes,
            Status::Disconnected { .. } => [[LARGEST_EYE_PX; 2]; 2],
        }
    }

    /// How it stands, and every change.
    pub(super) fn watch_status(&self) -> watch::Receiver<Status> {
        self.status.subscribe()
    }

    /// Asks for a frame that begins after the call.
    pub(super) fn request(
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

    /// Asks for its frames, at least `interval` apart, whenever there are some.
    pub(super) fn subscribe(&self, wanted: Wanted, interval: Duration) -> Result<Subscription, Refused> {
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

    /// Takes no new work and ends every subscription. The headset itself ends because the render thread drains.
    pub(super) fn drain(&self) {
        let mut state = self.state();
        state.draining = true;
        end_streams(&mut state, &Ok(()));
    }

    fn set_status(&self, state: &mut State, status: Status) {
        if let Some(reason) = reason_of(&status) {
            let failure = if state.draining { RenderFailure::Ended } else { RenderFailure::Headset(reason.to_owned()) };
            for request in state.requests.drain(..) {
                // A caller that went away meanwhile needs no answer.
                let _ = request.reply.send(Err(failure.clone()));
            }
        }
        self.status.send_if_modified(|old| {
            let changed = *old != status;
            *old = status;
            changed
        });
    }

    /// Nothing comes any more: `problem` says why, unless it was ended in order.
    fn end(&self, problem: Option<String>) {
        let mut state = self.state();
        match &problem {
            Some(problem) => tracing::error!("{problem}; the other views go on"),
            None if !state.draining => tracing::info!("the headset is left alone from now on; the other views go on"),
            None => {}
        }
        state.ended = true;
        let known = reason_of(&self.status.borrow()).map(str::to_owned);
        let reason = problem.or(known).unwrap_or_else(|| "its session was ended".to_owned());
        end_streams(&mut state, &Err(RenderFailure::Headset(reason.clone())));
        self.set_status(&mut state, Status::Disconnected { reason, retrying: false });
    }

    /// Starts the thread that drives it.
    pub(super) fn spawn(self: &Arc<Self>, drive: Drive) -> io::Result<HeadsetThread> {
        let (sender, ended) = oneshot::channel();
        let headset = Arc::clone(self);
        let join = thread::Builder::new().name("headset".to_owned()).spawn(move || {
            // Dropped at the very end: whoever sees that knows that the driver is gone.
            let _ended: oneshot::Sender<()> = sender;
            let host: Arc<dyn Host> = Arc::clone(&headset) as Arc<dyn Host>;
            // What the driver has left behind is not used again.
            headset.end(match catch_unwind(AssertUnwindSafe(move || drive(host))) {
                Ok(Ok(())) => None,
                Ok(Err(error)) => Some(format!("the headset cannot be driven: {error}")),
                Err(payload) => Some(format!("the headset's thread panicked: {}", panic_message(payload.as_ref()))),
            });
        })?;
        Ok(HeadsetThread { join, ended })
    }
}

fn end_streams(state: &mut State, how: &Result<(), RenderFailure>) {
    for slot in state.subscribers.drain(..).filter_map(|subscriber| subscriber.slot.upgrade()) {
        slot.end(how.clone());
    }
}

/// The text of a panic.
pub(super) fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}

/// The running thread.
pub(super) struct HeadsetThread {
    /// Its end.
    pub(super) join: thread::JoinHandle<()>,
    /// Resolves (with an error, since nothing is sent) when the thread has ended.
    pub(super) ended: oneshot::Receiver<()>,
}

impl Host for Headset {
    fn shown(&self) -> Option<Shown> {
        self.render.shown()
    }

    fn fly(&self, flight: &Flight) {
        match self.render.fly(flight) {
            Ok(_) => self.refusing.store(false, Relaxed),
            // A controller goes on from frame to frame: once is enough.
            Err(error) if !self.refusing.swap(true, Relaxed) => tracing::warn!("the flight ends here: {error}"),
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
            hdr: sum.hdr || one.hdr,
            ..sum
        })
    }

    fn publish(&self, frame: MirroredFrame) {
        let shows = Revisions { scene: frame.frame.scene_revision, camera: frame.frame.camera_revision, step: 0 };
        let rendered = Arc::new(RenderedFrame {
            frame: Arc::clone(&frame.frame),
            views: Arc::from([ViewId::HEADSET]),
            camera: frame.camera,
            pose_time: frame.pose_time,
            render_time: frame.render_time,
            // A headset's frames have a rate of their own to keep, and give up nothing.
            shows,
            given_up: GivenUp::default(),
            encoded: EncodedImages::default(),
        });
        let mut state = self.state();
        // A frame that was begun before the call, or without its images, leaves the request to the next one.
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
            // A caller that went away meanwhile needs no answer.
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
    fn a_stream_keeps_its_rate_beside_a_display_that_beats_with_it() {
        let refresh = Duration::from_nanos(11_111_111);
        for (interval_ms, expected) in [(0.0, 900), (11.111, 900), (33.333, 300), (25.0, 400), (50.0, 200)] {
            let interval = Duration::from_secs_f64(interval_ms * 1e-3);
            let mut subscriber =
                Subscriber { wanted: Wanted::default(), interval, last: None, asked: None, slot: Weak::new() };
            let start = Instant::now();
            let (mut served, mut gaps, mut last) = (0, Vec::new(), None);
            for number in 0..900_u32 {
                // The time of the question jitters by half a millisecond.
                let now = start + refresh * number + Duration::from_micros(u64::from(number * 7919 % 500));
                if subscriber.is_due(now) {
                    subscriber.asked = Some(now);
                    subscriber.serve();
                    served += 1;
                    gaps.extend(last.replace(now).map(|last| now - last));
                }
            }
            assert!(served * 50 >= expected * 49 && served <= expected + 1, "{interval_ms} ms: {served}");
            // Never two at once to make up for lost ones.
            assert!(gaps.iter().all(|gap| *gap + refresh + Duration::from_millis(1) >= interval), "{interval_ms} ms");
        }
    }

    #[test]
    fn after_a_pause_a_stream_goes_on_at_its_rate_and_makes_up_for_nothing() {
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
