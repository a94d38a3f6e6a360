//! The time before the daemon serves.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst},
    },
};

use steradian::service::{
    Access, AccessSource, Address, EarlyServer, NetworkOptions, ServeError, StartProgress, proto,
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};
use tonic::{Code, transport::Channel};
use tonic_health::pb::{HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient};

use crate::daemon::{Daemon, small_rig, until, within};

fn network(listen: &str) -> NetworkOptions {
    NetworkOptions { listen: listen.to_owned(), hosts: Vec::new(), access: None }
}

/// Opens a server on a free port.
async fn open(progress: &Arc<StartProgress>) -> (EarlyServer, SocketAddr) {
    let early = EarlyServer::open(&network("127.0.0.1:0"), Arc::clone(progress)).await.unwrap();
    let Address::Tcp(address) = *early.address() else { panic!("{}", early.address()) };
    (early, address)
}

async fn status(health: &mut HealthClient<Channel>) -> ServingStatus {
    let request = HealthCheckRequest { service: "steradian.v1.ViewService".to_owned() };
    health.check(request).await.unwrap().into_inner().status()
}

async fn get(address: SocketAddr, path: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut text = String::new();
    within(stream.read_to_string(&mut text)).await.unwrap();
    text
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn clients_learn_what_a_starting_daemon_waits_for() {
    let progress = Arc::new(StartProgress::default());
    progress.tell("stars", "sorting 5 stars".to_owned());
    progress.tell("shaders", "shaders: stars (3 of 14)".to_owned());
    let (early, address) = open(&progress).await;
    let channel = Channel::from_shared(format!("http://{address}")).unwrap().connect().await.unwrap();
    let mut health = HealthClient::new(channel.clone());
    assert_eq!(status(&mut health).await, ServingStatus::NotServing);
    let mut scene = proto::scene_service_client::SceneServiceClient::new(channel);
    let refusal = scene.get_scene(proto::GetSceneRequest::default()).await.unwrap_err();
    assert_eq!(refusal.code(), Code::Unavailable);
    assert_eq!(refusal.message(), "the daemon is starting: shaders: stars (3 of 14); sorting 5 stars");
    progress.done("stars");
    let page = get(address, "/").await;
    assert!(page.starts_with("HTTP/1.1 503") && page.contains("refresh: 1"), "{page}");
    assert!(page.ends_with("the daemon is starting: shaders: stars (3 of 14)\n"), "{page}");
    let healthz = get(address, "/healthz").await;
    assert!(healthz.starts_with("HTTP/1.1 503") && healthz.ends_with("\r\n\r\nstarting\n"), "{healthz}");

    // The daemon serves on the same port. No connection is refused during the change of servers.
    let ended = Arc::new(AtomicBool::new(false));
    let connecting = tokio::spawn({
        let ended = Arc::clone(&ended);
        async move {
            let mut connections = 0;
            while !ended.load(SeqCst) {
                TcpStream::connect(address).await.expect("the port is open");
                connections += 1;
                tokio::task::yield_now().await;
            }
            connections
        }
    });
    let request = HealthCheckRequest { service: String::new() };
    let mut watch = health.watch(request).await.unwrap().into_inner();
    assert_eq!(watch.message().await.unwrap().unwrap().status(), ServingStatus::NotServing);
    // One connection has had no request, like those that browsers open in advance. The other one is between two requests.
    let mut unused = TcpStream::connect(address).await.unwrap();
    let mut between = TcpStream::connect(address).await.unwrap();
    let request = format!("GET /healthz HTTP/1.1\r\nHost: {address}\r\n\r\n");
    between.write_all(request.as_bytes()).await.unwrap();
    assert!(within(between.read(&mut [0; 4096])).await.unwrap() > 0);
    let daemon = Daemon::start_with(small_rig(), |options| options.early = Some(early)).await;
    assert_eq!(daemon.address, address);
    for connection in [&mut unused, &mut between] {
        assert!(!matches!(within(connection.read(&mut [0; 4096])).await, Ok(1..)), "the early server is gone");
    }
    ended.store(true, SeqCst);
    assert!(connecting.await.unwrap() > 0);
    assert!(!matches!(within(watch.message()).await, Ok(Some(_))), "the watch ends with its server");
    assert_eq!(status(&mut health).await, ServingStatus::Serving);
    scene.get_scene(proto::GetSceneRequest::default()).await.unwrap();
    drop((health, scene));
    daemon.shutdown().await.unwrap();
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reload_during_the_start_is_made_when_the_daemon_serves() {
    use rustix::process::{Signal, getpid, kill_process};
    let reads = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&reads);
    let access: AccessSource = Arc::new(move || {
        counted.fetch_add(1, SeqCst);
        Ok(Access::default())
    });
    let network = NetworkOptions { access: Some(access), ..network("127.0.0.1:0") };
    let early = EarlyServer::open(&network, Arc::default()).await.unwrap();
    assert_eq!(reads.load(SeqCst), 1);
    kill_process(getpid(), Signal::HUP).unwrap();
    let daemon = Daemon::start_with(small_rig(), |options| {
        options.network = network;
        options.early = Some(early);
    })
    .await;
    until(|| reads.load(SeqCst) == 2).await;
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_start_that_fails_closes_the_port_and_removes_the_socket() {
    let progress = Arc::new(StartProgress::default());
    let (early, address) = open(&progress).await;
    let taken = EarlyServer::open(&network(&address.to_string()), Arc::clone(&progress)).await;
    assert!(matches!(taken.err(), Some(ServeError::AddressInUse { .. })));
    early.give_up().await;
    until(|| std::net::TcpListener::bind(address).is_ok()).await;

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let early = EarlyServer::open(&network(&format!("unix:{}", path.display())), progress).await.unwrap();
    assert!(path.exists());
    early.give_up().await;
    assert!(!path.exists());
}
