//! Nodes that must not take part, because they have another configuration, another build, or a wrong certificate.

use std::{
    fs,
    io::{Read as _, Write as _},
    net::TcpStream,
    path::Path,
    sync::Arc,
};

use steradian::service::proto;
use testkit::free_port;

use crate::{
    certificates::Authority,
    processes::{Process, configuration},
};

const NODES: [&str; 2] = ["left", "right"];
const TLS: &str = "tls = { ca = 'ca.pem', certificate = '{name}.pem', key = '{name}.key' }\nreal_time = false";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_configuration_is_refused_with_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = configuration(folder, &NODES, &[format!("tcp/127.0.0.1:{}", free_port())], "");
    fs::write(folder.join("other.toml"), text.replace("[64, 48]", "[64, 40]")).unwrap();
    let director = Process::director(folder);
    let _left = Process::node(folder, "left");
    let right = Process::spawn(folder, "other.toml", &["--role", "node", "--node", "right"]);
    let stats = director.stats_when("refused", |cluster| cluster.nodes[1].state == "refused").await;
    assert!(stats.nodes[1].refused > 0 && stats.counts["refused"] > 0);
    assert!(stats.nodes[1].reason.contains("configuration"), "{stats:#?}");
    director.wait_for_log("node `right` is refused: the node has another configuration");
    right.wait_for_log("the director refuses this node: the node has another configuration");
    right.stats_when("refused", |cluster| cluster.state == "refused" && !cluster.reason.is_empty()).await;
    // With the right configuration, the node takes part.
    drop(right);
    let _right = Process::node(folder, "right");
    director.all_in().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_version_is_refused_with_both_versions() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    configuration(folder, &NODES, &[format!("tcp/127.0.0.1:{}", free_port())], "");
    // A copy of the program with additional bytes at its end counts as another build.
    let other = folder.join("other");
    fs::copy(env!("CARGO_BIN_EXE_steradian"), &other).unwrap();
    fs::OpenOptions::new().append(true).open(&other).unwrap().write_all(b"another build").unwrap();
    let director = Process::director(folder);
    let _left = Process::node(folder, "left");
    let arguments = ["--role", "node", "--node", "right"];
    let right = Process::spawn_program(other.to_str().unwrap(), folder, "cluster.toml", &arguments);
    let stats = director.stats_when("refused", |cluster| cluster.nodes[1].state == "refused").await;
    assert!(stats.nodes[1].refused > 0 && stats.counts["refused"] > 0);
    assert!(stats.nodes[1].reason.contains("the node is Steradian"), "{stats:#?}");
    assert_ne!(stats.nodes[1].version, stats.version);
    director.wait_for_log("node `right` is refused: the node is Steradian");
    right.wait_for_log("the director refuses this node: the node is Steradian");
}

/// Opens a connection without a certificate. The director must end it.
fn without_certificate(folder: &Path, port: u16) {
    use rustls::pki_types::{CertificateDer, ServerName, pem::PemObject as _};
    let mut roots = rustls::RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(folder.join("ca.pem")).unwrap()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let config = config.with_root_certificates(roots).with_no_client_auth();
    let name = ServerName::try_from("127.0.0.1").unwrap();
    let mut connection = rustls::ClientConnection::new(Arc::new(config), name).unwrap();
    let mut socket = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let mut stream = rustls::Stream::new(&mut connection, &mut socket);
    let answer = stream.write_all(b"hello").and_then(|()| stream.read(&mut [0; 8]));
    assert!(answer.is_err(), "{answer:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn certificates_of_the_authority_lead_and_others_are_counted_and_named() {
    let (folder, port) = (tempfile::tempdir().unwrap(), free_port());
    let folder = folder.path();
    configuration(folder, &NODES, &[format!("tls/127.0.0.1:{port}")], TLS);
    let (own, foreign) = (Authority::new("dome"), Authority::new("other"));
    own.write(folder);
    for name in ["director", "left", "right"] {
        own.issue(folder, name, name);
    }
    let director = Process::director(folder);
    let left = Process::node(folder, "left");
    director.stats_when("left is known", |cluster| cluster.nodes[0].state == "out").await;
    // Node `right` has the certificate of another node: the director does not accept its HELLO, and names the certificate.
    own.issue(folder, "right", "left");
    let wrong = Process::node(folder, "right");
    let denied = |cluster: &proto::ClusterStats| cluster.counts["refused_certificates"] > 2;
    let stats = director.stats_when("denied", denied).await;
    assert_eq!(stats.nodes[1].state, "absent", "{stats:#?}");
    assert!(stats.nodes[1].refused > 2 && stats.nodes[1].reason.contains("certificate of `left`"), "{stats:#?}");
    assert_eq!((stats.nodes[0].refused, stats.counts["refused_handshakes"]), (0, 0), "{stats:#?}");
    director.wait_for_log("a process with the certificate of `left` says that it is node `right`");
    wrong.stats_when("looking", |cluster| cluster.state == "looking").await;
    drop(wrong);
    // Node `right` has a certificate of another authority: both sides report the reason.
    foreign.issue(folder, "right", "right");
    let wrong = Process::node(folder, "right");
    let failed = |cluster: &proto::ClusterStats| cluster.counts["refused_handshakes"] > 2;
    let stats = director.stats_when("failed handshakes", failed).await;
    assert_eq!(stats.nodes[1].state, "absent", "{stats:#?}");
    assert!(stats.reason.contains("UnknownIssuer"), "{stats:#?}");
    director.wait_for_log("a connection was refused, ");
    let failed = |cluster: &proto::ClusterStats| cluster.counts["refused_connections"] > 2;
    let stats = wrong.stats_when("refused", failed).await;
    assert!(stats.state == "looking" && stats.reason.contains("UnknownCA"), "{stats:#?}");
    drop(wrong);
    // Connect without TLS, and with TLS but without a certificate.
    let before = director.stats_when("counted", |_| true).await.counts["refused_handshakes"];
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.write_all(b"not a handshake of TLS").unwrap();
    let more = |cluster: &proto::ClusterStats| cluster.counts["refused_handshakes"] > before;
    director.stats_when("one more", more).await;
    without_certificate(folder, port);
    let none = |cluster: &proto::ClusterStats| cluster.reason.contains("no certificates");
    director.stats_when("without a certificate", none).await;
    own.issue(folder, "right", "right");
    let _right = Process::node(folder, "right");
    director.all_in().await;
    drop(left);
}
