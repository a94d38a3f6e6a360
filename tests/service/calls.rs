//! Calls with one answer.

use std::{
    io::Cursor,
    sync::{Arc, atomic::Ordering::SeqCst},
    time::Duration,
};

use glam::{DQuat, DVec3};
use steradian::{
    output::{Encoding, encode},
    render::FrameImage,
    scene::Camera,
    service::{CameraUpdate, Client, ClientError, Engine, ReceivedFrame, SceneUpdate},
    view::Part,
};
use tonic::Code;

use crate::daemon::{Daemon, TestEngine, adapting, display_pixel, hdr_pixel, small_rig, within};
use crate::exr_file;

const ENCODINGS: [Encoding; 6] =
    [Encoding::Rgba8, Encoding::Png, Encoding::Jpeg, Encoding::H264, Encoding::Rgb32f, Encoding::Exr];

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

#[tokio::test]
async fn the_camera_keeps_values_that_an_update_omits() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    assert_eq!(client.camera().await.unwrap(), Camera::default());
    let moved = client.set_camera(&at_x(1.5e11)).await.unwrap();
    assert_eq!((moved.position_m, moved.revision), (DVec3::new(1.5e11, 0.0, 0.0), 1));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turn = CameraUpdate { orientation: Some([0.0, half, 0.0, half]), ..CameraUpdate::default() };
    let turned = client.set_camera(&turn).await.unwrap();
    assert_eq!((turned.position_m, turned.revision), (moved.position_m, 2));
    assert!(turned.world_from_camera.angle_between(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)) < 1e-7);
    let flying = CameraUpdate { velocity_c: Some([0.0, -0.9, 0.1]), ..CameraUpdate::default() };
    let flying = client.set_camera(&flying).await.unwrap();
    assert_eq!((flying.velocity_c, flying.position_m), (DVec3::new(0.0, -0.9, 0.1), moved.position_m));
    assert_eq!(client.set_camera(&at_x(2.0)).await.unwrap().velocity_c, flying.velocity_c);
    let halted = CameraUpdate { velocity_c: Some([0.0; 3]), ..CameraUpdate::default() };
    let halted = client.set_camera(&halted).await.unwrap();
    assert_eq!((halted.velocity_c, halted.world_from_camera), (DVec3::ZERO, turned.world_from_camera));
    assert_eq!(client.camera().await.unwrap(), halted);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn invalid_poses_are_refused_with_the_reason() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let old = client.set_camera(&at_x(3.0)).await.unwrap();
    let update = CameraUpdate::default;
    let cases = [
        (at_x(f64::NAN), "finite"),
        (CameraUpdate { orientation: Some([0.0, 0.0, 0.0, 1.1]), ..update() }, "unit quaternion"),
        (CameraUpdate { orientation: Some([0.0, f64::INFINITY, 0.0, 1.0]), ..update() }, "orientation"),
        (CameraUpdate { velocity_c: Some([0.0, 0.0, 1.0]), ..at_x(9.0) }, "speed of light"),
        (CameraUpdate { velocity_c: Some([0.0, 0.99995, 0.0]), ..at_x(9.0) }, "between 0 and 0.9999"),
    ];
    for (bad, reason) in cases {
        match client.set_camera(&bad).await {
            Err(ClientError::Status { code: Code::InvalidArgument, message }) => {
                assert!(message.contains(reason), "{message}");
            }
            other => panic!("{bad:?} gave {other:?}"),
        }
        assert_eq!(client.camera().await.unwrap(), old);
    }
    let nearly = CameraUpdate { orientation: Some([0.0, 0.0, 0.0, 1.0009]), ..update() };
    assert_eq!(client.set_camera(&nearly).await.unwrap().world_from_camera, DQuat::IDENTITY);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn views_and_info_are_listed() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let views = client.views().await.unwrap();
    let summary: Vec<_> = views.iter().map(|view| (view.name.as_str(), view.kind.as_str())).collect();
    assert_eq!(summary, [("flat", "perspective"), ("eyes", "stereo")]);
    let images: Vec<_> = views[1].images.iter().map(|i| (i.part.as_str(), i.width, i.height)).collect();
    assert_eq!(images, [("left", 3, 2), ("right", 3, 2)]);
    assert_eq!(views[0].images[0].part, "");

    client.render_frame("flat", Encoding::Rgba8).await.unwrap();
    let info = client.info().await.unwrap();
    assert_eq!(info.version, env!("CARGO_PKG_VERSION"));
    assert_eq!(info.adapter, TestEngine::new(Arc::default()).info());
    assert_eq!((info.stars, info.scene_revision, info.frames_rendered), (0, 7, 1));
    daemon.shutdown().await.unwrap();
}

/// Returns the values that the test engine writes into an image.
fn expected(frame: &ReceivedFrame, view: usize, x_m: f64, image: usize) -> FrameImage {
    let received = &frame.images[image];
    let pixels = 0..(received.width * received.height) as usize;
    FrameImage {
        view,
        part: Part::Whole,
        width: received.width,
        height: received.height,
        display: Some(pixels.clone().flat_map(|i| display_pixel(frame.camera_revision, view, i)).collect()),
        hdr: Some(pixels.map(|i| hdr_pixel(x_m, frame.number, view, i)).collect()),
        projector: None,
    }
}

fn exr_pixels(data: &[u8]) -> Vec<[f32; 4]> {
    let channels = exr_file::channels(data, ["R", "G", "B", "omega"]);
    (0..channels[0].len()).map(|i| [0, 1, 2, 3].map(|c: usize| channels[c][i])).collect()
}

#[tokio::test]
async fn every_encoding_contains_the_rendered_values() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let before = client.render_frame("flat", Encoding::Rgba8).await.unwrap().pose_time;
    let camera = client.set_camera(&at_x(0.1)).await.unwrap();
    for (view, name) in ["flat", "eyes"].into_iter().enumerate() {
        for encoding in ENCODINGS {
            let frame = client.render_frame(name, encoding).await.unwrap();
            assert_eq!((frame.view.as_str(), frame.scene_revision, frame.dropped), (name, 7, 0));
            assert_eq!(frame.camera_revision, camera.revision);
            assert!(before < frame.pose_time && frame.pose_time <= frame.render_time);
            assert_eq!(frame.images.len(), view + 1);
            for (index, image) in frame.images.iter().enumerate() {
                assert_eq!(image.encoding, encoding);
                let expected = expected(&frame, view, 0.1, index);
                match encoding {
                    Encoding::Rgba8 => assert_eq!(Some(&image.data), expected.display.as_ref()),
                    Encoding::Png => {
                        let mut reader = png::Decoder::new(Cursor::new(&image.data)).read_info().unwrap();
                        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
                        reader.next_frame(&mut pixels).unwrap();
                        assert_eq!(Some(pixels), expected.display);
                    }
                    // JPEG and H.264 are decoded by the unit tests of the encoders.
                    Encoding::Jpeg | Encoding::H264 => assert_eq!(image.data, encode(encoding, &expected).unwrap()),
                    Encoding::Rgb32f => {
                        let floats = image.data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
                        let values = expected.hdr.unwrap().into_iter().flat_map(|[r, g, b, _]| [r, g, b]);
                        assert_eq!(floats.collect::<Vec<_>>(), values.collect::<Vec<_>>());
                    }
                    Encoding::Exr => assert_eq!(Some(exr_pixels(&image.data)), expected.hdr),
                }
            }
        }
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn unknown_views_and_rates_are_refused_with_the_valid_ones() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let unknown = [
        client.render_frame("dome", Encoding::Png).await.unwrap_err(),
        client.stream_frames("dome", Encoding::Png, 0.0).await.unwrap_err(),
    ];
    for error in unknown {
        assert_eq!(error.code(), Some(Code::NotFound));
        assert!(error.to_string().contains("`dome`") && error.to_string().contains("flat, eyes"), "{error}");
    }
    for rate in [-1.0, f64::NAN, f64::INFINITY, 1e-300, 1e9] {
        let error = client.stream_frames("flat", Encoding::Png, rate).await.unwrap_err();
        assert_eq!(error.code(), Some(Code::InvalidArgument), "{rate}: {error}");
        assert!(error.to_string().contains("max_rate_hz"), "{error}");
    }
    assert_eq!(daemon.controls.started.load(SeqCst), 0);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_failing_frame_fails_its_call_and_the_daemon_goes_on() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    within(stream.next()).await.unwrap().expect("a first frame");
    daemon.controls.failing.store(true, SeqCst);
    client.set_camera(&at_x(1.0)).await.unwrap();
    let error = within(client.render_frame("flat", Encoding::Png)).await.unwrap_err();
    assert_eq!(error.code(), Some(Code::Internal));
    assert!(error.to_string().contains("requested to fail"), "{error}");
    let mut figures = client.watch_stats(None).await.unwrap();
    let statistics = within(figures.next()).await.unwrap().expect("figures");
    assert!(statistics.frames_failed > 0 && statistics.problem.contains("requested to fail"), "{statistics:?}");
    daemon.controls.failing.store(false, SeqCst);
    // The stream has survived the failure.
    client.set_camera(&at_x(2.0)).await.unwrap();
    while within(stream.next()).await.unwrap().expect("frames continue").camera_revision < 2 {}
    let mut figures = client.watch_stats(None).await.unwrap();
    assert_eq!(within(figures.next()).await.unwrap().expect("figures").problem, "");
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_queue_refuses_at_once_and_few_frames_serve_the_other_calls() {
    let daemon = Daemon::start_with(small_rig(), |options| options.limits.pending_renders = 4).await;
    let client = daemon.client().await;
    daemon.controls.close_gate();
    let mut calls = tokio::task::JoinSet::new();
    for _ in 0..6 {
        let mut client: Client = client.clone();
        calls.spawn(async move { client.render_frame("eyes", Encoding::Png).await });
    }
    // No frame can finish yet, so the first two answers are refusals.
    for _ in 0..2 {
        let answer = within(calls.join_next()).await.unwrap().unwrap();
        assert_eq!(answer.unwrap_err().code(), Some(Code::ResourceExhausted));
    }
    daemon.controls.open_gate();
    let mut numbers = Vec::new();
    while let Some(answer) = within(calls.join_next()).await {
        numbers.push(answer.unwrap().unwrap().number);
    }
    assert_eq!(numbers.len(), 4);
    assert!(numbers.iter().max() <= Some(&3), "at most one frame per call: {numbers:?}");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn single_frames_are_fully_adapted_after_a_pause() {
    let daemon = Daemon::start_with(small_rig(), |options| options.views.settings.exposure = adapting(0.02)).await;
    let mut client = daemon.client().await;
    *daemon.controls.metered_ev100_per_m.lock().unwrap() = 1.0;
    for x in [0.0, 20.0, -7.0] {
        client.set_camera(&at_x(x)).await.unwrap();
        let frame = client.render_frame("flat", Encoding::Rgba8).await.unwrap();
        assert_eq!(frame.exposure_ev100, x, "the exposure is not that of the previous frame");
        tokio::time::sleep(Duration::from_millis(110)).await;
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_single_frame_soon_after_another_continues_adapting() {
    // With a time constant of an hour, no pause of the machine is long enough to complete the adaptation.
    let daemon = Daemon::start_with(small_rig(), |options| options.views.settings.exposure = adapting(3600.0)).await;
    let mut client = daemon.client().await;
    *daemon.controls.metered_ev100_per_m.lock().unwrap() = 1.0;
    assert_eq!(client.render_frame("flat", Encoding::Rgba8).await.unwrap().exposure_ev100, 0.0);
    client.set_camera(&at_x(20.0)).await.unwrap();
    let mut last = 0.0;
    for step in 0..4 {
        tokio::time::sleep(Duration::from_millis(2)).await;
        let ev = client.render_frame("flat", Encoding::Rgba8).await.unwrap().exposure_ev100;
        assert!(if step == 0 { ev == 0.0 } else { ev > last && ev < 1.0 }, "step {step}: {last} then {ev} EV");
        last = ev;
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn single_frames_after_a_jump_of_time_are_adapted_at_once() {
    let daemon = Daemon::start_with(small_rig(), |options| options.views.settings.exposure = adapting(3600.0)).await;
    let mut client = daemon.client().await;
    let update = |time_s: f64| SceneUpdate { time_s: Some(time_s), ..SceneUpdate::default() };
    client.update_scene(&update(1e8), None).await.unwrap();
    assert_eq!(client.render_frame("flat", Encoding::Rgba8).await.unwrap().exposure_ev100, 0.0);
    *daemon.controls.metered_ev100.lock().unwrap() = 7.0;
    // After a small step of time, the adaptation, which takes an hour, continues from the previous frame.
    for _ in 0..2 {
        client.update_scene(&update(1e8 + 30.0), None).await.unwrap();
        let ev = client.render_frame("flat", Encoding::Rgba8).await.unwrap().exposure_ev100;
        assert!(ev < 1.0, "{ev} EV");
    }
    client.update_scene(&update(1e8 + 7200.0), None).await.unwrap();
    assert_eq!(client.render_frame("flat", Encoding::Rgba8).await.unwrap().exposure_ev100, 7.0);
    daemon.shutdown().await.unwrap();
}
