//! Tests the page at `/`, on the same port as the calls.

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
};

use crate::daemon::{Daemon, small_rig, within};

/// Sends a request over HTTP/1.1 with additional header lines; returns head and body of the answer.
async fn request(daemon: &Daemon, method: &str, path: &str, more: &str) -> (String, String) {
    let mut socket = TcpStream::connect(daemon.address).await.unwrap();
    let head = format!("{method} {path} HTTP/1.1\r\nhost: {}\r\n{more}connection: close\r\n\r\n", daemon.address);
    socket.write_all(head.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    within(socket.read_to_end(&mut answer)).await.unwrap();
    let answer = String::from_utf8(answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.to_lowercase(), body.to_owned())
}

/// Returns the value of a header.
fn header<'a>(head: &'a str, name: &str) -> &'a str {
    let value = head.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
    value.unwrap_or_else(|| panic!("no {name} in {head}"))
}

#[tokio::test]
async fn the_page_and_its_files_are_served_with_their_types_and_a_policy() {
    let daemon = Daemon::start(small_rig()).await;
    for (path, mime, text) in [
        ("/", "text/html; charset=utf-8", "<!doctype html>"),
        ("/page.js", "text/javascript; charset=utf-8", "nextFrames"),
        ("/page.css", "text/css; charset=utf-8", "--ground"),
        ("/icon.svg", "image/svg+xml", "<svg"),
    ] {
        let (head, body) = request(&daemon, "GET", path, "").await;
        assert!(head.starts_with("http/1.1 200"), "{path}: {head}");
        assert_eq!(header(&head, "content-type"), mime);
        assert_eq!(header(&head, "content-length"), body.len().to_string(), "{path}");
        assert!(body.contains(text), "{path} has no {text}");
        assert_eq!(header(&head, "x-content-type-options"), "nosniff");
        let policy = header(&head, "content-security-policy");
        assert!(policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"), "{policy}");
        assert!(!policy.contains("unsafe") && !policy.contains("http"), "{policy}");
        // The bundle loads nothing from other origins, and uses nothing that the policy forbids.
        assert!(!body.contains("src=\"http") && !body.contains("url(http"), "{path}");
        // A cached copy is confirmed.
        let etag = header(&head, "etag");
        let (head, body) = request(&daemon, "GET", path, &format!("if-none-match: \"other\", W/{etag}\r\n")).await;
        assert!(head.starts_with("http/1.1 304") && body.is_empty(), "{path}: {head}");
        let (head, body) = request(&daemon, "HEAD", path, "").await;
        assert!(head.starts_with("http/1.1 200") && body.is_empty(), "{path}: {head}");
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn other_paths_are_not_found() {
    let daemon = Daemon::start(small_rig()).await;
    for path in ["/index.html", "/favicon.ico", "/../Cargo.toml", "/%2e%2e/", "//", "/page.js/"] {
        let (head, _) = request(&daemon, "GET", path, "").await;
        assert!(head.starts_with("http/1.1 404"), "{path}: {head}");
        assert_eq!(header(&head, "content-type"), "text/plain; charset=utf-8");
    }
    // The path of a call is not a file of the page, and the page does not accept data.
    let (head, _) = request(&daemon, "GET", "/steradian.v1.ViewService/ListViews", "").await;
    assert!(head.starts_with("http/1.1 404"), "{head}");
    let (head, _) = request(&daemon, "POST", "/", "content-length: 0\r\n").await;
    assert!(!head.starts_with("http/1.1 200"), "{head}");
    daemon.shutdown().await.unwrap();
}
