//! Frames on request, acknowledged frames, reduced images, and shared encodings.

use std::{collections::BTreeSet, sync::atomic::Ordering::SeqCst, time::Duration};

use steradian::{output::Encoding, service::CameraUpdate};
use tokio::{task::JoinSet, time::sleep};
use tonic::Code;

use crate::daemon::{Daemon, large_rig, small_rig, until, within};

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

#[tokio::test]
async fn the_next_frame_arrives_when_the_image_has_changed() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let first = within(client.next_frame("flat", Encoding::Rgba8, 0, 0)).await.unwrap();
    assert_eq!((first.camera.revision, first.camera.position_m.x), (0, 0.0));
    let mut other = daemon.client().await;
    let waits = tokio::spawn(async move { other.next_frame("flat", Encoding::Rgba8, first.number, 0).await });
    let moved = client.set_camera(&at_x(3.0)).await.unwrap();
    let second = within(waits).await.unwrap().unwrap();
    // The answer has the new image. If the pose arrived late, it has the old image, as a heartbeat.
    assert!(second.number > first.number);
    let third = within(client.next_frame("flat", Encoding::Rgba8, second.number, 0)).await.unwrap();
    assert_eq!((third.camera.revision, third.camera.position_m.x), (moved.revision, 3.0));
    // Without a change, the same image arrives again after a while.
    let fourth = within(client.next_frame("flat", Encoding::Rgba8, third.number, 0)).await.unwrap();
    assert!(fourth.number > third.number && fourth.camera.revision == third.camera.revision);
    // An unknown number, such as one from an earlier daemon, is treated as no number.
    within(client.next_frame("flat", Encoding::Rgba8, 1_000_000, 0)).await.unwrap();
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn several_views_come_in_one_answer() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut seen = [0, 0];
    let mut views = BTreeSet::new();
    for step in 1..=10 {
        client.set_camera(&at_x(f64::from(step))).await.unwrap();
        let wanted = [("flat", Encoding::Rgba8, seen[0]), ("eyes", Encoding::Png, seen[1])];
        for frame in within(client.next_frames(&wanted)).await.unwrap() {
            let number = usize::from(frame.view == "eyes");
            assert!(frame.number > seen[number] || seen[number] == 0, "{} {}", frame.view, frame.number);
            assert_eq!(frame.images.len(), [1, 2][number]);
            seen[number] = frame.number;
            views.insert(frame.view);
        }
    }
    assert_eq!(views.len(), 2);
    for (wanted, code) in [
        (vec![], Code::InvalidArgument),
        (vec![("flat", Encoding::Png, 0); 2], Code::InvalidArgument),
        (vec![("flat", Encoding::Png, 0); 17], Code::InvalidArgument),
        (vec![("flat", Encoding::Png, 0), ("none", Encoding::Png, 0)], Code::NotFound),
    ] {
        assert_eq!(client.next_frames(&wanted).await.unwrap_err().code(), Some(code), "{wanted:?}");
    }
    daemon.shutdown().await.unwrap();
}

/// At most two frames are in transit, regardless of the buffers of the connection, so a client that pauses then reads
/// new frames.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reader_that_pauses_gets_no_outdated_image() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Png, 0.0).await.unwrap();
    within(stream.next()).await.unwrap().expect("a frame");
    for step in 1..=50 {
        let drawn = daemon.controls.finished.load(SeqCst);
        client.set_camera(&at_x(f64::from(step))).await.unwrap();
        until(|| daemon.controls.finished.load(SeqCst) > drawn).await;
    }
    let mut revisions = Vec::new();
    while revisions.last() != Some(&50) {
        revisions.push(within(stream.next()).await.unwrap().expect("a frame").camera_revision);
    }
    println!("{revisions:?}");
    // There are two frames in transit, one that waited to be sent, and the newest one.
    assert!(revisions.len() <= 4, "{revisions:?}");
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_encoding_serves_all_equal_requests() {
    let daemon = Daemon::start(large_rig()).await;
    let mut client = daemon.client().await;
    daemon.controls.close_gate();
    let mut calls = JoinSet::new();
    for _ in 0..8 {
        let mut other = daemon.client().await;
        calls.spawn(async move { other.next_frame("large", Encoding::Png, 0, 0).await });
    }
    sleep(Duration::from_millis(300)).await;
    daemon.controls.open_gate();
    let mut numbers = BTreeSet::new();
    while let Some(frame) = within(calls.join_next()).await {
        numbers.insert(frame.unwrap().unwrap().number);
    }
    let mut figures = client.watch_stats(None).await.unwrap();
    let statistics = within(figures.next()).await.unwrap().expect("figures");
    println!("{} frames, {} encodings", numbers.len(), statistics.encoded);
    // One or two frames answer all calls, depending on when the calls arrive.
    assert!(statistics.encoded <= numbers.len() as u64 && numbers.len() <= 2, "{numbers:?} {}", statistics.encoded);
    assert!(statistics.connections >= 1);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn only_display_images_can_be_reduced() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let whole = within(client.next_frame("flat", Encoding::Rgba8, 0, 0)).await.unwrap();
    let small = within(client.next_frame("flat", Encoding::Rgba8, 0, 16)).await.unwrap();
    let [from, to] = [&whole, &small].map(|frame| [frame.images[0].width, frame.images[0].height]);
    let factor = from[0].max(from[1]).div_ceil(16);
    assert_eq!(to, from.map(|side| side.div_ceil(factor)));
    assert_eq!(small.images[0].data.len() as u32, 4 * to[0] * to[1]);
    for (encoding, max_size, part) in
        [(Encoding::Exr, 64, "EXR"), (Encoding::Rgb32f, 64, "RGB32F"), (Encoding::Png, 7, "between 16 and 16384")]
    {
        let error = client.next_frame("flat", encoding, 0, max_size).await.unwrap_err();
        assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains(part), "{error}");
    }
    daemon.shutdown().await.unwrap();
}
