//! If a process runs a daemon for its own use, the daemon ends when the process ends, in whatever way this happens.

use std::{
    ffi::OsString,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use steradian::service::{DeliveryError, LocalDaemon};

/// A process that does not end within this time has failed.
const PATIENCE: Duration = Duration::from_secs(60);
const SCENE: &str =
    "[scene]\ncatalogues = ['builtin:bright']\n[[views]]\nname = 'all'\ntype = 'equirectangular'\nsize = [64, 32]\n";

fn configuration(folder: &Path, text: &str) -> PathBuf {
    let file = folder.join("sky.toml");
    std::fs::write(&file, text).unwrap();
    file
}

/// Waits until a condition holds.
fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        thread::sleep(Duration::from_millis(20));
    }
}

/// Returns the state and the parent of a process, from `/proc/PID/stat`.
fn stat(process: u32) -> Option<(String, u32)> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name in brackets may contain spaces.
    let mut words = stat.rsplit_once(')')?.1.split_whitespace();
    Some((words.next()?.to_owned(), words.next()?.parse().ok()?))
}

/// Whether a process runs. A process that has ended may stay in the list until its parent queries its status.
fn runs(process: u32) -> bool {
    stat(process).is_some_and(|(state, _)| state != "Z")
}

fn children(parent: u32) -> Vec<u32> {
    let processes = std::fs::read_dir("/proc").unwrap();
    let processes = processes.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    processes.filter(|process| stat(*process).is_some_and(|(_, of)| of == parent)).collect()
}

#[test]
fn daemon_ends_in_order_when_its_input_closes() {
    let folder = tempfile::tempdir().unwrap();
    let mut daemon = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["serve", "--until-input-closes", "--listen", "127.0.0.1:0", "--config"])
        .arg(configuration(folder.path(), SCENE))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(daemon.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.starts_with("listening on "), "{line}");
    assert!(daemon.try_wait().unwrap().is_none(), "the daemon must serve while its input is open");
    drop(daemon.stdin.take());
    let mut status = None;
    wait_until("the daemon continues although its input is closed", || {
        status = daemon.try_wait().unwrap();
        status.is_some()
    });
    assert!(status.unwrap().success(), "{status:?}");
}

#[test]
fn dropped_daemon_is_killed_and_failed_ones_give_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_steradian"));
    let start = |text: &str, patience| {
        let file = configuration(folder.path(), text);
        let arguments: [OsString; 5] = ["--log".into(), "error".into(), "serve".into(), "--config".into(), file.into()];
        LocalDaemon::start(program, &arguments, patience)
    };
    let daemon = start(SCENE, PATIENCE).unwrap();
    let process = daemon.process_id();
    assert!(daemon.address().starts_with("http://127.0.0.1:") && runs(process));
    drop(daemon);
    assert!(!runs(process), "the process {process} still runs");

    let wrong = start(&SCENE.replace("equirectangular", "equilateral"), PATIENCE).unwrap_err();
    assert!(matches!(&wrong, DeliveryError::NotServing(reason) if reason.contains("equilateral")), "{wrong}");
    let late = start(SCENE, Duration::from_millis(1)).unwrap_err();
    assert!(matches!(late, DeliveryError::Late(_)), "{late}");
}

#[test]
fn killed_chart_leaves_no_daemon() {
    let folder = tempfile::tempdir().unwrap();
    let mut chart = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["--log", "error", "chart", "--quick", "--axis", "live", "--out"])
        .arg(folder.path().join("chart"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut daemons = Vec::new();
    wait_until("the chart did not start a daemon", || {
        daemons = children(chart.id());
        !daemons.is_empty()
    });
    chart.kill().unwrap();
    chart.wait().unwrap();
    wait_until("a daemon still runs after the end of the chart", || !daemons.iter().any(|daemon| runs(*daemon)));
}
