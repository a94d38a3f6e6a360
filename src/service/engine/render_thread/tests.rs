//! Two frames in flight, with an engine that draws on command.

#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

use std::thread;

use glam::{DQuat, DVec3};
use tokio::sync::oneshot;

use super::*;
use crate::{
    config::ViewSpec,
    gpu::AdapterReport,
    plan::{
        FramePlan,
        settings::{ExposureMode, ExposureValues},
    },
    render::{Frame, FrameTimes},
    scene::Camera,
    service::{engine::interface::OpenBeside, frames::errors::Refused, scene::camera::CameraUpdate},
    view::{View, ViewKind},
};

/// Far longer than any test takes.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time within which a faulty thread would act.
const A_WHILE: Duration = Duration::from_millis(50);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    /// A frame has begun, with this revision of its camera.
    Begun(u64),
    /// A frame is finished. It has this number, counted from 0.
    Finished(usize),
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Failure {
    OfSubmit,
    OfFinish,
    Lost,
}

#[derive(Default)]
struct DeviceState {
    events: Vec<Event>,
    begun: usize,
    finished: usize,
    /// Number of frames that may be drawn.
    allowed: usize,
    /// Number of a frame, and its failure.
    failing: Option<(usize, Failure)>,
}

/// State shared by the test and the engine.
#[derive(Default)]
struct Device {
    state: Mutex<DeviceState>,
    changed: Condvar,
}

impl Device {
    fn change(&self, change: impl FnOnce(&mut DeviceState)) {
        change(&mut self.state.lock().unwrap());
        self.changed.notify_all();
    }

    /// Permits a total of `frames` frames to be drawn.
    fn allow(&self, frames: usize) {
        self.change(|state| state.allowed = frames);
    }

    fn fail(&self, number: usize, failure: Failure) {
        self.change(|state| state.failing = Some((number, failure)));
    }

    fn wait_while(&self, timeout: Duration, condition: impl Fn(&DeviceState) -> bool) -> bool {
        let state = self.state.lock().unwrap();
        let (state, _) = self.changed.wait_timeout_while(state, timeout, |state| condition(state)).unwrap();
        !condition(&state)
    }

    /// Waits until this many frames have begun.
    fn until_begun(&self, frames: usize) {
        assert!(self.wait_while(PATIENCE, |state| state.begun < frames), "frame {frames} did not begin");
    }

    fn begun(&self) -> usize {
        self.state.lock().unwrap().begun
    }

    fn events(&self) -> Vec<Event> {
        self.state.lock().unwrap().events.clone()
    }
}

struct TestEngine {
    device: Arc<Device>,
    in_flight: VecDeque<(usize, Frame)>,
}

impl Engine for TestEngine {
    fn submit(&mut self, request: FrameRequest<'_>) -> Result<(), EngineError> {
        let scene = request.get_scene();
        let mut number = 0;
        let mut fails = false;
        self.device.change(|state| {
            number = state.begun;
            fails = state.failing == Some((number, Failure::OfSubmit));
            state.begun += 1;
            state.events.push(Event::Begun(scene.camera.revision));
        });
        if fails {
            return Err(EngineError::new("requested failure"));
        }
        let frame = Frame {
            number: number as u64,
            scene_revision: scene.revision,
            camera_revision: scene.camera.revision,
            exposure_ev100: request.get_adapted_ev100().unwrap_or(0.0),
            metered_ev100: 0.0,
            mean_luminance_cd_m2: 0.0,
            images: Vec::new(),
            views: Vec::new(),
            plan: FramePlan::default(),
            hdr_plan: None,
            times: FrameTimes::default(),
        };
        self.in_flight.push_back((number, frame));
        assert!(self.in_flight.len() <= 2, "three frames at a time");
        Ok(())
    }

    fn is_drawn_within(&mut self, timeout: Duration) -> bool {
        let (number, _) = *self.in_flight.front().unwrap();
        self.device.wait_while(timeout, |state| state.allowed <= number)
    }

    fn reopen(&mut self) -> Result<(), EngineError> {
        self.in_flight.clear();
        Ok(())
    }

    fn finish(&mut self) -> Result<Frame, EngineError> {
        assert!(self.is_drawn_within(PATIENCE));
        let (number, frame) = self.in_flight.pop_front().unwrap();
        let mut failing = None;
        self.device.change(|state| {
            state.finished += 1;
            state.events.push(Event::Finished(number));
            failing = state.failing;
        });
        match failing.filter(|(failing, _)| *failing == number) {
            Some((_, Failure::Lost)) => Err(EngineError::lost("requested loss")),
            Some(_) => Err(EngineError::new("requested failure")),
            None => Ok(frame),
        }
    }

    fn beside(&self) -> OpenBeside {
        unreachable!("the render thread does not ask")
    }

    fn info(&self) -> AdapterReport {
        unreachable!("the render thread does not ask")
    }
}

/// Starts a thread that expects its first frame to take `drawn` to draw, and the next one `planned` to plan.
fn start(planned: Duration, drawn: Duration, mode: ExposureMode) -> (RenderHandle, RenderThread, Arc<Device>) {
    let device = Arc::new(Device::default());
    let engine = Box::new(TestEngine { device: Arc::clone(&device), in_flight: VecDeque::new() });
    let scene =
        SceneSnapshot { revision: 1, stars: Arc::default(), objects: Arc::default(), camera: Camera::default() };
    let objects = Objects::new(Arc::default(), &[], None).unwrap();
    let kind = ViewKind::Perspective { size: [4, 4], fov_y_rad: 1.0 };
    let view =
        |name: &str| (ViewSpec::custom(name), View::new(name, kind.clone(), DQuat::IDENTITY, DVec3::ZERO).unwrap());
    let exposure = ExposureValues { mode, ..Default::default() }.into();
    let settings = RenderSettings { exposure, ..RenderSettings::default() };
    let views = ViewSet::new(&settings, vec![view("flat"), view("wide")], std::path::Path::new("")).unwrap();
    let clock = SceneClock::stopped(0.0);
    let mut forecast = Forecast::default();
    forecast.note(planned, drawn);
    let capacity = Capacity { requests: 16, subscribers: 16 };
    let stars = SeenStars::new(Arc::clone(&scene.stars), None, Vec::new());
    let (handle, thread) = spawn_with(
        engine,
        (scene, stars),
        (objects, clock, views),
        settings,
        (capacity, TimeSource::default()),
        forecast,
    )
    .unwrap();
    (handle, thread, device)
}

/// Sets up a frame during which the next one begins as soon as it is due.
fn start_eager() -> (RenderHandle, RenderThread, Arc<Device>) {
    start(PATIENCE, PATIENCE, ExposureMode::Manual)
}

type Receiver = oneshot::Receiver<Result<Arc<RenderedFrame>, RenderFailure>>;

fn named(handle: &RenderHandle, name: &str) -> ViewId {
    handle.scene().unwrap().views.named(name).unwrap().0
}

fn request(handle: &RenderHandle) -> Receiver {
    handle.request(named(handle, "flat"), Wanted::display()).unwrap()
}

/// Makes two requests with separate frames, and waits until both frames are in flight.
fn two_in_flight(handle: &RenderHandle, device: &Device) -> [Receiver; 2] {
    let first = request(handle);
    device.until_begun(1);
    let second = request(handle);
    device.until_begun(2);
    [first, second]
}

fn number(receiver: Receiver) -> u64 {
    receiver.blocking_recv().unwrap().unwrap().frame.number
}

fn failure(receiver: Receiver) -> String {
    receiver.blocking_recv().unwrap().unwrap_err().to_string()
}

fn move_to(handle: &RenderHandle, x: f64) -> u64 {
    let update = CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() };
    handle.set_camera(&update, None, None).unwrap().revision
}

fn end(handle: &RenderHandle, thread: RenderThread) {
    handle.stop();
    thread.join.join().unwrap().unwrap();
}

#[test]
fn at_most_two_frames_are_in_flight() {
    let (handle, thread, device) = start_eager();
    let [first, second] = two_in_flight(&handle, &device);
    let third = request(&handle);
    thread::sleep(A_WHILE);
    assert_eq!(device.events(), [Event::Begun(0); 2]);
    device.allow(1);
    assert_eq!(number(first), 0);
    device.allow(3);
    assert_eq!([number(second), number(third)], [1, 2]);
    let finished: Vec<Event> = device.events().into_iter().filter(|e| matches!(e, Event::Finished(_))).collect();
    assert_eq!(finished, [Event::Finished(0), Event::Finished(1), Event::Finished(2)]);
    end(&handle, thread);
}

#[test]
fn the_next_frame_begins_as_late_as_possible_with_the_newest_camera() {
    let (handle, thread, device) = start(Duration::from_secs(1), Duration::from_secs(2), ExposureMode::Manual);
    let stream = handle.subscribe(named(&handle, "flat"), Wanted::display(), Duration::ZERO).unwrap();
    device.until_begun(1);
    let begun = Instant::now();
    let newest = [1.0, 2.0, 3.0, 4.0, 5.0].map(|x| move_to(&handle, x))[4];
    device.until_begun(2);
    assert!(begun.elapsed() > Duration::from_millis(500), "{:?}", begun.elapsed());
    let later = move_to(&handle, 6.0);
    device.allow(usize::MAX);
    device.until_begun(3);
    let begun: Vec<Event> = device.events().into_iter().filter(|e| matches!(e, Event::Begun(_))).collect();
    assert_eq!(begun[..3], [0, newest, later].map(Event::Begun));
    while pollster::block_on(stream.next()).unwrap().unwrap().0.frame.camera_revision < later {}
    end(&handle, thread);
}

#[test]
fn a_single_frame_is_delivered_as_soon_as_it_is_drawn() {
    let (handle, thread, device) = start(Duration::ZERO, PATIENCE, ExposureMode::Manual);
    let first = request(&handle);
    device.until_begun(1);
    let allowed = Instant::now();
    device.allow(1);
    assert_eq!(number(first), 0);
    assert!(allowed.elapsed() < PATIENCE / 4, "{:?}", allowed.elapsed());
    end(&handle, thread);
}

#[test]
fn a_failed_frame_affects_only_its_recipients() {
    let (handle, thread, device) = start_eager();
    device.fail(0, Failure::OfFinish);
    let [first, second] = two_in_flight(&handle, &device);
    device.allow(2);
    assert!(failure(first).contains("requested failure"));
    assert_eq!(number(second), 1);
    end(&handle, thread);

    let (handle, thread, device) = start_eager();
    device.fail(1, Failure::OfSubmit);
    let [first, mut second] = two_in_flight(&handle, &device);
    thread::sleep(A_WHILE);
    assert!(second.try_recv().is_err(), "the earlier frame is delivered first");
    device.allow(3);
    assert_eq!(number(first), 0);
    assert!(failure(second).contains("requested failure"));
    assert_eq!(number(request(&handle)), 2);
    end(&handle, thread);
}

#[test]
fn the_end_waits_for_both_frames() {
    let (handle, thread, device) = start_eager();
    let [first, second] = two_in_flight(&handle, &device);
    handle.stop();
    device.allow(2);
    assert_eq!([number(first), number(second)], [0, 1]);
    thread.join.join().unwrap().unwrap();
}

#[test]
fn a_lost_engine_is_reopened_and_both_frames_are_drawn_again() {
    let (handle, thread, device) = start_eager();
    device.fail(0, Failure::Lost);
    let both = two_in_flight(&handle, &device);
    device.allow(3);
    assert_eq!(both.map(number), [2, 2]);
    assert_eq!(handle.figures().frames.losses, 1);
    end(&handle, thread);
}

#[test]
fn adaptation_waits_for_the_frame_that_it_starts_from() {
    let (handle, thread, device) = start(PATIENCE, PATIENCE, ExposureMode::Auto);
    let first = request(&handle);
    device.until_begun(1);
    let second = request(&handle);
    thread::sleep(A_WHILE);
    assert_eq!(device.begun(), 1, "its exposure is not known before it is drawn");
    device.allow(2);
    assert_eq!([number(first), number(second)], [0, 1]);
    end(&handle, thread);
}

/// Replaces the views of the scene.
fn with_views(handle: &RenderHandle, change: impl FnOnce(&ViewSet, &RenderSettings) -> ViewSet) {
    let scene = handle.scene().unwrap();
    let views = change(&scene.views, &handle.general(&scene));
    let made_for = scene.revision;
    handle.replace_scene(scene.with_views(views, None).unwrap(), made_for).unwrap().unwrap();
}

fn without(handle: &RenderHandle, name: &str) {
    with_views(handle, |views, general| views.without(general, views.named(name).unwrap().1).unwrap());
}

#[test]
fn deleting_a_view_ends_its_requests_and_keeps_others() {
    let (handle, thread, device) = start_eager();
    let [flat, wide] = ["flat", "wide"].map(|name| named(&handle, name));
    let begun = request(&handle);
    device.until_begun(1);
    let [ends, stays] = [flat, wide].map(|view| handle.subscribe(view, Wanted::display(), Duration::ZERO).unwrap());
    device.until_begun(2);
    let waiting = request(&handle);
    without(&handle, "flat");
    assert_eq!(failure(waiting), "view `flat` was deleted");
    let refused = |result: Result<(), Refused>| assert_eq!(result, Err(Refused::Deleted));
    refused(handle.request(flat, Wanted::display()).map(drop));
    refused(handle.subscribe(flat, Wanted::display(), Duration::ZERO).map(drop));
    refused(handle.subscribe_after(flat, Wanted::display(), 0).map(drop));
    assert_eq!(pollster::block_on(ends.next()).unwrap_err().to_string(), "view `flat` was deleted");
    device.allow(usize::MAX);
    assert_eq!(number(begun), 0, "it began before the view was deleted");
    let mut seen = Vec::new();
    while seen.last().is_none_or(|(_, scene)| *scene < 2) {
        let frame = pollster::block_on(stays.next()).unwrap().unwrap().0;
        seen.push((frame.frame.number, frame.frame.scene_revision));
    }
    assert!(seen.is_sorted_by(|a, b| a.0 < b.0), "{seen:?}");
    // Nothing is stored for the deleted view.
    let state = handle.shared.state();
    assert_eq!(state.queue.newest_frames.keys().copied().collect::<Vec<_>>(), [wide]);
    assert_eq!(state.queue.subscribers.len(), 1);
    drop(state);
    // A new view has its name.
    drop(stays);
    without(&handle, "wide");
    let kind = "name = 'flat'\ntype = 'equirectangular'\nsize = [4, 2]";
    with_views(&handle, |views, general| {
        let (spec, view) = ViewSpec::from_toml(kind).unwrap();
        views.with(general, spec, view).unwrap()
    });
    assert_ne!(named(&handle, "flat"), flat);
    refused(handle.request(flat, Wanted::display()).map(drop));
    number(request(&handle));
    end(&handle, thread);
}

#[test]
fn requests_of_a_view_deleted_during_a_loss_are_not_repeated() {
    let (handle, thread, device) = start_eager();
    device.fail(1, Failure::Lost);
    let [first, second] = two_in_flight(&handle, &device);
    without(&handle, "flat");
    device.allow(usize::MAX);
    assert_eq!(number(first), 0);
    assert_eq!(failure(second), "view `flat` was deleted");
    end(&handle, thread);
}

#[test]
fn requests_of_a_new_view_are_drawn_during_shutdown() {
    let (handle, thread, device) = start_eager();
    let both = two_in_flight(&handle, &device);
    let kind = "name = 'new'\ntype = 'equirectangular'\nsize = [4, 2]";
    with_views(&handle, |views, general| {
        let (spec, view) = ViewSpec::from_toml(kind).unwrap();
        views.with(general, spec, view).unwrap()
    });
    let new = handle.request(named(&handle, "new"), Wanted::display()).unwrap();
    handle.drain();
    device.allow(usize::MAX);
    assert_eq!(both.map(number), [0, 1]);
    let frame = new.blocking_recv().unwrap().unwrap();
    assert_eq!((frame.frame.scene_revision, frame.views.len()), (2, 3));
    end(&handle, thread);
}

#[test]
fn exposure_state_belongs_to_a_view_not_to_its_name() {
    let (handle, thread, _) = start_eager();
    let scene = handle.scene().unwrap();
    let general = handle.general(&scene);
    let kind = "name = 'new'\ntype = 'equirectangular'\nsize = [4, 2]\nexposure = { ev100 = 1.0 }";
    let with = |views: &ViewSet| {
        let (spec, view) = ViewSpec::from_toml(kind).unwrap();
        views.with(&general, spec, view).unwrap()
    };
    let groups = |views: ViewSet| Groups::new(&general, &scene.clone().with_views(views, None).unwrap(), 0);
    let first = with(&scene.views);
    let without = first.without(&general, 2).unwrap();
    let second = with(&without);
    let [first, without, second] = [first, without, second].map(groups);
    assert_eq!([first.eyes.len(), without.eyes.len(), second.eyes.len()], [2, 1, 2]);
    assert_eq!([&first.eyes[0], &first.eyes[0]], [&without.eyes[0], &second.eyes[0]], "other views keep their state");
    assert_eq!(first.eyes[1].0, second.eyes[1].0);
    assert_ne!(first.eyes[1], second.eyes[1]);
    end(&handle, thread);
}

#[test]
fn deleted_views_leave_no_state() {
    let (handle, thread, device) = start_eager();
    device.allow(usize::MAX);
    let stays = handle.subscribe(named(&handle, "flat"), Wanted::display(), Duration::ZERO).unwrap();
    let mut shown = 0;
    for _ in 0..200 {
        let kind = "name = 'new'\ntype = 'equirectangular'\nsize = [4, 2]\nexposure = { ev100 = 1.0 }";
        with_views(&handle, |views, general| {
            let (spec, view) = ViewSpec::from_toml(kind).unwrap();
            views.with(general, spec, view).unwrap()
        });
        let view = named(&handle, "new");
        let stream = handle.subscribe(view, Wanted::display(), Duration::ZERO).unwrap();
        let pulled = handle.subscribe_after(view, Wanted::display(), 0).unwrap();
        let frame = pollster::block_on(stream.next()).unwrap().unwrap().0;
        assert!(frame.frame.number >= shown);
        shown = frame.frame.number;
        without(&handle, "new");
        while pollster::block_on(pulled.next()).is_ok() {}
    }
    let revision = handle.scene().unwrap().revision;
    while pollster::block_on(stays.next()).unwrap().unwrap().0.frame.scene_revision < revision {}
    let state = handle.shared.state();
    let (newest, of) = (state.queue.newest_frames.len(), [state.queue.subscribers.len(), state.queue.requests.len()]);
    drop(state);
    assert_eq!((newest, of, handle.streams().count()), (1, [1, 0], 1));
    end(&handle, thread);
}
