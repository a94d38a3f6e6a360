//! Tests the limits for hostile or faulty clients.

use std::time::{Duration, Instant};

use steradian::{output::Encoding, service::Client};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::sleep,
};
use tonic::Code;

use crate::daemon::{Daemon, large_rig, small_rig, within};

/// Returns the daemon's answer to bytes, until it closes the connection or pauses.
pub async fn answer(daemon: &Daemon, bytes: &[u8]) -> String {
    let mut stream = TcpStream::connect(daemon.address).await.unwrap();
    stream.write_all(bytes).await.unwrap();
    let mut all = Vec::new();
    let mut part = [0; 4096];
    while let Ok(Ok(count)) = tokio::time::timeout(Duration::from_millis(500), stream.read(&mut part)).await {
        if count == 0 {
            break;
        }
        all.extend_from_slice(&part[..count]);
    }
    String::from_utf8_lossy(&all).into_owned()
}

#[tokio::test]
async fn calls_with_other_hosts_and_origins_are_refused() {
    let daemon =
        Daemon::start_with(small_rig(), |options| options.network.hosts = vec!["desk.example.org".to_owned()]).await;
    let address = daemon.address;
    let call = |host: &str, origin: Option<&str>| {
        let origin = origin.map(|origin| format!("Origin: {origin}\r\n")).unwrap_or_default();
        let head =
            "POST /steradian.v1.CameraService/GetCamera HTTP/1.1\r\nContent-Type: application/grpc-web+proto\r\n";
        // An empty message.
        format!("{head}Host: {host}\r\n{origin}Content-Length: 5\r\nConnection: close\r\n\r\n\0\0\0\0\0")
    };
    let own = format!("http://{address}");
    for (host, origin) in [
        (address.to_string(), None),
        (address.to_string(), Some(own.as_str())),
        ("desk.example.org".to_owned(), None),
        ("localhost:1".to_owned(), None),
    ] {
        let text = answer(&daemon, call(&host, origin).as_bytes()).await;
        assert!(text.contains("200 OK") && text.contains("grpc-status:0"), "{host} {origin:?}: {text}");
    }
    for (host, origin) in
        [("evil.example.org", None), (&*address.to_string(), Some("http://evil.example.org")), ("", None)]
    {
        let text = answer(&daemon, call(host, origin).as_bytes()).await;
        assert!(!text.contains("grpc-status:0"), "{host} {origin:?}: {text}");
        assert!(text.contains("grpc-status: 7") || text.contains("400 Bad Request"), "{host} {origin:?}: {text}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn silent_connections_are_closed_and_active_ones_stay() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    client.camera().await.unwrap();
    let mut silent = Vec::new();
    for bytes in [&b""[..], b"PRI * HTTP/2.0", b"GET / HTTP/1.1\r\nHost: x"] {
        let mut stream = TcpStream::connect(daemon.address).await.unwrap();
        stream.write_all(bytes).await.unwrap();
        silent.push(stream);
    }
    let begun = Instant::now();
    for mut stream in silent {
        let mut rest = Vec::new();
        // The connection is closed, with or without an error.
        let _ = within(stream.read_to_end(&mut rest)).await;
    }
    println!("closed after {:.1} s", begun.elapsed().as_secs_f64());
    client.camera().await.unwrap();
    drop(client);
    daemon.shutdown().await.unwrap();
}

/// Streams of large frames that are not read are refused if they would take too much memory. Other streams continue.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn streams_beyond_the_memory_limit_are_refused() {
    let daemon = Daemon::start(large_rig()).await;
    let mut streams = Vec::new();
    let mut refused = None;
    let greedy: Client = daemon.client().await;
    for _ in 0..64 {
        match greedy.clone().stream_frames("large", Encoding::Rgb32f, 0.0).await {
            Ok(stream) => streams.push(stream),
            Err(error) => {
                refused = Some(error);
                break;
            }
        }
    }
    let error = refused.expect("the memory limit is reached");
    assert!(error.code() == Some(Code::ResourceExhausted) && error.to_string().contains("MiB"), "{error}");
    println!("{} streams", streams.len());
    let mut other = daemon.client().await;
    within(other.render_frame("large", Encoding::Rgba8)).await.unwrap();
    drop(streams);
    // Their memory is released.
    within(async {
        while greedy.clone().stream_frames("large", Encoding::Rgb32f, 0.0).await.is_err() {
            sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    drop((greedy, other));
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn oversized_masks_are_refused_at_once() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let names = (0..5000).map(|number| (format!("b{number}"), None)).collect();
    let update = steradian::service::SceneUpdate {
        bodies: steradian::service::Change::Named(names),
        ..steradian::service::SceneUpdate::default()
    };
    let error = within(client.update_scene(&update, None)).await.unwrap_err();
    assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains("at most 1024"), "{error}");
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn metrics_are_served_for_prometheus() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let first = client.next_frame("flat", Encoding::Png, 0, 0).await.unwrap();
    client.next_frame("flat", Encoding::Png, first.number, 0).await.unwrap();
    let request = format!("GET /metrics HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", daemon.address);
    let text = answer(&daemon, request.as_bytes()).await;
    assert!(text.contains("200 OK") && text.contains("application/openmetrics-text"), "{text}");
    let value = |name: &str| -> f64 {
        let line = text.lines().find(|line| line.split(' ').next() == Some(name));
        let line = line.unwrap_or_else(|| panic!("no {name} in {text}"));
        line.rsplit(' ').next().unwrap().parse().unwrap()
    };
    assert_eq!([value("steradian_frames_rendered_total"), value("steradian_encodings_total")], [2.0, 2.0]);
    assert!(value("steradian_encoded_bytes_total") > 100.0 && value("steradian_connections") >= 1.0);
    assert!(value("steradian_resident_memory_bytes") > 1e6 && value("steradian_pose_age_seconds") >= 0.0);
    assert_eq!(value("steradian_scene_revision"), 7.0);
    assert!(text.trim_end().ends_with("# EOF"));
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn health_is_told_and_heads_are_answered() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let ask = async |method: &str, path: &str| {
        let request = format!("{method} {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", daemon.address);
        let text = answer(&daemon, request.as_bytes()).await;
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().to_owned(), head.to_lowercase(), body.to_owned())
    };
    let (status, head, body) = ask("HEAD", "/metrics").await;
    assert!(status == "200" && head.contains("application/openmetrics-text") && body.is_empty(), "{head}");
    let (status, _, body) = ask("GET", "/healthz").await;
    assert!(status == "200" && body.contains("ok"), "{status} {body}");
    assert_eq!(ask("HEAD", "/healthz").await.0, "200");
    assert_eq!(ask("GET", "/health").await.0, "404");
    daemon.controls.failing.store(true, std::sync::atomic::Ordering::SeqCst);
    client.render_frame("flat", Encoding::Png).await.unwrap_err();
    let (status, _, body) = ask("GET", "/healthz").await;
    assert!(status == "503" && body.contains("frames cannot be drawn"), "{status} {body}");
    assert_eq!(ask("HEAD", "/healthz").await.0, "503");
    daemon.controls.failing.store(false, std::sync::atomic::Ordering::SeqCst);
    client.render_frame("flat", Encoding::Png).await.unwrap();
    assert_eq!(ask("GET", "/healthz").await.0, "200");
    drop(client);
    daemon.shutdown().await.unwrap();
}

/// If a client has opened the maximum number of streams, other clients can still open streams.
#[tokio::test]
async fn one_client_cannot_take_all_streams() {
    let daemon = Daemon::start(small_rig()).await;
    let [mut greedy, mut other] = [daemon.client().await, daemon.client().await];
    let mut watches = Vec::new();
    let refusal = loop {
        match greedy.watch_camera().await {
            Ok(watch) => watches.push(watch),
            Err(error) => break error,
        }
    };
    assert_eq!((watches.len(), refusal.code()), (64, Some(Code::ResourceExhausted)));
    let text = refusal.to_string();
    assert!(
        text.contains("this client has 64 streams of scene, camera and statistics, the maximum of one client"),
        "{text}"
    );
    within(other.watch_camera().await.unwrap().next()).await.unwrap().unwrap();
    // Streams that end are no longer counted.
    drop(watches);
    within(async { while greedy.watch_camera().await.is_err() {} }).await;
    let mut streams = Vec::new();
    let refusal = loop {
        match greedy.stream_frames("flat", Encoding::Rgba8, 1.0).await {
            Ok(stream) => streams.push(stream),
            Err(error) => break error,
        }
    };
    assert_eq!(streams.len(), 64);
    assert!(refusal.to_string().contains("this client has 64 streams of frames"), "{refusal}");
    let mut of_other = other.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    within(of_other.next()).await.unwrap().unwrap();
    daemon.shutdown().await.unwrap();
}
