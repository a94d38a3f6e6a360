//! Streams of frames.

use std::{
    sync::atomic::Ordering::SeqCst,
    time::{Duration, Instant},
};

use steradian::{
    output::Encoding,
    service::{CameraUpdate, FrameReceiver, ReceivedFrame},
};

use crate::daemon::{Daemon, adapting, large_rig, small_rig, until, within};

async fn next(stream: &mut FrameReceiver) -> ReceivedFrame {
    within(stream.next()).await.unwrap().expect("the stream goes on")
}

/// Reads frames until one shows this revision of the camera; returns all frames read.
async fn read_to(stream: &mut FrameReceiver, camera_revision: u64) -> Vec<ReceivedFrame> {
    let mut frames = vec![next(stream).await];
    while frames.last().unwrap().camera_revision < camera_revision {
        frames.push(next(stream).await);
    }
    frames
}

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

#[tokio::test]
async fn the_subscriber_receives_every_pose_it_waits_for() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("eyes", Encoding::Rgba8, 0.0).await.unwrap();
    assert_eq!(next(&mut stream).await.camera_revision, 0, "the first frame comes without a change");
    let mut number = 0;
    for step in 1..=20 {
        let camera = client.set_camera(&at_x(f64::from(step))).await.unwrap();
        let frame = read_to(&mut stream, camera.revision).await.pop().unwrap();
        assert_eq!((frame.camera_revision, frame.images.len()), (camera.revision, 2));
        assert!(frame.number > number);
        number = frame.number;
        assert_eq!(frame.images[0].data[0], camera.revision as u8, "the picture is of that pose");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_slow_reader_gets_the_newest_frame_and_the_number_of_missed_ones() {
    let daemon = Daemon::start(large_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("large", Encoding::Rgba8, 0.0).await.unwrap();
    // The renderer draws every pose although the stream is not read.
    for step in 1..=20_u32 {
        let drawn = daemon.controls.finished.load(SeqCst);
        client.set_camera(&at_x(f64::from(step))).await.unwrap();
        until(|| daemon.controls.finished.load(SeqCst) > drawn).await;
    }
    let frames = read_to(&mut stream, 20).await;
    let last = frames.last().unwrap();
    println!("{} frames read, {} dropped", frames.len(), last.dropped);
    assert_eq!(last.camera_revision, 20);
    assert!(last.dropped > 0);
    assert!(frames.is_sorted_by(|a, b| a.number < b.number && a.dropped <= b.dropped));
    // Every frame up to the last one was either read or counted as dropped.
    assert_eq!(frames.len() as u64 + last.dropped, last.number + 1);
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_slow_subscriber_keeps_its_rate_and_does_not_slow_a_fast_one() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let begin = Instant::now();
    let mut slow = client.stream_frames("flat", Encoding::Png, 2.0).await.unwrap();
    let mut fast = client.stream_frames("eyes", Encoding::Png, 0.0).await.unwrap();
    assert_eq!(next(&mut slow).await.camera_revision, 0);
    let slow = tokio::spawn(async move {
        let mut frames = 1_u32;
        let last = loop {
            let frame = next(&mut slow).await;
            frames += 1;
            if frame.camera_revision == 40 {
                break frame;
            }
        };
        (frames, last.dropped)
    });
    for step in 1..=40_u32 {
        let camera = client.set_camera(&at_x(f64::from(step))).await.unwrap();
        assert_eq!(read_to(&mut fast, camera.revision).await.pop().unwrap().camera_revision, camera.revision);
    }
    let (frames, dropped) = within(slow).await.unwrap();
    // The clock starts before the first frame, so the count is at most two frames per second on any machine.
    assert!(frames <= 1 + (begin.elapsed().as_secs_f64() * 2.0) as u32, "{frames} frames");
    assert_eq!(dropped, 0, "frames in excess of the rate must not count as dropped");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_quiet_scene_has_a_heartbeat() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let first = next(&mut stream).await;
    let second = next(&mut stream).await;
    assert_eq!((first.camera_revision, second.camera_revision), (0, 0));
    assert_eq!(daemon.controls.started.load(SeqCst), 2, "no frame in between");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn frames_continue_until_the_exposure_has_adapted() {
    let daemon = Daemon::start_with(small_rig(), |options| options.views.settings.exposure = adapting(0.05)).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    assert_eq!(next(&mut stream).await.exposure_ev100, 0.0, "the first frame is fully adapted");
    *daemon.controls.metered_ev100.lock().unwrap() = 8.0;
    client.set_camera(&at_x(1.0)).await.unwrap();
    let mut exposures = vec![0.0];
    while 8.0 - exposures[exposures.len() - 1] > 0.01 {
        exposures.push(next(&mut stream).await.exposure_ev100);
    }
    assert!(exposures.is_sorted(), "{exposures:?}");
    // A single frame has the exposure of the stream.
    let single = client.render_frame("eyes", Encoding::Rgba8).await.unwrap();
    assert!((8.0 - single.exposure_ev100) <= 0.01);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn dropping_a_stream_stops_its_rendering() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    next(&mut stream).await;
    drop(stream);
    // The daemon detects the dropped stream when the reset arrives. From then on, nothing is drawn.
    within(async {
        loop {
            let drawn = daemon.controls.started.load(SeqCst);
            client.set_camera(&at_x(1.0)).await.unwrap();
            tokio::time::sleep(Duration::from_millis(20)).await;
            if daemon.controls.started.load(SeqCst) == drawn {
                break;
            }
        }
    })
    .await;
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn streams_beyond_the_limit_are_refused_until_one_ends() {
    let daemon = Daemon::start_with(small_rig(), |options| options.limits.subscribers = 2).await;
    let mut client = daemon.client().await;
    let mut first = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let second = client.stream_frames("eyes", Encoding::Rgba8, 0.0).await.unwrap();
    let error = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap_err();
    assert_eq!(error.code(), Some(tonic::Code::ResourceExhausted));
    assert!(error.to_string().contains("2 streams"), "{error}");
    next(&mut first).await;
    drop(second);
    // The daemon detects the dropped stream a little later.
    let mut third = within(async {
        loop {
            match client.stream_frames("flat", Encoding::Rgba8, 0.0).await {
                Ok(stream) => break stream,
                Err(error) => assert_eq!(error.code(), Some(tonic::Code::ResourceExhausted), "{error}"),
            }
        }
    })
    .await;
    next(&mut third).await;
    daemon.shutdown().await.unwrap();
}
