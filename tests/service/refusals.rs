//! Refusals can be read by clients: they are short enough for the headers of an answer, and have the documented codes
//! and methods.

use glam::{DQuat, DVec3};
use steradian::{
    service::proto::{
        self, camera_service_client::CameraServiceClient, diagnostics_service_client::DiagnosticsServiceClient,
        scene_service_client::SceneServiceClient, view_service_client::ViewServiceClient,
    },
    view::{Rig, View, ViewKind},
};
use tonic::{
    Code, Status,
    transport::{Channel, Endpoint},
};

use crate::{
    daemon::{Daemon, small_rig, within},
    hostile::answer,
};

/// Maximum bytes of text and details in the headers of an answer.
const MOST_ENCODED: usize = 3 << 10;
/// Headers that the client of these tests accepts, as many proxies do.
const HEADER_BYTES: u32 = 4096;

/// Returns the size of a status in the headers of an answer, bytes: the percent-encoded text, and the details in
/// base64.
fn encoded_bytes(status: &Status) -> usize {
    let plain = |byte: &u8| byte.is_ascii_graphic() && !b"\"#%<>`?{}".contains(byte);
    let text: usize = status.message().as_bytes().iter().map(|byte| if plain(byte) { 1 } else { 3 }).sum();
    text + status.details().len() * 4 / 3
}

fn mask(paths: &[&str]) -> Option<prost_types::FieldMask> {
    Some(prost_types::FieldMask { paths: paths.iter().map(|path| (*path).to_owned()).collect() })
}

/// Makes calls that have a long text wherever possible; returns the refusals.
async fn refusals(channel: &Channel, long: &str) -> Vec<(&'static str, Status)> {
    let (mut views, mut scenes) = (ViewServiceClient::new(channel.clone()), SceneServiceClient::new(channel.clone()));
    let mut diagnostics = DiagnosticsServiceClient::new(channel.clone());
    let mut cameras = CameraServiceClient::new(channel.clone());
    let text = || long.to_owned();
    let mut all = Vec::new();
    let mut refused = |call, status: Option<Status>| all.push((call, status.expect(call)));
    refused("GetView", views.get_view(proto::GetViewRequest { view: text() }).await.err());
    refused(
        "DeleteView",
        views.delete_view(proto::DeleteViewRequest { view: text(), ..Default::default() }).await.err(),
    );
    let frame = proto::RenderFrameRequest { view: text(), ..Default::default() };
    refused("RenderFrame", views.render_frame(frame).await.err());
    let fisheye = || proto::ViewDefinition {
        name: Some("flat".to_owned()),
        r#type: Some("fisheye".to_owned()),
        size: vec![8, 8],
        fov_deg: Some(90.0),
        ..Default::default()
    };
    for definition in [
        proto::ViewDefinition { name: Some(text()), ..fisheye() },
        proto::ViewDefinition { r#type: Some(text()), ..fisheye() },
        proto::ViewDefinition { mapping: Some(text()), ..fisheye() },
        proto::ViewDefinition { exposure_group: Some(text()), fov_deg: Some(1e300), ..fisheye() },
    ] {
        let request = proto::CreateViewRequest { definition: Some(definition.clone()), expected_revision: None };
        refused("CreateView", views.create_view(request).await.err());
        let update = |path: &str, name: &str| proto::UpdateViewRequest {
            view: Some(proto::View {
                name: name.to_owned(),
                definition: Some(definition.clone()),
                ..Default::default()
            }),
            update_mask: mask(&[path]),
            expected_revision: None,
        };
        refused("UpdateView of a view", views.update_view(update("definition", long)).await.err());
        refused("UpdateView of a field", views.update_view(update(long, "flat")).await.err());
        refused("UpdateView of a key", views.update_view(update(&format!("definition.{long}"), "flat")).await.err());
        refused("UpdateView of all", views.update_view(update("definition", "flat")).await.err());
    }
    refused("SaveSnapshot", scenes.save_snapshot(proto::SaveSnapshotRequest { name: text() }).await.err());
    let load = proto::LoadSnapshotRequest { name: text(), expected_revision: None };
    refused("LoadSnapshot", scenes.load_snapshot(load).await.err());
    let body = |name: &str, law: &str| proto::Body { name: name.to_owned(), law: law.to_owned(), ..Default::default() };
    let [of_body, of_label] = ["bodies", "overlay.labels"].map(|list| format!("{list}.{long}"));
    for (path, bodies) in [
        (long, vec![]),
        ("stars.method", vec![]),
        ("asteroids.impostor", vec![]),
        ("bodies", vec![body(long, "lambert"), body(long, "lambert")]),
        ("bodies", vec![body("mars", long)]),
        (&*of_body, vec![]),
        (&*of_label, vec![]),
    ] {
        let scene = proto::Scene {
            stars: Some(proto::StarSettings { method: text(), magnitude_limit: 6.0 }),
            asteroids: Some(proto::AsteroidSettings { impostor: text(), quality: 1.0 }),
            bodies,
            ..Default::default()
        };
        let request =
            proto::UpdateSceneRequest { scene: Some(scene), update_mask: mask(&[path]), expected_revision: None };
        refused("UpdateScene", scenes.update_scene(request).await.err());
    }
    refused("Find", scenes.find(proto::FindRequest { name: text() }).await.err());
    let look = proto::Look { at: text(), ..Default::default() };
    let camera = proto::SetCameraRequest { look: Some(look), ..Default::default() };
    refused("SetCamera", cameras.set_camera(camera).await.err());
    let checks = proto::VerifyRequest { filter: text(), star_method: String::new() };
    refused("Verify", diagnostics.verify(checks).await.err());
    let checks = proto::VerifyRequest { filter: String::new(), star_method: text() };
    refused("Verify", diagnostics.verify(checks).await.err());
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn long_texts_are_refused_briefly_and_other_calls_of_the_connection_continue() {
    let folder = tempfile::tempdir().unwrap();
    let daemon =
        Daemon::start_with(small_rig(), |options| options.state = Some(folder.path().join("state.redb"))).await;
    let endpoint = Endpoint::from_shared(daemon.uri()).unwrap().http2_max_header_list_size(HEADER_BYTES);
    let channel = endpoint.connect().await.unwrap();
    let mut cameras = CameraServiceClient::new(channel.clone());
    let mut watch = cameras.watch_camera(proto::WatchCameraRequest {}).await.unwrap().into_inner();
    within(watch.message()).await.unwrap().unwrap();
    for long in ["y".repeat(2000), "\u{64cd}".repeat(1500), "`".repeat(2000), "a, ".repeat(5000), "y.".repeat(1000)] {
        for (call, status) in refusals(&channel, &long).await {
            let bytes = encoded_bytes(&status);
            assert!(bytes <= MOST_ENCODED, "{call}: {bytes} bytes of {status:?}");
            let expected = [Code::InvalidArgument, Code::NotFound];
            assert!(expected.contains(&status.code()), "{call}: {status:?}");
        }
    }
    // The names that a refusal lists are limited too.
    let mut scenes = SceneServiceClient::new(channel.clone());
    for number in 0..90 {
        scenes.save_snapshot(proto::SaveSnapshotRequest { name: format!("s{number:034}") }).await.unwrap();
    }
    let load = proto::LoadSnapshotRequest { name: "evening".to_owned(), expected_revision: None };
    let status = scenes.load_snapshot(load).await.unwrap_err();
    assert!(encoded_bytes(&status) <= MOST_ENCODED && status.code() == Code::NotFound, "{status:?}");
    assert!(status.message().starts_with("no snapshot `evening`; existing ones: s0000"), "{status:?}");
    assert!(status.message().ends_with(" and 81 more"), "{status:?}");
    // The watch must not have ended.
    let moved = cameras.set_camera(proto::SetCameraRequest::default()).await.unwrap().into_inner();
    while within(watch.message()).await.unwrap().expect("the watch continues").revision < moved.revision {}
    drop((watch, cameras, scenes, channel));
    daemon.shutdown().await.unwrap();
}

/// Posts a message as gRPC-Web, with a prefix that contains its length; returns the answer in lower case.
async fn post(daemon: &Daemon, path: &str, length: u32, message: &[u8]) -> String {
    let mut body = [&[0][..], &length.to_be_bytes(), message].concat();
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: {}\r\nContent-Type: application/grpc-web+proto\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n",
        daemon.address,
        body.len()
    );
    let mut request = head.into_bytes();
    request.append(&mut body);
    answer(daemon, &request).await.to_lowercase()
}

#[tokio::test]
async fn requests_that_cannot_be_read_have_the_documented_codes() {
    let daemon = Daemon::start(small_rig()).await;
    for (path, length, most) in [
        ("/steradian.v1.ViewService/GetView", 70_000, 65_536),
        ("/steradian.v1.CameraService/SetCamera", 70_000, 65_536),
        ("/steradian.v1.SceneService/UpdateScene", 5 << 20, 4 << 20),
    ] {
        let text = post(&daemon, path, length, &[]).await;
        assert!(text.contains(&format!("grpc-status: {}", Code::ResourceExhausted as i32)), "{path}: {text}");
        assert!(text.contains(&format!("{most}")), "{path}: {text}");
        // A tag with an unknown wire type.
        let text = post(&daemon, path, 1, &[0x0f]).await;
        assert!(text.contains(&format!("grpc-status: {}", Code::InvalidArgument as i32)), "{path}: {text}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn other_methods_and_versions_of_http_are_refused_with_the_valid_ones() {
    let daemon = Daemon::start(small_rig()).await;
    let call = "/steradian.v1.ViewService/ListViews";
    for (method, path, kind, status, part) in [
        ("POST", "/", "", "405", "allow: get, head"),
        ("OPTIONS", "/", "", "405", "allow: get, head"),
        ("DELETE", "/", "", "405", "allow: get, head"),
        ("POST", "/metrics", "", "405", "allow: get, head"),
        ("PUT", "/healthz", "text/plain", "405", "allow: get, head"),
        ("POST", "/elsewhere", "", "405", "allow: get, head"),
        ("DELETE", call, "", "405", "allow: post"),
        ("OPTIONS", call, "", "405", "allow: post"),
        ("POST", call, "application/json", "415", "application/grpc-web"),
        ("POST", call, "application/grpc", "505", "grpc_pass"),
        ("POST", call, "application/grpc+proto", "505", "grpc needs http/2"),
    ] {
        let kind = if kind.is_empty() { String::new() } else { format!("Content-Type: {kind}\r\n") };
        let head = format!("{method} {path} HTTP/1.1\r\nHost: {}\r\n{kind}", daemon.address);
        let text = answer(&daemon, format!("{head}Content-Length: 0\r\nConnection: close\r\n\r\n").as_bytes()).await;
        let text = text.to_lowercase();
        assert!(text.starts_with(&format!("http/1.1 {status}")), "{method} {path} {kind}: {text}");
        assert!(text.contains(part), "{method} {path} {kind}: {text}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_request_with_two_hosts_is_refused() {
    let daemon = Daemon::start(small_rig()).await;
    let address = daemon.address;
    for (first, second) in
        [(address.to_string(), "evil.example.org".to_owned()), (address.to_string(), address.to_string())]
    {
        let request = format!("GET / HTTP/1.1\r\nHost: {first}\r\nHost: {second}\r\nConnection: close\r\n\r\n");
        let text = answer(&daemon, request.as_bytes()).await;
        assert!(text.starts_with("HTTP/1.1 400") && text.contains("one header `host`"), "{text}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn first_messages_and_times_of_streams_are_checked() {
    let daemon = Daemon::start(small_rig()).await;
    let mut cameras = CameraServiceClient::new(daemon.channel().await);
    let camera = || Some(proto::SetCameraRequest::default());
    for (message, part) in [
        (
            proto::StreamCameraRequest { holder: "desk".to_owned(), ..Default::default() },
            "holder: must come with a lease",
        ),
        (
            proto::StreamCameraRequest {
                camera: camera(),
                time: Some(prost_types::Timestamp { seconds: 0, nanos: 2_000_000_000 }),
                ..Default::default()
            },
            "time.nanos = 2000000000: must be between 0 and 999999999",
        ),
        (
            proto::StreamCameraRequest {
                camera: camera(),
                time: Some(prost_types::Timestamp { seconds: 0, nanos: -1 }),
                ..Default::default()
            },
            "time.nanos = -1",
        ),
    ] {
        let status = within(cameras.stream_camera(tokio_stream::once(message))).await.unwrap_err();
        assert!(status.code() == Code::InvalidArgument && status.message().contains(part), "{status:?}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn images_of_a_size_that_an_encoding_lacks_are_refused_as_invalid() {
    let wide = ViewKind::Perspective { size: [16_384, 1], fov_y_rad: 1e-4 };
    let wide = View::new("wide", wide, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    let daemon = Daemon::start(Rig::new(vec![wide]).unwrap()).await;
    let mut views = ViewServiceClient::new(daemon.channel().await);
    let encoding = proto::Encoding::H264.into();
    let request = proto::RenderFrameRequest { view: "wide".to_owned(), encoding, max_size: 0 };
    let status = within(views.render_frame(request)).await.unwrap_err();
    assert!(status.code() == Code::InvalidArgument && status.message().contains("max_size"), "{status:?}");
    let request = proto::NextFrameRequest { view: "wide".to_owned(), encoding, ..Default::default() };
    let status = within(views.next_frame(request)).await.unwrap_err();
    assert!(status.code() == Code::InvalidArgument && status.message().contains("max_size"), "{status:?}");
    daemon.shutdown().await.unwrap();
}
