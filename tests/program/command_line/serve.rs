//! `serve` and `token`: arguments, access control, start and end.

use super::*;

/// The daemon, killed on drop.
struct Daemon(std::process::Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        // The daemon may have ended already, as in most tests.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn token_is_printed_with_its_configuration_lines() {
    let folder = tempfile::tempdir().unwrap();
    let (out, _) = run(folder.path(), &["token", "--name", "desk \"1\"", "--role", "steer"], 0);
    let (token, lines) = out.split_once("\n\n").unwrap();
    let digest: String = steradian::service::digest_of(token).iter().map(|byte| format!("{byte:02x}")).collect();
    assert!(token.starts_with("steradian_") && lines.contains(&digest) && !lines.contains(token), "{lines}");
    let path = folder.path().join("views.toml");
    std::fs::write(&path, lines).unwrap();
    let tokens = steradian::config::Config::load(&path, &[]).unwrap().server.tokens;
    assert_eq!((tokens[0].name.as_str(), tokens[0].role), ("desk \"1\"", steradian::config::Role::Steer));
    for (name, shown) in [("", "``"), ("a\nb\"", "`a\\nb\\\"`"), (&*"x".repeat(65), "64 characters")] {
        let (out, err) = run(folder.path(), &["token", "--name", name, "--role", "steer"], 64);
        assert!(
            out.is_empty() && err.contains(shown) && err.contains("must have between 1 and 64 characters"),
            "{err}"
        );
    }
    let (_, err) = run(folder.path(), &["token", "--name", "desk", "--role", "chief"], 64);
    assert!(err.contains("view, steer or admin"), "{err}");
}

#[test]
fn serve_refuses_to_start_without_access_control() {
    let folder = tempfile::tempdir().unwrap();
    for (set, part) in [
        ("server.listen=\"0.0.0.0:0\"", "[server.tls]"),
        ("server.tokens=[{ name = \"a\", role = \"view\", sha256 = \"secret\" }]", "64 hexadecimal digits"),
        ("server.tls={ certificate = \"none.pem\", key = \"none.key\" }", "none.pem"),
    ] {
        let (_, err) = run(folder.path(), &["serve", "--set", set], 64);
        assert!(err.contains(part), "{err}");
    }
}

#[cfg(unix)]
#[test]
fn serve_prints_its_address_and_exits_0_on_sigterm_and_sigint() {
    use std::io::{BufRead, BufReader, Read};
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sky.toml"), SCENE).unwrap();
    for signal in ["TERM", "INT"] {
        let child = Command::new(env!("CARGO_BIN_EXE_steradian"))
            .args(["serve", "--config", "sky.toml", "--listen", "127.0.0.1:0"])
            .current_dir(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut daemon = Daemon(child);
        let mut out = BufReader::new(daemon.0.stdout.take().unwrap());
        let mut line = String::new();
        out.read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line}"));
        std::net::TcpStream::connect(address).unwrap();
        let kill = Command::new("kill").args(["-s", signal, &daemon.0.id().to_string()]).status().unwrap();
        assert!(kill.success());
        assert_eq!(daemon.0.wait().unwrap().code(), Some(0), "SIG{signal}");
        let mut rest = String::new();
        out.read_to_string(&mut rest).unwrap();
        assert!(rest.is_empty(), "{rest}");
    }
}

/// A SIGHUP that arrives before the daemon serves is kept for later. Its default action would end the process.
#[cfg(unix)]
#[test]
fn sighup_during_the_start_is_remembered() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sky.toml"), SCENE).unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["--log", "info", "serve", "--config", "sky.toml", "--listen", "127.0.0.1:0"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut daemon = Daemon(child);
    let mut log = BufReader::new(daemon.0.stderr.take().unwrap());
    let mut wait_for = |text: &str| {
        let mut line = String::new();
        while !line.contains(text) {
            line.clear();
            assert!(log.read_line(&mut line).unwrap() > 0, "the log ends without `{text}`");
        }
    };
    let signal = |name: &str| Command::new("kill").args(["-s", name, &daemon.0.id().to_string()]).status().unwrap();
    wait_for("starting on");
    assert!(signal("HUP").success());
    wait_for("reloaded the access rules");
    assert!(signal("TERM").success());
    assert_eq!(daemon.0.wait().unwrap().code(), Some(0));
}

#[test]
fn serve_refuses_invalid_arguments() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sky.toml"), SCENE).unwrap();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = listener.local_addr().unwrap().to_string();
    for (arguments, code, part) in [
        (&["--listen", "nowhere"][..], 64, "127.0.0.1:7143"),
        (&["--config", "missing.toml"], 64, "missing.toml"),
        (&["--config", "sky.toml", "--set", "server.listen=nowhere"], 64, "server.listen"),
        (&["--config", "sky.toml", "--adapter", "no such adapter"], 69, "no such adapter"),
        (&["--config", "sky.toml", "--listen", &taken], 1, "in use"),
    ] {
        let (out, err) = run(folder.path(), &[&["serve"], arguments].concat(), code);
        assert!(out.is_empty() && err.contains(part), "{err}");
    }
    drop(listener);
}
