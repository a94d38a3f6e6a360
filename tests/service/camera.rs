//! Moving the camera: revisions, leases and invalid poses.

use std::time::{Duration, SystemTime};

use glam::DVec3;
use steradian::{
    output::Encoding,
    plan::settings::StarMethod,
    scene::bodies::{Body, SolarBody},
    service::{BodyForm, CameraUpdate, Change, ClientError, Lease, SceneUpdate},
};
use tokio::time::sleep;
use tonic::Code;

use crate::daemon::{Daemon, small_rig, within};

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

#[track_caller]
fn refused<T: std::fmt::Debug>(answer: Result<T, ClientError>, code: Code, part: &str) {
    match answer {
        Err(error) => assert!(error.code() == Some(code) && error.to_string().contains(part), "{error}"),
        Ok(answer) => panic!("{answer:?}"),
    }
}

#[tokio::test]
async fn a_pose_for_another_revision_is_refused() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    assert_eq!(client.move_camera(&at_x(1.0), 0).await.unwrap().revision, 1);
    refused(client.move_camera(&at_x(2.0), 0).await, Code::Aborted, "revision 1, not 0");
    assert_eq!(client.camera().await.unwrap().position_m.x, 1.0);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn watchers_receive_every_camera_they_wait_for() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut cameras = client.watch_camera().await.unwrap();
    for revision in 0..5 {
        assert_eq!(within(cameras.next()).await.unwrap().expect("a camera").revision, revision);
        client.set_camera(&at_x(revision as f64)).await.unwrap();
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_lease_holder_has_exclusive_control_until_takeover_or_release() {
    let daemon = Daemon::start(small_rig()).await;
    let [mut first, mut second] = [daemon.client().await, daemon.client().await];
    let mut steering = first.steer(Lease::Take, "first desk").await.unwrap();
    for step in 1..=100 {
        assert!(steering.send(&at_x(f64::from(step))).await);
    }
    let mut cameras = second.watch_camera().await.unwrap();
    while within(cameras.next()).await.unwrap().expect("a camera").revision < 100 {}
    refused(second.set_camera(&at_x(-1.0)).await, Code::FailedPrecondition, "`first desk` holds the lease");
    assert_eq!(second.camera_holder().await.unwrap(), "first desk");
    let other = second.steer(Lease::Take, "second desk").await.unwrap();
    refused(within(other.end()).await, Code::FailedPrecondition, "`first desk` holds the lease");

    let mut taker = second.steer(Lease::TakeOver, "second desk").await.unwrap();
    assert!(taker.send(&at_x(-5.0)).await);
    while within(cameras.next()).await.unwrap().expect("a camera").position_m.x != -5.0 {}
    while steering.send(&at_x(7.0)).await {
        sleep(Duration::from_millis(5)).await;
    }
    refused(within(steering.end()).await, Code::FailedPrecondition, "`second desk` has taken over the lease");
    assert_eq!(first.camera_holder().await.unwrap(), "second desk");
    let (camera, poses) = within(taker.end()).await.unwrap();
    assert_eq!((camera.position_m.x, poses), (-5.0, 1));
    // The lease is released however the call ends.
    assert_eq!(first.set_camera(&at_x(9.0)).await.unwrap().position_m.x, 9.0);
    drop(first.steer(Lease::Take, "gone").await.unwrap());
    within(async {
        while second.set_camera(&at_x(1.0)).await.is_err() {
            sleep(Duration::from_millis(5)).await;
        }
    })
    .await;
    refused(within(second.steer(Lease::Take, &"x".repeat(65)).await.unwrap().end()).await, Code::InvalidArgument, "64");
    daemon.shutdown().await.unwrap();
}

/// Other clients and the log show the names of lease holders, so a name must not begin a new line or change how a line
/// is displayed.
#[tokio::test]
async fn holders_have_no_hidden_characters() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    for (holder, code) in [
        ("a\nb INFO steradian::changes: forged", "U+000A"),
        ("a\0", "U+0000"),
        ("\u{1b}[31mred", "U+001B"),
        ("desk \u{202e}ksed", "U+202E"),
        ("de\u{200b}sk", "U+200B"),
        ("desk\u{2028}desk", "U+2028"),
    ] {
        let problem = format!("holder: must be without control and format characters, contains {code}");
        let steering = client.steer(Lease::Take, holder).await.unwrap();
        refused(within(steering.end()).await, Code::InvalidArgument, &problem);
        assert_eq!(client.camera_holder().await.unwrap(), "");
    }
    for holder in ["Pult № 2", "操作台"] {
        let mut steering = client.steer(Lease::Take, holder).await.unwrap();
        assert!(steering.send(&at_x(1.0)).await);
        within(async { while client.camera_holder().await.unwrap() != holder {} }).await;
        within(steering.end()).await.unwrap();
    }
    daemon.shutdown().await.unwrap();
}

/// A change that would make frames impossible is refused, whichever part changes.
#[tokio::test]
async fn incompatible_settings_are_refused() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let fast = CameraUpdate { velocity_c: Some([0.1, 0.0, 0.0]), ..CameraUpdate::default() };
    let rest = CameraUpdate { velocity_c: Some([0.0; 3]), ..CameraUpdate::default() };
    let published = SceneUpdate { star_method: Some(StarMethod::PackedCas), ..SceneUpdate::default() };
    let auto = SceneUpdate { star_method: Some(StarMethod::Auto), ..SceneUpdate::default() };
    let mars = BodyForm::from(Body::preset(SolarBody::Mars, "mars", DVec3::X * 2e11));
    let body = SceneUpdate { bodies: Change::All(vec![mars]), ..SceneUpdate::default() };

    client.update_scene(&published, None).await.unwrap();
    refused(client.set_camera(&fast).await, Code::InvalidArgument, "camera at rest");
    refused(client.update_scene(&body, None).await, Code::InvalidArgument, "packed_cas");
    client.update_scene(&auto, None).await.unwrap();
    client.set_camera(&fast).await.unwrap();
    refused(client.update_scene(&published, None).await, Code::InvalidArgument, "camera at rest");
    refused(client.update_scene(&body, None).await, Code::InvalidArgument, "camera at rest");
    client.set_camera(&rest).await.unwrap();
    client.update_scene(&body, None).await.unwrap();
    refused(client.set_camera(&fast).await, Code::InvalidArgument, "camera at rest");
    let mut stream = client.steer(Lease::None, "").await.unwrap();
    stream.send(&fast).await;
    refused(within(stream.end()).await, Code::InvalidArgument, "camera at rest");
    within(client.render_frame("flat", Encoding::Png)).await.unwrap();
    daemon.shutdown().await.unwrap();
}

/// A client sends poses at 20 Hz, each 0.2 s ahead. Frames show the camera between the poses, and watchers receive its
/// final position.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_show_the_camera_at_their_finish_time_along_timed_poses() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut frames = daemon.client().await.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut steering = client.steer(Lease::Take, "desk").await.unwrap();
    let start = SystemTime::now() + Duration::from_millis(200);
    let steers = tokio::spawn(async move {
        // One metre per second.
        for step in 0..=20_u32 {
            let x = 0.05 * f64::from(step);
            assert!(steering.send_for(&at_x(x), start + Duration::from_secs_f64(x)).await);
            sleep(Duration::from_millis(45)).await;
        }
        steering
    });
    let (mut between, mut worst) = (0, 0.0_f64);
    loop {
        let frame = within(frames.next()).await.unwrap().expect("a frame");
        let x = frame.camera.position_m.x;
        if x == 1.0 {
            break;
        }
        if x > 0.0 {
            between += usize::from((x / 0.05 - (x / 0.05).round()).abs() > 1e-6);
            // The test engine draws without delay, so the frame shows the camera at its finish time.
            let there = frame.render_time.duration_since(start).unwrap_or_default().as_secs_f64();
            worst = worst.max((there - x).abs());
        }
    }
    println!("{between} frames between poses, largest error {:.1} ms", 1e3 * worst);
    assert!(between > 20, "{between}");
    let steering = steers.await.unwrap();
    let (camera, poses) = within(steering.end()).await.unwrap();
    assert_eq!((camera.position_m.x, poses), (1.0, 21));

    // Invalid times, and a pose without a time, end the path.
    let ahead = SystemTime::now() + Duration::from_secs(60);
    for (times, part) in
        [(vec![ahead], "at most 10 s ahead"), (vec![start, start], "later than that of the previous pose")]
    {
        let mut steering = client.steer(Lease::Take, "desk").await.unwrap();
        for time in times {
            steering.send_for(&at_x(3.0), time).await;
        }
        refused(within(steering.end()).await, Code::InvalidArgument, part);
    }
    let mut steering = client.steer(Lease::Take, "desk").await.unwrap();
    assert!(steering.send_for(&at_x(9.0), SystemTime::now() + Duration::from_secs(5)).await);
    assert!(steering.send(&at_x(2.0)).await);
    assert_eq!(within(steering.end()).await.unwrap().0.position_m.x, 2.0);
    daemon.shutdown().await.unwrap();
}

/// The lease holder sends a thousand poses per second. All are accepted, and frames show the newest.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_thousand_poses_per_second_are_accepted() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut frames = daemon.client().await.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut steering = client.steer(Lease::Take, "desk").await.unwrap();
    let begun = std::time::Instant::now();
    let mut every = tokio::time::interval(Duration::from_millis(1));
    for step in 1..=1000_u32 {
        every.tick().await;
        assert!(steering.send(&at_x(f64::from(step))).await);
    }
    let (camera, poses) = within(steering.end()).await.unwrap();
    println!("1000 poses in {:.2} s", begun.elapsed().as_secs_f64());
    assert_eq!((camera.position_m.x, poses), (1000.0, 1000));
    let mut last = 0.0;
    while last < 1000.0 {
        let x = within(frames.next()).await.unwrap().expect("a frame").camera.position_m.x;
        assert!(x >= last);
        last = x;
    }
    daemon.shutdown().await.unwrap();
}
