//! A headset as an additional view, driven by a thread that the test controls.

mod statistics;

mod endings;

use std::{
    collections::VecDeque,
    error::Error,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering::SeqCst},
    },
    thread,
    time::{Duration, Instant, SystemTime},
};

use glam::{DQuat, DVec3};
use steradian::{
    output::Encoding,
    plan::{FramePlan, settings::StarMethod},
    render::{Frame, FrameImage, FrameTimes, Wanted},
    service::{
        CameraUpdate, ClientError, FrameReceiver, HeadsetOptions, ReceivedFrame, SceneUpdate, ServeError, proto,
    },
    view::Part,
    xr::{Distribution, Flight, HeadsetStatistics, Host, MirroredFrame, Shown, Status},
};
use tonic::Code;

use crate::{
    daemon::{Daemon, large_rig, small_rig, until, within},
    rig::round,
};

/// Width and height of the eyes, pixels.
const SIZES: [[u32; 2]; 2] = [[3, 2], [4, 2]];
const LOST: &str = "the runtime was lost";

/// Commands of the test to the thread.
enum Order {
    Connect,
    Lose,
    Statistics(HeadsetStatistics),
    Fail,
    Panic,
    End,
}

/// State shared by the test and the thread.
#[derive(Default)]
struct Headset {
    host: Mutex<Option<Arc<dyn Host>>>,
    orders: Mutex<VecDeque<Order>>,
    /// Whether the thread makes no frames, as if the headset was not worn.
    idle: AtomicBool,
    /// Whether the thread ignores requests to end.
    stubborn: AtomicBool,
    /// Requested images of each frame.
    wanted: Mutex<Vec<Wanted>>,
    last_shown: Mutex<Option<Shown>>,
    ended: AtomicBool,
    /// Number of frames. Each frame has a different pose time.
    frames: AtomicU64,
}

fn connected(state: &'static str) -> Status {
    Status::Connected {
        runtime: "Test Runtime 1.2.3".to_owned(),
        system: "test system".to_owned(),
        state,
        sizes: SIZES,
        adapter: "another adapter".to_owned(),
        problem: None,
    }
}

fn lost() -> Status {
    Status::Disconnected { reason: LOST.to_owned(), retrying: true }
}

/// Returns the time at which the poses of a frame were queried.
fn pose_time(number: u64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000 + number)
}

/// Returns images of the eyes, in which each pixel contains the numbers of the frame and the eye.
fn mirrored(number: u64, shown: &Shown, wanted: Wanted) -> MirroredFrame {
    let parts = [Part::LeftEye, Part::RightEye].into_iter().enumerate();
    let images = parts.map(|(eye, part)| {
        let [width, height] = SIZES[eye];
        let pixels = (width * height) as usize;
        FrameImage {
            view: 0,
            part,
            width,
            height,
            display: wanted.display.then(|| [number as u8, eye as u8, 77, 255].repeat(pixels)),
            hdr: wanted.hdr.then(|| vec![[number as f32, eye as f32, 0.5, 1e-6]; pixels]),
            projector: None,
        }
    });
    let frame = Frame {
        number,
        scene_revision: shown.snapshot.revision,
        camera_revision: shown.snapshot.camera.revision,
        exposure_ev100: -4.5,
        metered_ev100: 0.0,
        mean_luminance_cd_m2: 0.0,
        times: FrameTimes::default(),
        images: images.collect(),
        views: Vec::new(),
        plan: FramePlan::default(),
        hdr_plan: None,
    };
    MirroredFrame {
        frame: Arc::new(frame),
        camera: shown.snapshot.camera,
        pose_time: pose_time(number),
        render_time: SystemTime::now(),
    }
}

impl Headset {
    fn drive(&self, host: &dyn Host) -> Result<(), Box<dyn Error + Send + Sync>> {
        let mut showing = false;
        loop {
            let Some(shown) = host.shown() else {
                if !self.stubborn.load(SeqCst) {
                    return Ok(());
                }
                thread::sleep(Duration::from_millis(1));
                continue;
            };
            *self.last_shown.lock().unwrap() = Some(shown.clone());
            let order = self.orders.lock().unwrap().pop_front();
            match order {
                Some(Order::Connect) => {
                    host.status(connected("focused"));
                    showing = true;
                }
                Some(Order::Lose) => {
                    host.status(lost());
                    showing = false;
                }
                Some(Order::Statistics(statistics)) => host.statistics(&statistics),
                Some(Order::Fail) => return Err("no runtime with XR_KHR_vulkan_enable2".into()),
                Some(Order::Panic) => panic!("the test headset was requested to panic"),
                Some(Order::End) => return Ok(()),
                None => {}
            }
            if showing && !self.idle.load(SeqCst) {
                let number = self.frames.fetch_add(1, SeqCst);
                let wanted = host.mirror();
                self.wanted.lock().unwrap().push(wanted);
                if wanted != Wanted::default() {
                    host.publish(mirrored(number, &shown, wanted));
                }
            }
            thread::sleep(Duration::from_millis(2));
        }
    }

    fn send(&self, order: Order) {
        self.orders.lock().unwrap().push_back(order);
    }

    fn host(&self) -> Arc<dyn Host> {
        Arc::clone(self.host.lock().unwrap().as_ref().expect("the thread has begun"))
    }

    fn last_content(&self) -> Shown {
        self.last_shown.lock().unwrap().clone().expect("the thread has asked")
    }
}

/// Returns the options of a headset `visor` that the test controls.
fn visor(name: &str) -> (Arc<Headset>, HeadsetOptions) {
    let headset = Arc::new(Headset::default());
    let driven = Arc::clone(&headset);
    let drive = move |host: Arc<dyn Host>| {
        struct Ended(Arc<Headset>);
        impl Drop for Ended {
            fn drop(&mut self) {
                self.0.ended.store(true, SeqCst);
            }
        }
        let _ended = Ended(Arc::clone(&driven));
        *driven.host.lock().unwrap() = Some(Arc::clone(&host));
        driven.drive(host.as_ref())
    };
    (headset, HeadsetOptions { name: name.to_owned(), drive: Box::new(drive) })
}

/// Starts a daemon with the small rig and a headset that is not connected yet.
async fn start() -> (Daemon, Arc<Headset>) {
    let (headset, options) = visor("visor");
    let daemon = Daemon::start_with(small_rig(), |serve| serve.headset = Some(options)).await;
    until(|| headset.last_shown.lock().unwrap().is_some()).await;
    (daemon, headset)
}

async fn next(stream: &mut FrameReceiver) -> ReceivedFrame {
    within(stream.next()).await.unwrap().expect("the stream goes on")
}

/// Waits until clients see this status of the headset.
async fn until_connected(daemon: &Daemon, connected: bool) {
    let mut client = daemon.client().await;
    within(async {
        loop {
            let status = client.info().await.unwrap().headset.expect("there is a headset");
            if status.connected == connected {
                break;
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    })
    .await;
}

async fn connect(daemon: &Daemon, headset: &Headset) {
    headset.send(Order::Connect);
    until_connected(daemon, true).await;
}

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

#[track_caller]
fn unavailable(error: &ClientError, reason: &str) {
    assert_eq!(error.code(), Some(Code::Unavailable), "{error}");
    assert!(error.to_string().contains(reason), "`{reason}` is not in: {error}");
}

#[tokio::test]
async fn the_headset_is_a_view_with_sizes_while_connected() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let views = client.views().await.unwrap();
    let names: Vec<_> = views.iter().map(|view| (view.name.as_str(), view.kind.as_str())).collect();
    assert_eq!(names, [("flat", "perspective"), ("eyes", "stereo"), ("visor", "headset")]);
    assert!(views[2].images.is_empty(), "{:?}", views[2]);
    let status = client.info().await.unwrap().headset.unwrap();
    assert!(!status.connected && status.retrying && status.reason.contains("not connected yet"), "{status:?}");
    connect(&daemon, &headset).await;
    let images = client.views().await.unwrap().remove(2).images;
    let images: Vec<_> = images.iter().map(|image| (image.part.as_str(), image.width, image.height)).collect();
    assert_eq!(images, [("left", 3, 2), ("right", 4, 2)]);
    let status = client.info().await.unwrap().headset.unwrap();
    assert!(status.connected && status.reason.is_empty(), "{status:?}");
    let texts = [status.runtime.as_str(), &status.system, &status.adapter, &status.session_state];
    assert_eq!(texts, ["Test Runtime 1.2.3", "test system", "another adapter", "focused"]);
    assert_eq!(status.images.len(), 2);
    let error = client.render_frame("vizor", Encoding::Png).await.unwrap_err();
    assert!(error.to_string().contains("flat, eyes, visor"), "{error}");
    // No other view can have the name of the headset, and the headset's view cannot be deleted.
    let made = client.create_view(&round("visor", 8), None).await.unwrap_err();
    assert_eq!(made.code(), Some(Code::AlreadyExists), "{made}");
    let deleted = client.delete_view("visor", None).await.unwrap_err();
    assert_eq!(deleted.code(), Some(Code::FailedPrecondition), "{deleted}");
    client.delete_view("flat", None).await.unwrap();
    client.create_view(&round("dome", 8), None).await.unwrap();
    let names: Vec<_> = client.views().await.unwrap().into_iter().map(|view| view.name).collect();
    assert_eq!(names, ["eyes", "dome", "visor"]);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_daemon_without_a_headset_has_none() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    assert_eq!(client.views().await.unwrap().len(), 2);
    assert_eq!(client.info().await.unwrap().headset, None);
    let mut stats = client.watch_stats(None).await.unwrap();
    assert_eq!(within(stats.next()).await.unwrap().unwrap().headset, None);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_single_frame_shows_the_eyes_after_the_call() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let error = client.render_frame("visor", Encoding::Rgba8).await.unwrap_err();
    unavailable(&error, "not connected yet");
    connect(&daemon, &headset).await;
    for x in 1..=5 {
        // A frame that began earlier shows another camera.
        let camera = client.set_camera(&at_x(f64::from(x))).await.unwrap();
        let frame = within(client.render_frame("visor", Encoding::Rgba8)).await.unwrap();
        assert_eq!((frame.view.as_str(), frame.camera_revision, frame.scene_revision), ("visor", camera.revision, 7));
        assert_eq!((frame.pose_time, frame.exposure_ev100, frame.dropped), (pose_time(frame.number), -4.5, 0));
        let parts: Vec<_> = frame.images.iter().map(|i| (i.part.as_str(), i.width, i.height)).collect();
        assert_eq!(parts, [("left", 3, 2), ("right", 4, 2)]);
        for (eye, image) in frame.images.iter().enumerate() {
            let [width, height] = SIZES[eye];
            let pixel = [frame.number as u8, eye as u8, 77, 255];
            assert_eq!(image.data, pixel.repeat((width * height) as usize));
        }
    }
    let frame = within(client.render_frame("visor", Encoding::Rgb32f)).await.unwrap();
    assert_eq!(frame.images[1].data[4..8], 1_f32.to_le_bytes(), "luminance of the right eye");
    headset.send(Order::Lose);
    until_connected(&daemon, false).await;
    unavailable(&client.render_frame("visor", Encoding::Rgba8).await.unwrap_err(), LOST);
    assert_eq!(daemon.controls.started.load(SeqCst), 0, "the render thread draws nothing");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn frames_from_before_the_call_or_without_its_images_do_not_serve_it() {
    let (daemon, headset) = start().await;
    headset.idle.store(true, SeqCst);
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let host = headset.host();
    let display = Wanted { display: true, ..Wanted::default() };
    let before = host.shown().unwrap();
    client.set_camera(&at_x(1.0)).await.unwrap();
    client.update_scene(&SceneUpdate { magnitude_limit: Some(6.0), ..SceneUpdate::default() }, None).await.unwrap();
    let call = tokio::spawn({
        let mut client = client.clone();
        async move { client.render_frame("visor", Encoding::Rgba8).await }
    });
    // This frame is in flight during the call. It shows the newest camera, but another pose of the head.
    until(|| {
        host.publish(mirrored(0, &host.shown().unwrap(), display));
        host.mirror().display
    })
    .await;
    let now = host.shown().unwrap();
    let mut old_scene = now.clone();
    old_scene.snapshot.revision -= 1;
    host.publish(mirrored(1, &before, display));
    host.publish(mirrored(2, &old_scene, display));
    host.publish(mirrored(3, &now, Wanted { hdr: true, ..Wanted::default() }));
    assert_eq!(host.mirror(), display, "the call still waits");
    host.publish(mirrored(4, &now, display));
    assert_eq!(within(call).await.unwrap().unwrap().number, 4);
    assert_eq!(host.mirror(), Wanted::default());
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_lost_frame_is_requested_again() {
    let (daemon, headset) = start().await;
    headset.idle.store(true, SeqCst);
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let host = headset.host();
    // The stream gets one frame in a thousand seconds, so a lost frame must not count as delivered.
    let mut stream = client.stream_frames("visor", Encoding::Rgba8, 0.001).await.unwrap();
    let display = Wanted { display: true, ..Wanted::default() };
    assert_eq!(host.mirror(), display);
    headset.send(Order::Lose);
    until_connected(&daemon, false).await;
    connect(&daemon, &headset).await;
    assert_eq!(host.mirror(), display);
    host.publish(mirrored(9, &host.shown().unwrap(), display));
    assert_eq!(next(&mut stream).await.number, 9);
    assert_eq!(host.mirror(), Wanted::default(), "the next frame is not due yet");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn waiting_calls_fail_when_the_headset_is_lost_or_idle() {
    let (daemon, headset) = start().await;
    headset.idle.store(true, SeqCst);
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let call = tokio::spawn({
        let mut client = client.clone();
        async move { client.render_frame("visor", Encoding::Png).await }
    });
    // The request of the call exists when the headset queries which images are requested.
    let host = headset.host();
    until(|| host.mirror().display).await;
    headset.send(Order::Lose);
    unavailable(&within(call).await.unwrap().unwrap_err(), LOST);
    connect(&daemon, &headset).await;
    unavailable(&within(client.render_frame("visor", Encoding::Png)).await.unwrap_err(), "not shown a frame");
    assert!(!host.mirror().display, "no call is waiting");
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_mirror_the_eyes_at_their_own_rates_while_another_view_goes_on() {
    let (daemon, headset) = start().await;
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let begin = Instant::now();
    let mut slow = client.stream_frames("visor", Encoding::Rgb32f, 4.0).await.unwrap();
    let slow = tokio::spawn(async move {
        let mut frames = Vec::new();
        while frames.len() < 3 {
            frames.push(next(&mut slow).await);
        }
        let elapsed_s = begin.elapsed().as_secs_f64();
        (frames, elapsed_s)
    });
    let mut fast = client.stream_frames("visor", Encoding::Rgba8, 0.0).await.unwrap();
    let mut flat = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let (mut fast_frames, mut step) = (vec![next(&mut fast).await], 0);
    while !slow.is_finished() {
        fast_frames.push(next(&mut fast).await);
        step += 1;
        let camera = client.set_camera(&at_x(f64::from(step))).await.unwrap();
        while next(&mut flat).await.camera_revision < camera.revision {}
    }
    let (slow_frames, elapsed_s) = within(slow).await.unwrap();
    // The clock starts before the first frame, so the count is at most four frames per second on any machine.
    assert!(slow_frames.len() as u32 <= 1 + (elapsed_s * 4.0) as u32, "{} in {elapsed_s} s", slow_frames.len());
    assert!(fast_frames.is_sorted_by(|a, b| a.number < b.number));
    assert!(fast_frames.iter().all(|frame| frame.images[0].data[0] == frame.number as u8));
    assert!(slow_frames.iter().all(|frame| frame.dropped == 0 && frame.pose_time == pose_time(frame.number)));
    // Luminance was read back only for the frames of the slow stream.
    let wanted = headset.wanted.lock().unwrap().clone();
    let hdr = wanted.iter().filter(|wanted| wanted.hdr).count();
    println!("{} frames: {hdr} with luminance, fast stream {}", wanted.len(), fast_frames.len());
    assert!(hdr <= 1 + (begin.elapsed().as_secs_f64() * 4.0) as usize, "{hdr} of {}", wanted.len());
    assert!(hdr < wanted.iter().filter(|wanted| wanted.display).count());
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn nothing_is_read_back_without_readers() {
    let (daemon, headset) = start().await;
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("visor", Encoding::Png, 0.0).await.unwrap();
    next(&mut stream).await;
    drop(stream);
    // The daemon detects the dropped stream a little later.
    let last = || headset.wanted.lock().unwrap().last().copied();
    until(|| last() == Some(Wanted::default())).await;
    let frames = headset.frames.load(SeqCst);
    until(|| headset.frames.load(SeqCst) > frames + 5).await;
    let wanted = headset.wanted.lock().unwrap().clone();
    assert!(wanted[frames as usize..].iter().all(|wanted| *wanted == Wanted::default()));
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_survives_losses_and_waits_for_the_headset() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("visor", Encoding::Rgba8, 0.0).await.unwrap();
    let mut flat = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut last = None;
    for round in 0..10 {
        connect(&daemon, &headset).await;
        let begun = headset.frames.load(SeqCst);
        let mut frame = next(&mut stream).await;
        while frame.number < begun {
            frame = next(&mut stream).await;
        }
        assert!(last.is_none_or(|last| frame.number > last));
        last = Some(frame.number);
        headset.send(Order::Lose);
        until_connected(&daemon, false).await;
        let camera = client.set_camera(&at_x(f64::from(round))).await.unwrap();
        while next(&mut flat).await.camera_revision < camera.revision {}
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn flights_and_client_poses_combine_without_loss() {
    const FLIGHTS: u64 = 2000;
    const POSES: u64 = 200;
    let (daemon, headset) = start().await;
    let host = headset.host();
    let turn = DQuat::from_rotation_y(1e-3);
    let flying = thread::spawn(move || {
        for _ in 0..FLIGHTS {
            host.fly(&Flight { translation_m: DVec3::new(0.5, 0.0, -0.25), rotation: turn });
        }
    });
    let mut client = daemon.client().await;
    let mut last = 0;
    for step in 1..=POSES {
        // Set only the velocity, because position and orientation come from the flight.
        let velocity_c = Some([0.0, step as f64 * 1e-3, 0.0]);
        let camera = client.set_camera(&CameraUpdate { velocity_c, ..CameraUpdate::default() }).await.unwrap();
        assert!(camera.revision > last);
        last = camera.revision;
    }
    flying.join().unwrap();
    let camera = client.camera().await.unwrap();
    assert_eq!(camera.revision, FLIGHTS + POSES);
    assert_eq!(camera.position_m, DVec3::new(0.5, 0.0, -0.25) * FLIGHTS as f64);
    assert_eq!(camera.velocity_c, DVec3::new(0.0, POSES as f64 * 1e-3, 0.0));
    let turned = DQuat::from_rotation_y(1e-3 * FLIGHTS as f64);
    assert!(camera.world_from_camera.angle_between(turned) < 1e-6, "{:?}", camera.world_from_camera);
    assert!((camera.world_from_camera.length() - 1.0).abs() < 1e-15);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_flight_turns_about_world_axes_and_ends_at_invalid_numbers() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let quarter = |axis: DVec3| DQuat::from_axis_angle(axis, std::f64::consts::FRAC_PI_2);
    let about_x = quarter(DVec3::X).to_array();
    client.set_camera(&CameraUpdate { orientation: Some(about_x), ..CameraUpdate::default() }).await.unwrap();
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    // This time is from the daemon's clock, which does not change if the machine's clock is set.
    let before = next(&mut stream).await.pose_time;
    let host = headset.host();
    host.fly(&Flight { translation_m: DVec3::X, rotation: quarter(DVec3::Y) });
    let frame = next(&mut stream).await;
    assert_eq!(frame.camera_revision, 2, "the stream must not wait for its heartbeat");
    assert!(frame.pose_time > before);
    let camera = client.camera().await.unwrap();
    let expected = quarter(DVec3::Y) * quarter(DVec3::X);
    assert!((camera.world_from_camera * DVec3::Z - expected * DVec3::Z).length() < 1e-12);
    assert!((camera.world_from_camera * DVec3::X - expected * DVec3::X).length() < 1e-12);
    let shown = host.shown().unwrap();
    assert_eq!(shown.snapshot.camera, camera);
    assert!(shown.camera_time > before);
    for translation_m in [DVec3::new(f64::NAN, 0.0, 0.0), DVec3::splat(f64::INFINITY)] {
        host.fly(&Flight { translation_m, rotation: DQuat::IDENTITY });
        assert_eq!(client.camera().await.unwrap(), camera);
    }
    host.fly(&Flight { translation_m: DVec3::Y, rotation: DQuat::IDENTITY });
    assert_eq!(client.camera().await.unwrap().position_m, DVec3::new(1.0, 1.0, 0.0));
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn the_headset_receives_scene_changes() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let before = headset.host().shown().unwrap();
    assert_eq!((before.snapshot.revision, before.settings.stars.method), (7, StarMethod::Auto));
    let time_s = before.snapshot.objects.time_s + 3600.0;
    let update = SceneUpdate { star_method: Some(StarMethod::Tent), time_s: Some(time_s), ..SceneUpdate::default() };
    client.update_scene(&update, None).await.unwrap();
    let camera = client.set_camera(&at_x(3.0)).await.unwrap();
    let after = headset.host().shown().unwrap();
    assert_eq!((after.snapshot.revision, after.settings.stars.method), (8, StarMethod::Tent));
    assert_eq!((after.snapshot.objects.time_s, after.snapshot.camera), (time_s, camera));
    assert!(Arc::ptr_eq(&before.snapshot.stars, &after.snapshot.stars));
    // The thread of the headset receives the change too.
    until(|| headset.last_content().snapshot.revision == 8).await;
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn streams_of_all_views_share_the_limit() {
    let (headset, options) = visor("visor");
    let change = |serve: &mut steradian::service::ServeOptions| {
        serve.headset = Some(options);
        serve.limits.subscribers = 2;
    };
    let daemon = Daemon::start_with(small_rig(), change).await;
    until(|| headset.last_shown.lock().unwrap().is_some()).await;
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let mut visor = client.stream_frames("visor", Encoding::Png, 0.0).await.unwrap();
    let _flat = client.stream_frames("flat", Encoding::Png, 0.0).await.unwrap();
    for view in ["visor", "flat"] {
        let error = client.stream_frames(view, Encoding::Png, 0.0).await.unwrap_err();
        assert_eq!(error.code(), Some(Code::ResourceExhausted), "{error}");
        assert!(error.to_string().contains("2 streams"), "{error}");
    }
    next(&mut visor).await;
    drop(visor);
    // The daemon detects the dropped stream a little later.
    within(async {
        while let Err(error) = client.stream_frames("flat", Encoding::Png, 0.0).await {
            assert_eq!(error.code(), Some(Code::ResourceExhausted), "{error}");
        }
    })
    .await;
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn used_and_invalid_names_are_refused_at_the_start() {
    for (name, problem) in [("eyes", "`eyes` is used twice"), ("a b", "letters, digits")] {
        let (_, options) = visor(name);
        let engine = Box::new(crate::daemon::TestEngine::new(Arc::default()));
        let scene = steradian::scene::SceneSnapshot {
            revision: 0,
            stars: Arc::default(),
            objects: Arc::default(),
            camera: Default::default(),
        };
        let never = |address| panic!("ready on {address}");
        let mut serve =
            steradian::service::ServeOptions::new("127.0.0.1:0", engine, scene, small_rig(), Default::default(), never);
        serve.headset = Some(options);
        let error = within(steradian::service::run(serve)).await.unwrap_err();
        assert!(matches!(error, ServeError::Headset(_)) && error.to_string().contains(problem), "{error}");
    }
}
