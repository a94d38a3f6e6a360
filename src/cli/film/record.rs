//! `film record`: follows the camera of a daemon and writes its path.

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use tokio::time::{Instant as TokioInstant, sleep_until};

use super::super::daemon_access::{DaemonAccess, address, uri};
use super::super::numbers::within;
use super::super::{CliError, results};
use crate::config::ExposureKey;
use crate::files;
use crate::output::film::{ObservedScene, Recording};
use crate::plan::settings::{ExposureKeys, ExposureMode};
use crate::service::{self, Client, ClientError, Credentials, SceneForm};

fn fps(text: &str) -> Result<f64, String> {
    within(text, [1.0, 240.0])
}

fn rate(text: &str) -> Result<f64, String> {
    within(text, [0.1, 240.0])
}

fn seconds(text: &str) -> Result<f64, String> {
    within(text, [0.1, 1e6])
}

/// Arguments of `film record`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    steradian film record --address 127.0.0.1:7143 --out path.toml --seconds 60\n\n\
    Prints `recording` when it has begun. SIGINT, SIGTERM or the end of the connection end it: the path recorded\n\
    until then is written.")]
pub struct RecordArguments {
    /// Address of the daemon: HOST:PORT, http://HOST:PORT, https://HOST:PORT or unix:PATH.
    #[arg(long, value_name = "ADDR", value_parser = address)]
    address: String,
    /// Path file to write, TOML.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Duration in seconds. Default: until a signal.
    #[arg(long, value_name = "N", value_parser = seconds, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Keyframes per second, at most --fps.
    #[arg(long, value_name = "R", default_value = "10", value_parser = rate, allow_negative_numbers = true)]
    keyframes_per_second: f64,
    /// Frames per second of the film.
    #[arg(long, value_name = "N", default_value = "30", value_parser = fps, allow_negative_numbers = true)]
    fps: f64,
    /// View whose exposure is recorded. Default: the first view.
    #[arg(long, value_name = "NAME")]
    view: Option<String>,
    #[command(flatten)]
    access: DaemonAccess,
    /// Replace an existing file.
    #[arg(long)]
    overwrite: bool,
}

/// Reason why a recording ended.
enum End {
    /// As requested: the duration has passed, or a signal arrived.
    Requested,
    /// The daemon has shut down.
    Daemon,
    /// The connection broke.
    Lost(ClientError),
}

/// Runs the command.
pub fn run(arguments: &RecordArguments) -> Result<(), CliError> {
    let RecordArguments { out, keyframes_per_second, fps, .. } = arguments;
    if keyframes_per_second > fps {
        return Err(CliError::Usage(format!(
            "--keyframes-per-second {keyframes_per_second}: must be between 0.1 and the {fps} frames per second of --fps"
        )));
    }
    // Check the output file before recording.
    let folder = files::folder_of(out);
    if !folder.is_dir() {
        return Err(CliError::Usage(format!(
            "--out {}: the folder {} does not exist",
            out.display(),
            folder.display()
        )));
    }
    if fs::symlink_metadata(out).is_ok() && !arguments.overwrite {
        let out = out.display();
        return Err(CliError::Usage(format!(
            "--out {out}: the file exists: choose another file, or replace it with --overwrite"
        )));
    }
    let credentials = arguments.access.credentials(&arguments.address)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(CliError::Runtime)?;
    let (recording, end_s, end) = runtime.block_on(record(arguments, &credentials))?;
    let path = recording.end(end_s);
    if path.exposure_omitted {
        tracing::warn!(
            "the exposure changed between manual and automatic, which a path cannot express: the exposure is not recorded"
        );
    }
    // The film lasts as long as the recording, even if the camera did not move at its end.
    let frames = (end_s * fps).floor() as u64 + 1;
    let mut text =
        format!("# Recorded from {} in {end_s:.3} s: frames 0..{frames}\nfps = {fps:?}\n", arguments.address);
    for keyframe in &path.keyframes {
        text.push('\n');
        text.push_str(&keyframe.text().ok_or_else(|| {
            CliError::Record(format!(
                "frame {}: the displayed time is outside the years -6000 to 10000",
                keyframe.frame
            ))
        })?);
    }
    files::write_whole(out, text.as_bytes()).map_err(|source| CliError::WriteFile { path: out.clone(), source })?;
    let written = format!("{}: {} keyframes, frames 0..{frames}", out.display(), path.keyframes.len());
    match end {
        End::Requested => results::line(written),
        End::Daemon => {
            tracing::warn!("the daemon has shut down after {end_s:.3} s: the path recorded until then is written");
            results::line(written)
        }
        End::Lost(error) => {
            results::line(written)?;
            Err(CliError::Record(format!(
                "the connection was lost after {end_s:.3} s; the path recorded until then is written: {error}"
            )))
        }
    }
}

/// Returns the exposure of the named view, or of the first one.
async fn exposure(client: &mut Client, view: Option<&str>) -> Result<ExposureKey, CliError> {
    let views = client.views().await.map_err(CliError::Client)?;
    let chosen = match view {
        Some(name) => views.iter().find(|form| form.name == name),
        None => views.first(),
    };
    let Some(form) = chosen else {
        let names: Vec<&str> = views.iter().map(|form| form.name.as_str()).collect();
        let allowed = if names.is_empty() { "the daemon has no views".to_owned() } else { names.join(", ") };
        let request = view.map_or("a view is needed".to_owned(), |name| format!("no view `{name}`, valid names"));
        return Err(CliError::Usage(format!("--view: {request}: {allowed}")));
    };
    let ExposureKeys { mode, ev100, compensation_ev, .. } = &form.exposure;
    // The daemon does not report keys without effect, so only the key that applies is present.
    Ok(match ev100.filter(|_| *mode == Some(ExposureMode::Manual)) {
        Some(ev100) => ExposureKey::Ev100(ev100),
        None => ExposureKey::CompensationEv(compensation_ev.unwrap_or(0.0)),
    })
}

/// Records until the recording ends. Returns the recording, its duration in seconds, and the reason why it ended.
async fn record(arguments: &RecordArguments, credentials: &Credentials) -> Result<(Recording, f64, End), CliError> {
    let mut signals = Box::pin(service::signals().map_err(CliError::Runtime)?);
    let view = arguments.view.as_deref();
    let mut client = Client::connect_as(&uri(&arguments.address), credentials).await.map_err(CliError::Client)?;
    let mut cameras = client.watch_camera().await.map_err(CliError::Client)?;
    let mut scenes = client.watch_scene().await.map_err(CliError::Client)?;
    let mut recording = Recording::new(arguments.fps, arguments.keyframes_per_second);
    let start = Instant::now();
    let at_s = || start.elapsed().as_secs_f64();
    let length_s = arguments.seconds.unwrap_or(f64::INFINITY).min(recording.most_s());
    let deadline = TokioInstant::from_std(start + Duration::from_secs_f64(length_s));
    let (mut has_begun, mut has_scene, mut has_camera) = (false, false, false);
    let end = loop {
        // Later changes of a value are recorded at the time at which the daemon reports them.
        tokio::select! {
            () = &mut signals => break End::Requested,
            () = sleep_until(deadline) => break End::Requested,
            camera = cameras.next() => match camera {
                Ok(Some(camera)) => {
                    recording.record_camera(at_s(), &camera);
                    has_camera = true;
                }
                Ok(None) => break End::Daemon,
                Err(error) => break End::Lost(error),
            },
            scene = scenes.next() => match scene {
                Ok(Some(SceneForm { time_s, magnitude_limit, .. })) => {
                    // Changes of views are reported as changes of the scene, so the exposure is read again.
                    let seen_s = at_s();
                    match exposure(&mut client, view).await {
                        Ok(exposure) => {
                            recording.record_scene(seen_s, &ObservedScene { time_s, magnitude_limit, exposure });
                            has_scene = true;
                        }
                        Err(CliError::Client(error)) if has_begun => break End::Lost(error),
                        // The view was deleted: keep its last exposure.
                        Err(CliError::Usage(_)) if has_begun => {}
                        Err(error) => return Err(error),
                    }
                }
                Ok(None) => break End::Daemon,
                Err(error) => break End::Lost(error),
            },
        }
        if has_scene && has_camera && !std::mem::replace(&mut has_begun, true) {
            results::line("recording")?;
        }
    };
    if !has_begun {
        return Err(match end {
            End::Lost(error) => CliError::Client(error),
            End::Daemon => CliError::Record("the daemon shut down before it reported its camera".to_owned()),
            End::Requested => CliError::Record("ended before the daemon reported its camera".to_owned()),
        });
    }
    Ok((recording, at_s().min(length_s), end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_printed_by_daemons_are_accepted() {
        for (address, expected) in [
            ("127.0.0.1:7143", "http://127.0.0.1:7143"),
            ("[::1]:7143", "http://[::1]:7143"),
            ("https://dome.example.org:7143", "https://dome.example.org:7143"),
            ("unix:steradian.socket", "unix:steradian.socket"),
        ] {
            assert_eq!(uri(address), expected);
            assert_eq!(super::address(address).as_deref(), Ok(address));
        }
    }

    #[test]
    fn addresses_without_a_port_are_refused() {
        for wrong in [
            "",
            "127.0.0.1",
            "localhost",
            "http://127.0.0.1",
            "https://dome.example.org/",
            "::1",
            "[::1]",
            "127.0.0.1:70000",
            "127.0.0.1:0",
            "grpc://127.0.0.1:7143",
            "http://unix:steradian.socket",
            "unix:",
        ] {
            let problem = address(wrong).expect_err(wrong);
            assert!(problem.contains(&format!("`{wrong}`")) && problem.contains("HOST:PORT"), "{problem}");
        }
        assert_eq!(address("http://127.0.0.1:7143/").as_deref(), Ok("http://127.0.0.1:7143/"));
    }
}
