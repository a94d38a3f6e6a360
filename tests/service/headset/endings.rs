//! A headset ends because the daemon drains, because its driver fails, or because the daemon stops waiting for it.

use super::*;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_ends_the_headset_its_streams_and_the_figures() {
    let (mut daemon, headset) = start().await;
    connect(&daemon, &headset).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("visor", Encoding::Png, 0.0).await.unwrap();
    let mut stats = client.watch_stats(Some(0.1)).await.unwrap();
    next(&mut stream).await;
    within(stats.next()).await.unwrap().expect("figures");
    let host = headset.host();
    assert!(host.shown().is_some() && !headset.ended.load(SeqCst));
    daemon.begin_shutdown();
    while within(stream.next()).await.expect("a clean end").is_some() {}
    while within(stats.next()).await.expect("a clean end").is_some() {}
    assert!(host.shown().is_none());
    drop(client);
    daemon.end().await.unwrap();
    assert!(headset.ended.load(SeqCst), "the daemon must have waited for the thread");
}

#[tokio::test]
async fn a_headset_that_does_not_end_is_abandoned() {
    let (headset, options) = visor("visor");
    let change = |serve: &mut steradian::service::ServeOptions| {
        serve.headset = Some(options);
        serve.limits.drain = Duration::from_millis(50);
    };
    let daemon = Daemon::start_with(small_rig(), change).await;
    until(|| headset.last_shown.lock().unwrap().is_some()).await;
    headset.stubborn.store(true, SeqCst);
    daemon.shutdown().await.expect("the daemon ends without an error");
    assert!(!headset.ended.load(SeqCst));
    headset.stubborn.store(false, SeqCst);
    until(|| headset.ended.load(SeqCst)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_failed_driver_does_not_affect_other_views() {
    for (order, reason) in [
        (Order::Fail, "no runtime with XR_KHR_vulkan_enable2"),
        (Order::Panic, "requested to panic"),
        (Order::End, "its session has ended"),
    ] {
        let (daemon, headset) = start().await;
        connect(&daemon, &headset).await;
        let mut client = daemon.client().await;
        let mut stream = client.stream_frames("visor", Encoding::Png, 0.0).await.unwrap();
        let mut flat = client.stream_frames("flat", Encoding::Png, 0.0).await.unwrap();
        next(&mut stream).await;
        next(&mut flat).await;
        headset.send(order);
        let end = within(async {
            loop {
                match stream.next().await {
                    Ok(Some(_)) => {}
                    other => return other,
                }
            }
        });
        unavailable(&end.await.expect_err("the stream ends with an error"), reason);
        let status = client.info().await.unwrap().headset.unwrap();
        assert!(!status.connected && !status.retrying && status.reason.contains(reason), "{status:?}");
        unavailable(&client.render_frame("visor", Encoding::Png).await.unwrap_err(), reason);
        unavailable(&client.stream_frames("visor", Encoding::Png, 0.0).await.unwrap_err(), reason);
        assert!(client.views().await.unwrap()[2].images.is_empty());
        let camera = client.set_camera(&at_x(1.0)).await.unwrap();
        while next(&mut flat).await.camera_revision < camera.revision {}
        drop((client, flat));
        daemon.shutdown().await.expect("the daemon ends without an error");
    }
}

#[tokio::test]
async fn a_driver_that_gives_up_reports_its_reason() {
    let (daemon, headset) = start().await;
    headset.send(Order::Lose);
    headset.send(Order::End);
    let mut client = daemon.client().await;
    let given_up = within(async {
        loop {
            let status = client.info().await.unwrap().headset.unwrap();
            if !status.connected && !status.retrying {
                break status.reason;
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    });
    assert_eq!(given_up.await, LOST);
    daemon.shutdown().await.unwrap();
}
