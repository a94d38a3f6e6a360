//! `film record`: compares the recorded path of a camera with the curve along which a client moved it.

use std::f64::consts::TAU;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use steradian::config::FilmPath;
use steradian::output::film::FilmTracks;
use steradian::service::{CameraUpdate, Client, SceneUpdate};

use super::daemon::Daemon;

/// Centre (m), radius (m) and rate of the camera's movement.
const CENTRE_M: DVec3 = DVec3::new(4e9, -2e9, 1e9);
const RADIUS_M: f64 = 1e9;
const RATE_RAD_S: f64 = 0.5;
const FPS: f64 = 24.0;

/// Starts a recording and waits until it has begun.
fn record(folder: &Path, address: &str, arguments: &[&str]) -> Child {
    let mut process = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["film", "record", "--address", address, "--out", "path.toml", "--fps", "24"])
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut byte = [0];
    // Read byte by byte, so that the caller can read the rest of the output.
    let out = process.stdout.as_mut().unwrap();
    while !line.ends_with('\n') && out.read(&mut byte).unwrap() == 1 {
        line.push(char::from(byte[0]));
    }
    assert_eq!(line, "recording\n");
    process
}

fn pose(angle_rad: f64) -> (DVec3, DQuat) {
    (CENTRE_M + DQuat::from_rotation_z(angle_rad) * DVec3::X * RADIUS_M, DQuat::from_rotation_z(angle_rad))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn recorded_path_follows_the_curve_of_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let mut daemon = Daemon::start(folder.path(), "builtin:bright");
    let address = daemon.address();
    let mut client = Client::connect(&format!("http://{address}")).await.unwrap();
    let recording = record(folder.path(), &address, &["--seconds", "4", "--keyframes-per-second", "12"]);
    let start = Instant::now();
    let mut next_limit = false;
    while start.elapsed() < Duration::from_millis(3600) {
        let (position_m, turn) = pose(RATE_RAD_S * start.elapsed().as_secs_f64());
        let position_m = Some(position_m.to_array());
        let update = CameraUpdate { position_m, orientation: Some(turn.to_array()), ..CameraUpdate::default() };
        client.set_camera(&update).await.unwrap();
        if start.elapsed() > Duration::from_millis(1800) && !std::mem::replace(&mut next_limit, true) {
            let update = SceneUpdate { magnitude_limit: Some(5.5), ..SceneUpdate::default() };
            client.update_scene(&update, None).await.unwrap();
        }
        tokio::time::sleep(Duration::from_millis(8)).await;
    }
    let ended = recording.wait_with_output().unwrap();
    let log = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(0), "{log}");
    let path = FilmPath::load(&folder.path().join("path.toml")).unwrap();
    assert_eq!(path.fps, FPS);
    let tracks = FilmTracks::new(&path);
    // Whenever exactly the recording starts, the camera moves at least from 0.2 to 3.4 s of it.
    let (mut out_of_circle, mut turned) = (0.0_f64, 0.0_f64);
    let mut angles_rad = Vec::new();
    for frame in 12..78 {
        let values = tracks.at(frame);
        let from_centre_m = values.position_m.unwrap() - CENTRE_M;
        let angle_rad = from_centre_m.y.atan2(from_centre_m.x).rem_euclid(TAU);
        out_of_circle = out_of_circle.max((from_centre_m.length() / RADIUS_M - 1.0).abs());
        turned = turned.max(values.frame_from_camera.unwrap().angle_between(DQuat::from_rotation_z(angle_rad)));
        angles_rad.push(angle_rad - RATE_RAD_S * f64::from(frame) / FPS);
    }
    let mean_rad = angles_rad.iter().sum::<f64>() / angles_rad.len() as f64;
    let off_s = angles_rad.iter().map(|angle| (angle - mean_rad).abs() / RATE_RAD_S).fold(0.0, f64::max);
    println!(
        "{} keyframes: distance {out_of_circle:.1e}, orientation {turned:.1e} rad, time {off_s:.4} s at most",
        path.keyframes.len()
    );
    // Measured: 1.2e-4 for the distance, 1.8e-6 rad for the orientation. Times are those at which the poses arrive,
    // which are accurate to 10 ms.
    assert!(out_of_circle < 5e-4 && turned < 1e-5, "{out_of_circle} {turned}");
    assert!(off_s < 0.2, "{off_s} s");
    let limits: Vec<f64> = (0..96).map(|frame| tracks.at(frame).magnitude_limit.unwrap()).collect();
    assert!(limits[20] > 5.5 && limits[70] == 5.5, "{limits:?}");

    // An existing file is not replaced unless an option requests it. If the daemon ends during a recording, the
    // recording is written.
    let refused = |arguments: &[&str], part: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
            .args(["film", "record", "--address", &address])
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let log = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(64) && log.contains(part), "{:?} {log}", output.status);
    };
    refused(&["--out", "path.toml"], "--overwrite");
    refused(&["--out", "none/path.toml"], "does not exist");
    refused(&["--out", "a.toml", "--view", "nobody"], "`nobody`, valid names: all");
    refused(&["--out", "a.toml", "--keyframes-per-second", "60"], "--fps");
    let recording = record(folder.path(), &address, &["--overwrite"]);
    tokio::time::sleep(Duration::from_millis(300)).await;
    drop(client);
    let (code, ..) = daemon.terminate();
    assert_eq!(code, Some(0));
    let ended = recording.wait_with_output().unwrap();
    let log = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.code() == Some(0) && log.contains("shut down"), "{log}");
    let rests = FilmPath::load(&folder.path().join("path.toml")).unwrap();
    assert_eq!(rests.keyframes.len(), 1, "the camera did not move: {rests:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn broken_connection_ends_and_writes_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut daemon = Daemon::start(folder.path(), "builtin:bright");
    let address = daemon.address();
    let mut client = Client::connect(&format!("http://{address}")).await.unwrap();
    let recording = record(folder.path(), &address, &[]);
    for step in 0..20 {
        let (position_m, _) = pose(0.1 * f64::from(step));
        let update = CameraUpdate { position_m: Some(position_m.to_array()), ..CameraUpdate::default() };
        client.set_camera(&update).await.unwrap();
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    // Kill the daemon without a shutdown.
    drop(daemon);
    let ended = recording.wait_with_output().unwrap();
    let log = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(1), "{log}");
    assert!(log.contains("connection was lost after"), "{log}");
    let path = FilmPath::load(&folder.path().join("path.toml")).unwrap();
    assert!(path.keyframes.len() > 2, "{path:?}");
    let unreachable = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["film", "record", "--address", &address, "--out", "other.toml"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(unreachable.status.code(), Some(1));
    let log = String::from_utf8_lossy(&unreachable.stderr);
    assert!(log.contains("cannot connect") && log.contains("refused") && !log.contains("transport error"), "{log}");
    let without_port = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["film", "record", "--address", "127.0.0.1", "--out", "other.toml"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let log = String::from_utf8_lossy(&without_port.stderr);
    assert!(without_port.status.code() == Some(64) && log.contains("HOST:PORT"), "{:?} {log}", without_port.status);
    let mut text = String::new();
    BufReader::new(fs::File::open(folder.path().join("path.toml")).unwrap()).read_line(&mut text).unwrap();
    assert!(text.starts_with("# Recorded from "), "{text}");
}
