//! Access control: authentication and roles.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, DnType, IsCa, KeyPair, date_time_ymd};
use steradian::{
    config::{Role, ServerConfig},
    service::{
        Access, Address, CameraUpdate, Client, ClientError, Credentials, Lease, Reloads, SceneUpdate, ServeError,
        ServeOptions, digest_of, run,
    },
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    sync::mpsc,
};
use tonic::Code;

use crate::{
    daemon::{Daemon, TestEngine, small_rig, within},
    rig::round,
};

/// A certificate authority and its certificates, as files in a folder.
struct Files {
    folder: tempfile::TempDir,
    authority: CertifiedIssuer<'static, KeyPair>,
}

impl Files {
    fn new() -> Self {
        let mut params = CertificateParams::new([]).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, "authority");
        let authority = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
        let files = Self { folder: tempfile::tempdir().unwrap(), authority };
        fs::write(files.path("authority.pem"), files.authority.pem()).unwrap();
        let [certificate, key] = files.signed("127.0.0.1", false);
        fs::write(files.path("server.pem"), certificate).unwrap();
        fs::write(files.path("server.key"), key).unwrap();
        files
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns a certificate and its key as PEM.
    fn signed(&self, name: &str, is_expired: bool) -> [String; 2] {
        let mut params = CertificateParams::new([name.to_owned()]).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        if is_expired {
            params.not_before = date_time_ymd(2020, 1, 1);
            params.not_after = date_time_ymd(2021, 1, 1);
        }
        let key = KeyPair::generate().unwrap();
        [params.signed_by(&key, &self.authority).unwrap().pem(), key.serialize_pem()]
    }

    /// Returns a client's certificate and its key; writes the certificate to a file too.
    fn client(&self, name: &str, is_expired: bool) -> [String; 2] {
        let both = self.signed(name, is_expired);
        fs::write(self.path(&format!("{name}.pem")), &both[0]).unwrap();
        both
    }

    fn write(&self, server: &str) {
        fs::write(self.path("new.toml"), server).unwrap();
        fs::rename(self.path("new.toml"), self.path("server.toml")).unwrap();
    }

    /// Returns a source that, on each call, reads the file that was written last.
    fn source(&self) -> steradian::service::AccessSource {
        let folder = self.folder.path().to_owned();
        Arc::new(move || Access::from_config(&configured(&folder)?, &folder))
    }

    fn credentials(&self) -> Credentials {
        Credentials { authorities: Some(self.authority.pem()), ..Credentials::default() }
    }
}

fn configured(folder: &Path) -> Result<ServerConfig, String> {
    let text = fs::read_to_string(folder.join("server.toml")).map_err(|error| error.to_string())?;
    toml::from_str(&text).map_err(|error| error.to_string())
}

fn token_of(name: &str, role: Role, token: &str) -> String {
    let digest: String = digest_of(token).iter().map(|byte| format!("{byte:02x}")).collect();
    format!("[[tokens]]\nname = \"{name}\"\nrole = \"{role}\"\nsha256 = \"{digest}\"\n")
}

const TLS: &str = "tls = { certificate = \"server.pem\", key = \"server.key\", client_ca = \"authority.pem\" }\n";

/// Starts a daemon with all roles over TLS, and returns the trigger to reload the roles.
async fn start(files: &Files) -> (Daemon, mpsc::Sender<()>) {
    let (reload, reloads) = mpsc::channel(1);
    let source = files.source();
    let daemon = Daemon::start_with(small_rig(), |options| {
        options.network.access = Some(source);
        options.reloads = Reloads::When(reloads);
    })
    .await;
    (daemon, reload)
}

async fn connect(daemon: &Daemon, credentials: &Credentials) -> Result<Client, ClientError> {
    Client::connect_as(&format!("https://{}", daemon.address), credentials).await
}

fn code<T>(answer: Result<T, ClientError>) -> Option<Code> {
    answer.err().map(|error| error.code().unwrap_or_else(|| panic!("{error}")))
}

/// Makes calls that need the roles `view`, `steer` and `admin`; returns their results.
async fn gets(client: &mut Client) -> [Option<Code>; 3] {
    let pose = CameraUpdate { position_m: Some([1.0, 0.0, 0.0]), ..CameraUpdate::default() };
    let looks = code(client.camera().await);
    let steers = code(client.set_camera(&pose).await);
    // There is no state file, so the snapshot call fails even with the role.
    let checks = code(client.load_snapshot("none", None).await);
    [looks, steers, checks]
}

const ALL: [Option<Code>; 3] = [None, None, Some(Code::FailedPrecondition)];
const NOTHING: [Option<Code>; 3] = [Some(Code::Unauthenticated); 3];
const DENIED: Option<Code> = Some(Code::PermissionDenied);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn only_tokens_and_certificates_give_access_with_their_roles() {
    let files = Files::new();
    let [desk, stranger, old] =
        [("desk", false), ("stranger", false), ("old", true)].map(|(name, expired)| files.client(name, expired));
    let certificate = |name: &str| {
        format!("[[certificates]]\nname = \"{name} by certificate\"\nrole = \"admin\"\nfile = \"{name}.pem\"\n")
    };
    files.write(
        &[
            TLS.to_owned(),
            token_of("viewer", Role::View, "look"),
            token_of("pilot", Role::Steer, "steer"),
            token_of("chief", Role::Admin, "everything"),
            certificate("desk"),
            certificate("old"),
        ]
        .concat(),
    );
    let (daemon, _reload) = start(&files).await;
    let with_token = |token: &str| Credentials { token: Some(token.to_owned()), ..files.credentials() };
    let with =
        |certificate: &[String; 2]| Credentials { certificate: Some(certificate.clone()), ..files.credentials() };
    for (credentials, expected) in [
        (with_token("look"), [None, DENIED, DENIED]),
        (with_token("steer"), [None, None, DENIED]),
        (with_token("everything"), ALL),
        (with_token("wrong"), NOTHING),
        (files.credentials(), NOTHING),
        (with(&desk), ALL),
        // This certificate is signed by the authority, but not listed.
        (with(&stranger), NOTHING),
        // A token takes precedence over the certificate of the connection.
        (Credentials { token: Some("look".to_owned()), ..with(&desk) }, [None, DENIED, DENIED]),
    ] {
        let mut client = connect(&daemon, &credentials).await.unwrap();
        assert_eq!(gets(&mut client).await, expected, "{credentials:?}");
    }
    // The messages state the required role.
    let mut viewer = connect(&daemon, &with_token("look")).await.unwrap();
    let error = viewer.update_scene(&SceneUpdate::default(), None).await.unwrap_err().to_string();
    assert!(error.contains("`viewer` has the role view") && error.contains("needs steer"), "{error}");
    let made = viewer.create_view(&round("dome", 8), None).await.map(drop);
    for refused in [made, viewer.delete_view("flat", None).await.map(drop)] {
        let error = refused.unwrap_err();
        assert!(error.code() == Some(Code::PermissionDenied) && error.to_string().contains("needs steer"), "{error}");
    }
    assert_eq!(viewer.views().await.unwrap().len(), 2);

    // An expired certificate, an unknown authority and an unencrypted connection are refused.
    for credentials in
        [with(&old), Credentials { authorities: Some(Files::new().authority.pem()), ..Credentials::default() }]
    {
        let end = match connect(&daemon, &credentials).await {
            Ok(mut client) => client.camera().await.map(drop),
            Err(error) => Err(error),
        };
        let error = end.expect_err("the connection is refused");
        assert_ne!(error.code(), Some(Code::Unauthenticated), "{error}");
    }
    let plain = Client::connect(&format!("http://{}", daemon.address)).await;
    match plain {
        Ok(mut client) => assert!(client.camera().await.is_err()),
        Err(error) => assert!(error.to_string().contains("cannot connect"), "{error}"),
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn replacing_a_token_ends_its_calls() {
    let files = Files::new();
    files.write(
        &[TLS.to_owned(), token_of("pilot", Role::Steer, "first"), token_of("other", Role::View, "stays")].concat(),
    );
    let (daemon, reload) = start(&files).await;
    let with_token = |token: &str| Credentials { token: Some(token.to_owned()), ..files.credentials() };
    let mut first = connect(&daemon, &with_token("first")).await.unwrap();
    let mut other = connect(&daemon, &with_token("stays")).await.unwrap();
    let mut cameras = first.watch_camera().await.unwrap();
    let mut cameras_of_other = other.watch_camera().await.unwrap();
    cameras.next().await.unwrap().unwrap();
    let mut steering = first.steer(Lease::Take, "pilot").await.unwrap();
    assert!(steering.send(&CameraUpdate { position_m: Some([3.0; 3]), ..CameraUpdate::default() }).await);

    // An unreadable file leaves everything unchanged.
    let good = fs::read_to_string(files.path("server.toml")).unwrap();
    for bad in ["tokens = 3", "", TLS] {
        files.write(bad);
        reload.send(()).await.unwrap();
        // When the channel has room again, the daemon has received the previous request to reload.
        drop(reload.reserve().await.unwrap());
        first.camera().await.unwrap();
    }

    files.write(&good.replace(&token_of("pilot", Role::Steer, "first"), &token_of("pilot", Role::Steer, "second")));
    reload.send(()).await.unwrap();
    let ended = loop {
        match within(cameras.next()).await {
            Ok(Some(_)) => {}
            ended => break ended.map(drop),
        }
    };
    assert_eq!(code(ended), Some(Code::Unauthenticated));
    let end = within(steering.end()).await;
    assert_eq!(end.as_ref().err().and_then(ClientError::code), Some(Code::Unauthenticated), "{end:?}");
    assert_eq!(code(first.camera().await), Some(Code::Unauthenticated));
    let mut second = connect(&daemon, &with_token("second")).await.unwrap();
    // The lease of the call that was ended is free again.
    second.set_camera(&CameraUpdate { position_m: Some([4.0; 3]), ..CameraUpdate::default() }).await.unwrap();
    while within(cameras_of_other.next()).await.unwrap().expect("a camera").position_m.x != 4.0 {}
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn only_the_page_is_served_without_a_token() {
    let files = Files::new();
    // The daemon serves without encryption on the loopback address, as behind an encrypting proxy.
    files.write(&token_of("viewer", Role::View, "look"));
    let source = files.source();
    let daemon = Daemon::start_with(small_rig(), |options| options.network.access = Some(source)).await;
    for (path, more, status) in [
        ("/", "", "200"),
        ("/page.js", "", "200"),
        ("/metrics", "", "401"),
        ("/elsewhere", "", "401"),
        ("/metrics", "authorization: Bearer wrong\r\n", "401"),
        ("/metrics", "authorization: Bearer look\r\n", "200"),
        ("/elsewhere", "authorization: Bearer look\r\n", "404"),
    ] {
        let mut socket = TcpStream::connect(daemon.address).await.unwrap();
        let head = format!("GET {path} HTTP/1.1\r\nhost: {}\r\n{more}connection: close\r\n\r\n", daemon.address);
        socket.write_all(head.as_bytes()).await.unwrap();
        let mut answer = String::new();
        within(socket.read_to_string(&mut answer)).await.unwrap();
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{path} {more}: {answer}");
        assert_eq!(answer.to_ascii_lowercase().contains("www-authenticate: bearer"), status == "401");
    }
    // If a plain request names a host that is not this daemon's, the answer has a status that probes understand and a
    // text that people understand.
    for path in ["/", "/metrics", "/healthz"] {
        let mut socket = TcpStream::connect(daemon.address).await.unwrap();
        let head = format!("GET {path} HTTP/1.1\r\nhost: control.example.org\r\nconnection: close\r\n\r\n");
        socket.write_all(head.as_bytes()).await.unwrap();
        let mut answer = String::new();
        within(socket.read_to_string(&mut answer)).await.unwrap();
        assert!(
            answer.starts_with("HTTP/1.1 403 ") && answer.contains("must be one of server.hosts"),
            "{path}: {answer}"
        );
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn network_addresses_need_tls_and_named_clients() {
    let never = |address: Address| panic!("ready on {address}");
    let files = Files::new();
    let all = [TLS.to_owned(), token_of("viewer", Role::View, "look")].concat();
    for (server, parts) in [
        ("", ["[server.tls]", "[[server.tokens]]"]),
        (TLS, ["no [[server.tokens]]", "so that not every client"]),
        (&token_of("viewer", Role::View, "look"), ["no [server.tls]", "are encrypted"]),
        (&all.replace("server.key", "none.key"), ["none.key", "server.tls.key"]),
        (&all.replace("server.key", "server.pem"), ["server.pem", "private key"]),
        (
            &format!("{all}[[certificates]]\nname = \"a\"\nrole = \"view\"\nfile = \"none.pem\"\n"),
            ["none.pem", "server.certificates.file"],
        ),
    ] {
        files.write(server);
        let engine = Box::new(TestEngine::new(Default::default()));
        let scene = steradian::scene::SceneSnapshot {
            revision: 0,
            stars: Default::default(),
            objects: Default::default(),
            camera: Default::default(),
        };
        let mut options = ServeOptions::new("0.0.0.0:0", engine, scene, small_rig(), Default::default(), never);
        options.network.access = Some(files.source());
        let error = within(run(options)).await.unwrap_err();
        assert!(matches!(error, ServeError::Open { .. } | ServeError::Access(_)));
        let error = error.to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_unix_socket_is_protected_by_file_permissions() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt};
    let files = Files::new();
    files.write(&token_of("viewer", Role::View, "look"));
    let path = files.path("socket");
    let listen = format!("unix:{}", path.display());
    for _ in 0..2 {
        let (source, listen) = (files.source(), listen.clone());
        let daemon = Daemon::start_with(small_rig(), |options| {
            options.network.listen = listen;
            options.network.access = Some(source);
        })
        .await;
        assert_eq!(daemon.listening, Address::Unix(path.clone()));
        let metadata = fs::metadata(&path).unwrap();
        assert!(metadata.file_type().is_socket() && metadata.permissions().mode() & 0o777 == 0o660);
        let mut client = Client::connect(&format!("unix:{}", path.display())).await.unwrap();
        assert_eq!(gets(&mut client).await, ALL);
        // A second daemon on the socket is refused.
        let engine = Box::new(TestEngine::new(Default::default()));
        let scene = steradian::scene::SceneSnapshot {
            revision: 0,
            stars: Default::default(),
            objects: Default::default(),
            camera: Default::default(),
        };
        let twin =
            ServeOptions::new(daemon.listening.to_string(), engine, scene, small_rig(), Default::default(), |_| {});
        assert!(matches!(within(run(twin)).await, Err(ServeError::AddressInUse { .. })));
        drop(client);
        daemon.shutdown().await.unwrap();
        assert!(!path.exists());
        // A killed daemon leaves its socket behind.
        drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
        assert!(path.exists());
    }
}

/// Sends a request to the socket of a daemon; returns the answer.
async fn over_socket(path: &Path, request: &str) -> String {
    let mut socket = tokio::net::UnixStream::connect(path).await.unwrap();
    socket
        .write_all(format!("{request} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").as_bytes())
        .await
        .unwrap();
    let mut answer = String::new();
    within(socket.read_to_string(&mut answer)).await.unwrap();
    answer
}

/// Returns the days until the certificate of a daemon expires, from its metrics.
async fn days_left(path: &Path) -> f64 {
    let text = over_socket(path, "GET /metrics").await;
    let line = text.lines().find_map(|line| line.strip_prefix("steradian_certificate_expiry_seconds "));
    line.unwrap_or_else(|| panic!("{text}")).parse::<f64>().unwrap() / 86_400.0
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_certificate_that_is_not_valid_is_refused_at_a_reload() {
    let files = Files::new();
    files.write(&format!("{TLS}{}", token_of("viewer", Role::View, "look")));
    let path = files.path("socket");
    let listen = format!("unix:{}", path.display());
    let (reload, reloads) = mpsc::channel(1);
    let source = files.source();
    let daemon = Daemon::start_with(small_rig(), |options| {
        options.network.listen = listen;
        options.network.access = Some(source);
        options.reloads = Reloads::When(reloads);
    })
    .await;
    let first = days_left(&path).await;
    assert!(first > 1e5, "{first}");
    let put = |from: rcgen::CertificateParams| {
        let key = KeyPair::generate().unwrap();
        fs::write(files.path("server.pem"), from.signed_by(&key, &files.authority).unwrap().pem()).unwrap();
        fs::write(files.path("server.key"), key.serialize_pem()).unwrap();
    };
    let params = |years: [i32; 2]| {
        let mut params = CertificateParams::new(["127.0.0.1".to_owned()]).unwrap();
        params.not_before = date_time_ymd(years[0], 1, 1);
        params.not_after = date_time_ymd(years[1], 1, 1);
        params
    };
    // An expired certificate and one that is not valid yet change nothing; a valid one takes effect. Reloads happen in
    // the order of their requests.
    for years in [[2020, 2021], [2500, 2600]] {
        put(params(years));
        reload.send(()).await.unwrap();
        // The channel holds one request, so when the second one has been sent, the first reload has begun.
        reload.send(()).await.unwrap();
        assert!((days_left(&path).await - first).abs() < 1.0);
    }
    tokio::time::sleep(std::time::Duration::from_millis(200)).await;
    assert!((days_left(&path).await - first).abs() < 1.0, "the old certificate stays");
    put(params([2020, 3000]));
    reload.send(()).await.unwrap();
    within(async { while (days_left(&path).await - first).abs() < 1.0 {} }).await;
    let second = days_left(&path).await;
    assert!(second > 1e5 && second < first, "{second}");
    daemon.shutdown().await.unwrap();

    // At the start, an expired certificate causes only a warning, because the socket needs no certificate.
    put(params([2020, 2021]));
    let (source, listen) = (files.source(), format!("unix:{}", path.display()));
    let daemon = Daemon::start_with(small_rig(), |options| {
        options.network.listen = listen;
        options.network.access = Some(source);
    })
    .await;
    assert!(days_left(&path).await < -1000.0);
    daemon.shutdown().await.unwrap();
}

/// A new certificate that lacks a host of `server.hosts` would lock out all clients that use this name.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_certificate_that_lacks_a_named_host_is_refused_at_a_reload() {
    let files = Files::new();
    let rules = |token: &str| {
        let hosts = "hosts = ['dome.example.org', 'new.example.org']\n";
        files.write(&format!("{hosts}{TLS}{}", token_of("viewer", Role::View, token)));
    };
    rules("look");
    let put = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let key = KeyPair::generate().unwrap();
        let params = CertificateParams::new(names).unwrap();
        fs::write(files.path("server.pem"), params.signed_by(&key, &files.authority).unwrap().pem()).unwrap();
        fs::write(files.path("server.key"), key.serialize_pem()).unwrap();
    };
    // A name that the first certificate lacks causes only a warning.
    put(&["127.0.0.1", "dome.example.org"]);
    let access = files.source()().unwrap();
    assert_eq!(
        (&access.certified_hosts[..], &access.uncertified_hosts[..]),
        (&["dome.example.org".to_owned()][..], &["new.example.org".to_owned()][..])
    );
    let (daemon, reload) = start(&files).await;
    let with = |token: &str| Credentials { token: Some(token.to_owned()), ..files.credentials() };
    connect(&daemon, &with("look")).await.unwrap().camera().await.unwrap();
    put(&["127.0.0.1", "other.example.org"]);
    rules("other");
    for _ in 0..2 {
        reload.send(()).await.unwrap();
    }
    tokio::time::sleep(std::time::Duration::from_millis(300)).await;
    connect(&daemon, &with("look")).await.unwrap().camera().await.unwrap();
    // A wildcard covers the name.
    put(&["127.0.0.1", "*.example.org"]);
    reload.send(()).await.unwrap();
    within(async {
        loop {
            let Ok(mut client) = connect(&daemon, &with("other")).await else { continue };
            if client.camera().await.is_ok() {
                return;
            }
        }
    })
    .await;
    daemon.shutdown().await.unwrap();
}
