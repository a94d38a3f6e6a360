//! Tests quality levels, with frame times that the test engine reports, and audits of frames.

use std::time::Duration;

use steradian::{
    output::Encoding,
    plan::settings::{GlareSettings, RenderSettings},
    service::{CameraUpdate, Client, FrameReceiver, ReceivedFrame, ServeOptions, StatsReceiver, proto::Stats},
};

use crate::daemon::{Daemon, small_rig, within};

/// Turns the camera by a step and reads the frame that shows it.
async fn step(client: &mut Client, stream: &mut FrameReceiver, number: u32) -> ReceivedFrame {
    let update = CameraUpdate { position_m: Some([f64::from(number), 0.0, 0.0]), ..CameraUpdate::default() };
    let revision = client.set_camera(&update).await.unwrap().revision;
    loop {
        let frame = within(stream.next()).await.unwrap().expect("the stream goes on");
        if frame.camera_revision >= revision {
            return frame;
        }
    }
}

async fn stats(stats: &mut StatsReceiver, until: impl Fn(&Stats) -> bool) -> Stats {
    loop {
        let received = within(stats.next()).await.unwrap().expect("figures go on");
        if until(&received) {
            return received;
        }
    }
}

fn slow_unless_coarse(settings: &RenderSettings) -> f64 {
    if settings.accuracy.display_codes >= 2.0 { 15.0 } else { 40.0 }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn slow_frames_reduce_quality_report_it_and_restore_it() {
    let daemon = Daemon::start_with(small_rig(), |options| options.views.settings.accuracy.frame_ms = Some(20.0)).await;
    *daemon.controls.took_ms.lock().unwrap() = Some(slow_unless_coarse);
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut levels = Vec::new();
    for number in 1..=150 {
        let frame = step(&mut client, &mut stream, number).await;
        assert_eq!(frame.given_up.is_empty(), frame.quality_level == 0);
        levels.push(frame.quality_level);
        if frame.quality_level == 2 {
            assert_eq!(frame.given_up, ["display_codes 2 instead of 0.5"]);
        }
    }
    assert!(levels.is_sorted() && levels[0] == 0 && levels[149] == 2, "{levels:?}");
    // The frame was drawn at this level.
    let drawn = daemon.controls.framed.lock().unwrap().last().map(|(_, settings)| settings.accuracy.display_codes);
    assert_eq!(drawn, Some(2.0));
    let mut figures = client.watch_stats(Some(0.1)).await.unwrap();
    let quality = stats(&mut figures, |stats| stats.quality.is_some()).await.quality.unwrap();
    assert_eq!((quality.frame_ms, quality.level, quality.smoothed_ms), (20.0, 2, Some(15.0)));
    // HDR images have full quality, and their frame times are ignored.
    let exact = client.render_frame("flat", Encoding::Rgb32f).await.unwrap();
    assert_eq!((exact.quality_level, exact.given_up.len()), (0, 0));
    let drawn = daemon.controls.framed.lock().unwrap().last().map(|(_, settings)| settings.accuracy.display_codes);
    assert_eq!(drawn, Some(0.5));
    *daemon.controls.took_ms.lock().unwrap() = Some(|_| 2.0);
    let mut last = 2;
    for number in 151..=500 {
        last = step(&mut client, &mut stream, number).await.quality_level;
        if last == 0 {
            break;
        }
    }
    assert_eq!(last, 0, "full quality is restored");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn without_a_frame_time_quality_stays() {
    let daemon = Daemon::start(small_rig()).await;
    *daemon.controls.took_ms.lock().unwrap() = Some(|_| 1e4);
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    for number in 1..=60 {
        assert_eq!(step(&mut client, &mut stream, number).await.quality_level, 0);
    }
    let mut figures = client.watch_stats(None).await.unwrap();
    let received = stats(&mut figures, |_| true).await;
    assert_eq!((received.quality, received.audit), (None, None));
    daemon.shutdown().await.unwrap();
}

/// The test engine draws images that do not match the scene.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn audits_detect_wrong_images() {
    // The pixels of the small rig are too coarse for the CPU reference of glare.
    let of_stars = |options: &mut ServeOptions| {
        options.views.settings.accuracy.audit = true;
        options.views.settings.glare = GlareSettings::none();
    };
    let daemon = Daemon::start_with(small_rig(), of_stars).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    for number in 1..=20 {
        step(&mut client, &mut stream, number).await;
    }
    let mut figures = client.watch_stats(Some(0.1)).await.unwrap();
    let audited = |stats: &Stats| stats.audit.as_ref().is_some_and(|audit| audit.frames_audited > 0);
    let audit =
        tokio::time::timeout(Duration::from_secs(60), stats(&mut figures, audited)).await.unwrap().audit.unwrap();
    assert!(audit.frames_broken > 0 && audit.frames_audited < 20, "{audit:?}");
    assert!(audit.images.iter().any(|image| image.view == "flat" && !image.within_budget && image.pixels > 0));
    assert!(audit.not_audited.is_empty());
    daemon.shutdown().await.unwrap();
}
