//! H.264 frames: every reader can decode its frames, regardless of when it starts and how slow it is.

use std::{sync::atomic::Ordering::SeqCst, time::Duration};

use rusty_h264_decoder::Decoder;
use steradian::{
    output::Encoding,
    service::{CameraUpdate, ReceivedFrame},
};
use tokio::{task::JoinSet, time::sleep};

use crate::daemon::{Daemon, small_rig, within};

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

/// Decodes the pictures of one view, and checks that they match their frames.
#[derive(Default)]
struct Viewer {
    decoders: Vec<Decoder>,
    video: u64,
    keys: usize,
    pictures: usize,
}

impl Viewer {
    fn show(&mut self, frame: &ReceivedFrame) {
        self.decoders.resize_with(frame.images.len(), Decoder::new);
        assert_ne!(frame.video, 0);
        for (decoder, image) in self.decoders.iter_mut().zip(&frame.images) {
            assert_eq!(image.encoding, Encoding::H264);
            assert!(
                image.key_frame || frame.video == self.video,
                "the first picture of a sequence must be a key picture"
            );
            let picture = decoder.decode(&image.data).unwrap().expect("a picture for each access unit");
            let size = [image.width, image.height].map(|side| side.next_multiple_of(2) as usize);
            assert_eq!([picture.width, picture.height], size);
            // The test engine's red value is the revision of the camera.
            let mean = |plane: &[u8]| plane.iter().map(|code| f64::from(*code)).sum::<f64>() / plane.len() as f64;
            let red = mean(&picture.y) + 1.5748 * (mean(&picture.v) - 128.0);
            let expected = f64::from(frame.camera_revision as u8);
            assert!((red - expected).abs() < 4.0, "red {red:.1} for revision {expected}");
        }
        self.keys += usize::from(frame.images[0].key_frame);
        self.video = frame.video;
        self.pictures += 1;
    }
}

/// Number of camera poses, and the revision of the last.
const MOVES: u64 = 200;

#[tokio::test]
async fn quick_slow_and_late_readers_can_decode_streams_from_their_first_frame() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut readers = JoinSet::new();
    for (reader, wait_ms) in [0, 0, 0, 40, 90].into_iter().enumerate() {
        let mut client = daemon.client().await;
        readers.spawn(async move {
            // Half of the readers start later.
            sleep(Duration::from_millis(60 * (reader as u64 % 2))).await;
            let mut frames = client.stream_frames("eyes", Encoding::H264, 0.0).await.unwrap();
            let mut viewer = Viewer::default();
            loop {
                let frame = within(frames.next()).await.unwrap().expect("a frame");
                viewer.show(&frame);
                if frame.camera_revision == MOVES {
                    break;
                }
                sleep(Duration::from_millis(wait_ms)).await;
            }
            (wait_ms, viewer)
        });
    }
    for step in 0..MOVES {
        client.set_camera(&at_x(step as f64)).await.unwrap();
        sleep(Duration::from_millis(5)).await;
    }
    while let Some(ended) = readers.join_next().await {
        let (wait_ms, viewer) = ended.unwrap();
        assert!(viewer.pictures > 5, "{wait_ms} ms: {} pictures", viewer.pictures);
        println!("{wait_ms} ms: {} pictures, {} key pictures", viewer.pictures, viewer.keys);
        assert!(wait_ms > 0 || 4 * viewer.keys < viewer.pictures, "{wait_ms} ms: {} {}", viewer.pictures, viewer.keys);
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn requested_frames_continue_the_named_picture_or_are_key_pictures() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut viewer = Viewer::default();
    let mut last = within(client.next_frame("flat", Encoding::H264, 0, 0)).await.unwrap();
    viewer.show(&last);
    for step in 0..20 {
        client.set_camera(&at_x(f64::from(step))).await.unwrap();
        last = within(client.next_frame("flat", Encoding::H264, &last, 0)).await.unwrap();
        viewer.show(&last);
        let wanted = [("flat", Encoding::H264, &last)];
        client.set_camera(&at_x(-f64::from(step))).await.unwrap();
        last = within(client.next_frames(&wanted)).await.unwrap().remove(0);
        viewer.show(&last);
    }
    assert_eq!((viewer.pictures, viewer.keys), (41, 1));
    // A frame number alone does not identify the sequence, so the second reader gets a key picture. This does not
    // disturb the first reader.
    let mut other = daemon.client().await;
    let alone = within(other.next_frame("flat", Encoding::H264, last.number, 0)).await.unwrap();
    assert!(alone.images[0].key_frame);
    Viewer::default().show(&alone);
    client.set_camera(&at_x(1.0)).await.unwrap();
    viewer.show(&within(client.next_frame("flat", Encoding::H264, &last, 0)).await.unwrap());
    assert_eq!(viewer.keys, 1);
    // A single frame is always a key picture.
    for _ in 0..2 {
        let frame = client.render_frame("flat", Encoding::H264).await.unwrap();
        assert!(frame.images[0].key_frame && frame.video == 0);
        assert!(Decoder::new().decode(&frame.images[0].data).unwrap().is_some());
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_picture_is_encoded_once_for_all_streams() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut streams = Vec::new();
    for _ in 0..6 {
        streams.push(daemon.client().await.stream_frames("flat", Encoding::H264, 0.0).await.unwrap());
    }
    let mut viewers: Vec<Viewer> = streams.iter().map(|_| Viewer::default()).collect();
    let mut next = async |expected: Option<u64>| {
        for (stream, viewer) in streams.iter_mut().zip(&mut viewers) {
            loop {
                let frame = within(stream.next()).await.unwrap().unwrap();
                viewer.show(&frame);
                if expected.is_none_or(|revision| frame.camera_revision == revision) {
                    break;
                }
            }
        }
    };
    next(None).await;
    let mut figures = client.clone();
    let mut encoded_count = async || {
        let mut stream = figures.watch_stats(None).await.unwrap();
        within(stream.next()).await.unwrap().expect("figures").encoded
    };
    let before = (encoded_count().await, daemon.controls.started.load(SeqCst));
    for step in 0..30 {
        let camera = client.set_camera(&at_x(f64::from(step))).await.unwrap();
        next(Some(camera.revision)).await;
    }
    let after = (encoded_count().await, daemon.controls.started.load(SeqCst));
    let (encodings, frames) = (after.0 - before.0, after.1 - before.1);
    println!("{encodings} encodings for {frames} frames and 6 readers");
    // Readers that started at different times join the same sequence by a few key pictures.
    assert!(encodings >= 30 && encodings < 2 * frames, "{encodings} {frames}");
    daemon.shutdown().await.unwrap();
}
