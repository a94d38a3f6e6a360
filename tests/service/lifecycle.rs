//! Start and end of the daemon.

use std::sync::atomic::Ordering::SeqCst;

use steradian::{
    output::Encoding,
    service::{CameraUpdate, ClientError, ServeError, ServeOptions, run},
};
use tonic::Code;
use tonic_health::pb::{HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient};

use crate::daemon::{Daemon, TestEngine, large_rig, small_rig, until, within};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_ends_streams_cleanly_and_finishes_calls() {
    let mut daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut health = HealthClient::new(daemon.channel().await);
    let request = HealthCheckRequest { service: "steradian.v1.ViewService".to_owned() };
    let mut watch = health.watch(request).await.unwrap().into_inner();
    assert_eq!(watch.message().await.unwrap().unwrap().status(), ServingStatus::Serving);
    let mut stream = client.stream_frames("flat", Encoding::Png, 0.0).await.unwrap();
    within(stream.next()).await.unwrap().expect("a first frame");

    daemon.controls.close_gate();
    let begun = daemon.controls.started.load(SeqCst);
    let call = tokio::spawn({
        let mut client = client.clone();
        async move { client.render_frame("eyes", Encoding::Exr).await }
    });
    until(|| daemon.controls.started.load(SeqCst) > begun).await;
    daemon.begin_shutdown();
    assert_eq!(within(watch.message()).await.unwrap().unwrap().status(), ServingStatus::NotServing);
    assert!(within(watch.message()).await.unwrap().is_none(), "the watch ends");
    // The frame in flight is still delivered; the stream ends before it.
    while within(stream.next()).await.expect("a clean end").is_some() {}
    assert!(!call.is_finished());
    daemon.controls.open_gate();
    assert_eq!(within(call).await.unwrap().expect("the call finishes").images.len(), 2);
    let address = daemon.address;
    drop((client, health));
    daemon.end().await.unwrap();
    assert!(tokio::net::TcpStream::connect(address).await.is_err(), "the port is closed");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stalled_client_is_cut_off_after_the_drain() {
    let daemon =
        Daemon::start_with(large_rig(), |options| options.limits.drain = std::time::Duration::from_millis(100)).await;
    let mut client = daemon.client().await;
    let stream = client.stream_frames("large", Encoding::Rgba8, 0.0).await.unwrap();
    until(|| daemon.controls.finished.load(SeqCst) > 0).await;
    daemon.shutdown().await.expect("the daemon ends without an error");
    drop(stream);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panicking_renderer_ends_the_daemon_with_an_error() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut stream = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    within(stream.next()).await.unwrap().expect("a first frame");
    daemon.controls.panicking.store(true, SeqCst);
    let error = within(client.render_frame("flat", Encoding::Png)).await.unwrap_err();
    assert_eq!(error.code(), Some(Code::Unavailable), "{error}");
    let end = within(async {
        loop {
            match stream.next().await {
                Ok(Some(_)) => {}
                other => return other,
            }
        }
    })
    .await;
    assert_eq!(end.expect_err("no clean end").code(), Some(Code::Unavailable));
    drop(client);
    match daemon.end().await {
        Err(ServeError::Panicked { message }) => assert!(message.contains("requested to panic"), "{message}"),
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_and_calls_survive_twenty_device_losses() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut flat = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut eyes = client.stream_frames("eyes", Encoding::Rgb32f, 0.0).await.unwrap();
    let mut last = [0; 2];
    for turn in 1..=20_u64 {
        daemon.controls.losses.store(1, SeqCst);
        let pose = CameraUpdate { position_m: Some([turn as f64, 0.0, 0.0]), ..CameraUpdate::default() };
        let revision = client.set_camera(&pose).await.unwrap().revision;
        let called = within(client.render_frame("flat", Encoding::Png)).await.unwrap();
        assert!(called.camera_revision >= revision);
        for (stream, last) in [&mut flat, &mut eyes].into_iter().zip(&mut last) {
            loop {
                let frame = within(stream.next()).await.unwrap().expect("the stream goes on");
                assert!(frame.number > *last || *last == 0, "numbers go on");
                *last = frame.number;
                if frame.camera_revision >= revision {
                    break;
                }
            }
        }
        assert_eq!(daemon.controls.reopened.load(SeqCst), turn);
    }
    assert_eq!(client.next_frame("flat", Encoding::Rgba8, 0, 0).await.unwrap().camera_revision, 20);

    // If frames of a scene lose every device, the scene is refused after some attempts. The next scene is drawn.
    daemon.controls.losses.store(3, SeqCst);
    let error = within(client.render_frame("flat", Encoding::Png)).await.unwrap_err();
    assert!(error.to_string().contains("lose its device temporarily"), "{error}");
    within(client.render_frame("flat", Encoding::Png)).await.unwrap();
    drop((flat, eyes, client));
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_device_that_cannot_be_reopened_ends_the_daemon() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    within(client.render_frame("flat", Encoding::Png)).await.unwrap();
    daemon.controls.lost.store(true, SeqCst);
    let error = within(client.render_frame("flat", Encoding::Png)).await.unwrap_err();
    assert!(error.to_string().contains("lose its device"), "{error}");
    drop(client);
    match daemon.end().await {
        Err(ServeError::Lost(error)) => assert!(error.lost && error.to_string().contains("lose its device"), "{error}"),
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn bad_and_taken_addresses_are_clear_errors() {
    let daemon = Daemon::start(small_rig()).await;
    let taken = daemon.address.to_string();
    for listen in [taken.as_str(), "127.0.0.1", "127.0.0.1:99999", ":::"] {
        let scene = steradian::scene::SceneSnapshot {
            revision: 0,
            stars: Default::default(),
            objects: Default::default(),
            camera: Default::default(),
        };
        let engine = Box::new(TestEngine::new(Default::default()));
        let never = |address| panic!("ready on {address}");
        let error = within(run(ServeOptions::new(listen, engine, scene, small_rig(), Default::default(), never)));
        let error = error.await.unwrap_err();
        assert!(error.to_string().contains(listen), "{error}");
        match error {
            ServeError::AddressInUse { address } => assert_eq!(address, daemon.listening),
            ServeError::Address { .. } => assert_ne!(listen, taken),
            other => panic!("{other:?}"),
        }
    }
    daemon.shutdown().await.unwrap();
}

/// Starts a daemon that must fail to start; returns its error.
async fn refusal(listen: &str) -> ServeError {
    let scene = steradian::scene::SceneSnapshot {
        revision: 0,
        stars: Default::default(),
        objects: Default::default(),
        camera: Default::default(),
    };
    let engine = Box::new(TestEngine::new(Default::default()));
    let never = |address| panic!("ready on {address}");
    within(run(ServeOptions::new(listen, engine, scene, small_rig(), Default::default(), never))).await.unwrap_err()
}

#[tokio::test]
async fn a_path_that_is_no_socket_is_refused_and_stays_as_it_is() {
    use std::{fs, os::unix::fs::symlink};
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("notes.txt"), "months of notes").unwrap();
    fs::write(path("empty"), "").unwrap();
    fs::create_dir(path("drawer")).unwrap();
    symlink(path("notes.txt"), path("link")).unwrap();
    for (name, what) in [("notes.txt", "file"), ("empty", "file"), ("link", "file"), ("drawer", "folder")] {
        let listen = format!("unix:{}", path(name).display());
        let wanted = format!("listen = `{listen}`: a {what} is there, not a socket");
        let checked = steradian::service::check_listen(&listen, &Default::default()).unwrap_err();
        for error in [checked, refusal(&listen).await] {
            assert!(matches!(error, ServeError::NotSocket { .. }) && error.to_string().contains(&wanted), "{error}");
        }
        assert!(path(name).symlink_metadata().is_ok(), "{name} is gone");
    }
    assert_eq!(fs::read_to_string(path("notes.txt")).unwrap(), "months of notes");

    // When a daemon ends, it removes its own socket, but not a file that has replaced the socket.
    let listen = format!("unix:{}", path("socket").display());
    let daemon = Daemon::start_with(small_rig(), |options| options.network.listen = listen).await;
    fs::remove_file(path("socket")).unwrap();
    fs::write(path("socket"), "more notes").unwrap();
    daemon.shutdown().await.unwrap();
    assert_eq!(fs::read_to_string(path("socket")).unwrap(), "more notes");
}

#[tokio::test]
async fn a_taken_address_is_found_before_slow_work() {
    let daemon = Daemon::start(small_rig()).await;
    let check = |listen: &str| steradian::service::check_listen(listen, &Default::default());
    match check(&daemon.address.to_string()) {
        Err(ServeError::AddressInUse { address }) => assert_eq!(address, daemon.listening),
        other => panic!("{other:?}"),
    }
    check("127.0.0.1:0").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let listen = format!("unix:{}", path.display());
    check(&listen).unwrap();
    assert!(!path.exists());
    let listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
    assert!(matches!(check(&listen), Err(ServeError::AddressInUse { .. })));
    // A new daemon starts although the socket of a killed daemon still exists.
    drop(listener);
    check(&listen).unwrap();
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_client_without_a_daemon_reports_a_clear_error() {
    let daemon = Daemon::start(small_rig()).await;
    let uri = daemon.uri();
    daemon.shutdown().await.unwrap();
    let error = steradian::service::Client::connect(&uri).await.unwrap_err();
    assert!(matches!(error, ClientError::Connect { .. }) && error.to_string().contains(&uri), "{error}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_renderer_that_is_busy_after_the_drain_is_abandoned() {
    let mut daemon =
        Daemon::start_with(small_rig(), |options| options.limits.drain = std::time::Duration::from_millis(50)).await;
    let mut client = daemon.client().await;
    daemon.controls.close_gate();
    let call = tokio::spawn(async move { client.render_frame("flat", Encoding::Png).await });
    until(|| daemon.controls.started.load(SeqCst) > 0).await;
    daemon.begin_shutdown();
    let controls = std::sync::Arc::clone(&daemon.controls);
    daemon.end().await.expect("the daemon ends without an error");
    assert_eq!(controls.finished.load(SeqCst), 0, "the frame must still be in flight");
    controls.open_gate();
    // The connection still exists in the runtime of this test, so the caller may still get the frame.
    if let Err(error) = within(call).await.unwrap() {
        assert!(matches!(error, ClientError::Status { .. }), "{error}");
    }
}

/// Opens a relay to a daemon. It can stop forwarding data without closing its connection to the client.
async fn frozen_line(daemon: &Daemon) -> (String, tokio::sync::watch::Sender<bool>) {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let uri = format!("http://{}", listener.local_addr().unwrap());
    let address = daemon.address;
    let (freeze, mut frozen) = tokio::sync::watch::channel(false);
    tokio::spawn(async move {
        let (mut near, _) = listener.accept().await.unwrap();
        let mut far = tokio::net::TcpStream::connect(address).await.unwrap();
        tokio::select! {
            copied = tokio::io::copy_bidirectional(&mut near, &mut far) => drop(copied),
            () = async { assert!(frozen.wait_for(|frozen| *frozen).await.is_ok()) } => std::future::pending().await,
        }
    });
    (uri, freeze)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_notices_a_daemon_that_hangs() {
    let daemon = Daemon::start(small_rig()).await;
    let (uri, freeze) = frozen_line(&daemon).await;
    let mut client = steradian::service::Client::connect(&uri).await.unwrap();
    let number = client.next_frame("flat", Encoding::Rgba8, 0, 0).await.unwrap().number;
    // The connection stays open, so the client can detect the failure only by missing answers.
    freeze.send_replace(true);
    let error = within(client.next_frame("flat", Encoding::Rgba8, number, 0)).await.unwrap_err();
    assert!(matches!(error.code(), Some(Code::Unavailable | Code::Unknown | Code::Internal)), "{error}");
    daemon.shutdown().await.unwrap();
}
