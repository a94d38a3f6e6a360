//! Tests the figures and the status of the headset in `WatchStats`.

use super::*;

/// Returns statistics in which all values are different.
fn figures() -> HeadsetStatistics {
    let spread = |from: f64| Distribution { median_ms: from, p95_ms: from + 0.25, max_ms: from + 0.5 };
    HeadsetStatistics {
        sessions: 2,
        losses: 1,
        frames: 500,
        rendered: 450,
        not_wanted: 40,
        left_out: 9,
        missed: 10,
        recentred: 3,
        period_ms: 11.125,
        pose_age_at_submission: spread(4.0),
        pose_age_at_display: Some(spread(15.0)),
        stages: vec![("wait", spread(1.0)), ("locate", spread(2.0)), ("gpu", spread(3.0))],
    }
}

/// Returns the time of statistics, ns since 1970.
fn nanoseconds(stats: &proto::Stats) -> i128 {
    let time = stats.time.as_ref().unwrap();
    i128::from(time.seconds) * 1_000_000_000 + i128::from(time.nanos)
}

#[tokio::test]
async fn statistics_are_those_of_the_headset() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let mut stats = client.watch_stats(Some(0.1)).await.unwrap();
    let first = within(stats.next()).await.unwrap().unwrap();
    let first_ns = nanoseconds(&first);
    let none = first.headset.unwrap();
    assert_eq!(none.pose_age_at_display, None);
    let status = none.status.unwrap();
    assert!(!status.connected && status.retrying, "{status:?}");
    assert_eq!((status.view.as_str(), none.sessions, none.stages.len()), ("visor", 0, 0));
    assert_eq!((first.frames_rendered, first.streams, first.last_frame), (0, 0, None));

    headset.send(Order::Connect);
    headset.send(Order::Statistics(figures()));
    let _stream = client.stream_frames("visor", Encoding::Png, 0.0).await.unwrap();
    client.render_frame("flat", Encoding::Png).await.unwrap();
    let (reported, all_statistics) = within(async {
        loop {
            let all_statistics = stats.next().await.unwrap().expect("figures go on");
            match all_statistics.headset.clone() {
                Some(reported) if reported.sessions > 0 && all_statistics.frames_rendered > 0 => {
                    break (reported, all_statistics);
                }
                _ => {}
            }
        }
    })
    .await;
    let expected = figures();
    let counts =
        [reported.sessions, reported.losses, reported.frames, reported.rendered, reported.not_wanted, reported.missed];
    assert_eq!(counts, [2, 1, 500, 450, 40, 10]);
    assert_eq!((reported.left_out, reported.recentred, reported.period_ms), (9, 3, 11.125));
    let distribution = |time: Option<proto::Distribution>| {
        time.map(|time| Distribution { median_ms: time.median_ms, p95_ms: time.p95_ms, max_ms: time.max_ms })
    };
    assert_eq!(distribution(reported.pose_age_at_submission), Some(expected.pose_age_at_submission));
    assert_eq!(distribution(reported.pose_age_at_display), expected.pose_age_at_display);
    let stages: Vec<_> =
        reported.stages.iter().map(|stage| (stage.name.as_str(), distribution(stage.time).unwrap())).collect();
    assert_eq!(stages, expected.stages);
    assert!(reported.status.unwrap().connected);
    assert_eq!(
        (all_statistics.frames_rendered, all_statistics.streams),
        (1, 1),
        "frames of the headset must not count as frames of the render thread"
    );
    assert!(all_statistics.last_frame.is_some() && nanoseconds(&all_statistics) >= first_ns);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_status_change_is_reported_before_the_interval_ends() {
    let (daemon, headset) = start().await;
    let mut client = daemon.client().await;
    let mut stats = client.watch_stats(Some(60.0)).await.unwrap();
    within(stats.next()).await.unwrap().expect("the first figures");
    for (status, connected) in [(connected("ready"), true), (lost(), false)] {
        headset.host().status(status);
        let begin = Instant::now();
        let reported = within(stats.next()).await.unwrap().unwrap().headset.unwrap();
        assert_eq!(reported.status.unwrap().connected, connected);
        assert!(begin.elapsed() < Duration::from_secs(50), "the report was delayed until the end of the interval");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn dropped_frames_are_summed_and_invalid_intervals_refused() {
    let daemon = Daemon::start(large_rig()).await;
    let mut client = daemon.client().await;
    for interval_s in [0.0, 0.09, 60.1, -1.0, f64::NAN, f64::INFINITY] {
        let error = client.watch_stats(Some(interval_s)).await.unwrap_err();
        assert_eq!(error.code(), Some(Code::InvalidArgument), "{error}");
        assert!(error.to_string().contains("between 0.1 and 60"), "{error}");
    }
    let mut streams = Vec::new();
    for _ in 0..2 {
        streams.push(client.stream_frames("large", Encoding::Rgba8, 0.0).await.unwrap());
    }
    // The renderer draws every pose although the streams are not read.
    for step in 1..=20_u32 {
        let drawn = daemon.controls.finished.load(SeqCst);
        client.set_camera(&at_x(f64::from(step))).await.unwrap();
        until(|| daemon.controls.finished.load(SeqCst) > drawn).await;
    }
    let mut dropped = 0;
    for stream in &mut streams {
        let mut frame = next(stream).await;
        while frame.camera_revision < 20 {
            frame = next(stream).await;
        }
        dropped += frame.dropped;
    }
    assert!(dropped > 0);
    let reported = within(client.watch_stats(None).await.unwrap().next()).await.unwrap().unwrap();
    assert_eq!((reported.frames_dropped, reported.streams), (dropped, 2));
    daemon.shutdown().await.unwrap();
}
