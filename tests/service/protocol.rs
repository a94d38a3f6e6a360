//! Tests services in addition to the calls: health, reflection, gRPC-Web.

use steradian::service::Client;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
};
use tonic::{Code, Request};
use tonic_health::pb::{HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient};

use crate::daemon::{Daemon, small_rig, within};

const SERVICES: [&str; 4] = [
    "steradian.v1.SceneService",
    "steradian.v1.CameraService",
    "steradian.v1.ViewService",
    "steradian.v1.DiagnosticsService",
];

#[tokio::test]
async fn health_is_reported_for_the_whole_and_for_each_service() {
    let daemon = Daemon::start(small_rig()).await;
    let mut health = HealthClient::new(daemon.channel().await);
    for service in ["", SERVICES[0], SERVICES[1], SERVICES[2], SERVICES[3]] {
        let answer = health.check(HealthCheckRequest { service: service.to_owned() }).await.unwrap();
        assert_eq!(answer.into_inner().status(), ServingStatus::Serving, "{service}");
    }
    let unknown = health.check(HealthCheckRequest { service: "steradian.v1.Nothing".to_owned() }).await;
    assert_eq!(unknown.unwrap_err().code(), Code::NotFound);
    drop(health);
    daemon.shutdown().await.unwrap();
}

/// Lists services and requests the file that defines a symbol, with one version of the reflection protocol.
macro_rules! reflect {
    ($version:ident, $daemon:expr) => {{
        use tonic_reflection::pb::$version::{
            ServerReflectionRequest, server_reflection_client::ServerReflectionClient,
            server_reflection_request::MessageRequest, server_reflection_response::MessageResponse,
        };
        let mut client = ServerReflectionClient::new($daemon.channel().await);
        let ask = |request| ServerReflectionRequest { host: String::new(), message_request: Some(request) };
        let requests = vec![
            ask(MessageRequest::ListServices(String::new())),
            ask(MessageRequest::FileContainingSymbol("steradian.v1.Frame".to_owned())),
        ];
        let request = Request::new(tokio_stream::iter(requests));
        let mut answers = client.server_reflection_info(request).await.unwrap().into_inner();
        let mut answer = async || within(answers.message()).await.unwrap().unwrap().message_response.unwrap();
        let MessageResponse::ListServicesResponse(list) = answer().await else { panic!("no list of services") };
        let MessageResponse::FileDescriptorResponse(files) = answer().await else { panic!("no file") };
        (list.service.into_iter().map(|s| s.name).collect::<Vec<_>>(), files.file_descriptor_proto)
    }};
}

#[tokio::test]
async fn reflection_lists_the_services_and_has_their_definitions() {
    let daemon = Daemon::start(small_rig()).await;
    for (services, files) in [reflect!(v1, daemon), reflect!(v1alpha, daemon)] {
        for service in SERVICES.into_iter().chain(["grpc.health.v1.Health"]) {
            assert!(services.iter().any(|name| name == service), "{service} is not among {services:?}");
        }
        assert!(files[0].windows(14).any(|bytes| bytes == b"exposure_ev100"));
    }
    daemon.shutdown().await.unwrap();
}

/// Posts an empty message as gRPC-Web over HTTP/1.1; returns the raw answer.
async fn post(daemon: &Daemon, path: &str) -> String {
    let mut socket = TcpStream::connect(daemon.address).await.unwrap();
    let head = format!(
        "POST {path} HTTP/1.1\r\nhost: {}\r\ncontent-type: application/grpc-web+proto\r\nx-grpc-web: 1\r\n\
         content-length: 5\r\nconnection: close\r\n\r\n",
        daemon.address
    );
    socket.write_all(head.as_bytes()).await.unwrap();
    // The prefix: no compression, and a message of zero bytes.
    socket.write_all(&[0; 5]).await.unwrap();
    let mut answer = Vec::new();
    within(socket.read_to_end(&mut answer)).await.unwrap();
    String::from_utf8_lossy(&answer).to_lowercase()
}

#[tokio::test]
async fn grpc_web_works_over_http_1() {
    let daemon = Daemon::start(small_rig()).await;
    let answer = post(&daemon, "/steradian.v1.DiagnosticsService/GetInfo").await;
    assert!(answer.starts_with("http/1.1 200"), "{answer}");
    assert!(answer.contains("content-type: application/grpc-web+proto"), "{answer}");
    assert!(answer.contains("test adapter") && answer.contains("grpc-status:0"), "{answer}");
    // The empty request names no view.
    let answer = post(&daemon, "/steradian.v1.ViewService/RenderFrame").await;
    assert!(answer.contains(&format!("grpc-status: {}", Code::NotFound as i32)), "{answer}");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn many_clients_share_a_daemon() {
    let daemon = Daemon::start(small_rig()).await;
    let mut clients: Vec<Client> = Vec::new();
    for _ in 0..5 {
        clients.push(daemon.client().await);
    }
    for client in &mut clients {
        client.set_camera(&steradian::service::CameraUpdate::default()).await.unwrap();
    }
    assert_eq!(clients[0].camera().await.unwrap().revision, 5);
    drop(clients);
    daemon.shutdown().await.unwrap();
}
