//! `film record`: follows the camera of a daemon and writes a path of it.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use tokio::time::{Instant as TokioInstant, sleep_until};

use super::super::{CliError, results};
use super::within;
use crate::config::{ExposureKey, UNIX_PREFIX};
use crate::files;
use crate::output::film::{Recording, SeenScene};
use crate::service::{self, Client, ClientError, Credentials, SceneForm};

/// Bytes of a token or certificate, at most.
const MOST_BYTES: u64 = 1 << 20;

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
    Prints `recording` when it has begun. SIGINT and SIGTERM end it, and so does the end of the connection: what was recorded\n\
    until then is written.")]
pub struct RecordArguments {
    /// Address of the daemon: HOST:PORT, http://HOST:PORT, https://HOST:PORT or unix:PATH.
    #[arg(long, value_name = "ADDR")]
    address: String,
    /// The path; TOML.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How long; until a signal where it is not given.
    #[arg(long, value_name = "N", value_parser = seconds)]
    seconds: Option<f64>,
    /// Keyframes per second, at most --fps.
    #[arg(long, value_name = "R", default_value = "10", value_parser = rate)]
    keyframes_per_second: f64,
    /// Frames per second of the film.
    #[arg(long, value_name = "N", default_value = "30", value_parser = fps)]
    fps: f64,
    /// The view whose exposure is recorded; the first one where it is not given.
    #[arg(long, value_name = "NAME")]
    view: Option<String>,
    /// File with the token that the daemon asks for.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Certificates of authorities whose daemons are trusted, PEM; for https.
    #[arg(long, value_name = "FILE")]
    authorities: Option<PathBuf>,
    /// Replace a file that is there.
    #[arg(long)]
    overwrite: bool,
}

/// What has ended a recording.
enum End {
    /// As asked for: time is over, or a signal came.
    Asked,
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
            "--keyframes-per-second {keyframes_per_second}: allowed are 0.1 to the {fps} frames per second of --fps"
        )));
    }
    // Before anything is recorded that could not be written.
    let folder = files::folder_of(out);
    if !folder.is_dir() {
        return Err(CliError::Usage(format!("--out {}: there is no folder {}", out.display(), folder.display())));
    }
    if fs::symlink_metadata(out).is_ok() && !arguments.overwrite {
        let out = out.display();
        return Err(CliError::Usage(format!(
            "--out {out}: it is there: take another file, or replace it with --overwrite"
        )));
    }
    let credentials = credentials(arguments)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(CliError::Runtime)?;
    let (recording, end_s, end) = runtime.block_on(record(arguments, &credentials))?;
    let path = recording.end(end_s);
    if path.left_exposure_out {
        tracing::warn!("the exposure has changed between manual and automatic, which a path cannot: it is left out");
    }
    // As long as the recording, also where the camera has stood still in the end.
    let frames = (end_s * fps).floor() as u64 + 1;
    let mut text =
        format!("# Recorded from {} in {end_s:.3} s: frames 0..{frames}\nfps = {fps:?}\n", arguments.address);
    for keyframe in &path.keyframes {
        text.push('\n');
        text.push_str(&keyframe.text().ok_or_else(|| {
            CliError::Record(format!("frame {}: the time shown is beyond the years 0 to 9999", keyframe.frame))
        })?);
    }
    files::write_whole(out, text.as_bytes()).map_err(|source| CliError::WriteFile { path: out.clone(), source })?;
    let written = format!("{}: {} keyframes, frames 0..{frames}", out.display(), path.keyframes.len());
    match end {
        End::Asked => results::line(written),
        End::Daemon => {
            tracing::warn!("the daemon has shut down after {end_s:.3} s: what was recorded until then is written");
            results::line(written)
        }
        End::Lost(error) => {
            results::line(written)?;
            Err(CliError::Record(format!(
                "the connection was lost after {end_s:.3} s, and what was recorded until then is written: {error}"
            )))
        }
    }
}

fn credentials(arguments: &RecordArguments) -> Result<Credentials, CliError> {
    let read = |file: &Option<PathBuf>, key: &str| {
        let text = file.as_ref().map(|file| files::read_text_bounded(file, MOST_BYTES));
        let file = file.as_deref().unwrap_or(Path::new(""));
        text.transpose().map_err(|error| CliError::Usage(format!("--{key} {}: {error}", file.display())))
    };
    let token = read(&arguments.token_file, "token-file")?.map(|token| token.trim().to_owned());
    Ok(Credentials { token, authorities: read(&arguments.authorities, "authorities")?, certificate: None })
}

/// The address as a URI: what a daemon prints when it listens has no scheme.
fn uri(address: &str) -> String {
    let has_scheme = address.contains("://") || address.starts_with(UNIX_PREFIX);
    if has_scheme { address.to_owned() } else { format!("http://{address}") }
}

/// The exposure of the view of a name, or of the first one.
async fn exposure(client: &mut Client, view: Option<&str>) -> Result<ExposureKey, CliError> {
    let views = client.views().await.map_err(CliError::Client)?;
    let chosen = match view {
        Some(name) => views.iter().find(|form| form.name == name),
        None => views.first(),
    };
    let Some(form) = chosen else {
        let names: Vec<&str> = views.iter().map(|form| form.name.as_str()).collect();
        let allowed = if names.is_empty() { "the daemon has none".to_owned() } else { names.join(", ") };
        let asked = view.map_or("a view is needed".to_owned(), |name| format!("there is no view `{name}`"));
        return Err(CliError::Usage(format!("--view: {asked}: {allowed}")));
    };
    let number = |key: &str| form.exposure.get(key).and_then(toml::Value::as_float);
    let is_manual = form.exposure.get("mode").and_then(toml::Value::as_str) == Some("manual");
    // The daemon leaves out what has no effect: so the one that counts is there.
    Ok(match number("ev100").filter(|_| is_manual) {
        Some(ev100) => ExposureKey::Ev100(ev100),
        None => ExposureKey::CompensationEv(number("compensation_ev").unwrap_or(0.0)),
    })
}

/// Records until something ends it; returns what was recorded, and when it ended after the start, s.
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
        // A value that changes later is told of later, and counts from then on.
        tokio::select! {
            () = &mut signals => break End::Asked,
            () = sleep_until(deadline) => break End::Asked,
            camera = cameras.next() => match camera {
                Ok(Some(camera)) => {
                    recording.see_camera(at_s(), &camera);
                    has_camera = true;
                }
                Ok(None) => break End::Daemon,
                Err(error) => break End::Lost(error),
            },
            scene = scenes.next() => match scene {
                Ok(Some(SceneForm { time_s, magnitude_limit, .. })) => {
                    // Changes of views count as changes of the scene.
                    let seen_s = at_s();
                    match exposure(&mut client, view).await {
                        Ok(exposure) => {
                            recording.see_scene(seen_s, &SeenScene { time_s, magnitude_limit, exposure });
                            has_scene = true;
                        }
                        Err(CliError::Client(error)) if has_begun => break End::Lost(error),
                        // The view has been deleted: its last exposure stays.
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
            End::Daemon => CliError::Record("the daemon has shut down before it told of its camera".to_owned()),
            End::Asked => CliError::Record("ended before the daemon has told of its camera".to_owned()),
        });
    }
    Ok((recording, at_s().min(length_s), end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_as_daemons_print_them_are_taken() {
        for (address, expected) in [
            ("127.0.0.1:7143", "http://127.0.0.1:7143"),
            ("[::1]:7143", "http://[::1]:7143"),
            ("https://dome.example.org:7143", "https://dome.example.org:7143"),
            ("unix:steradian.socket", "unix:steradian.socket"),
        ] {
            assert_eq!(uri(address), expected);
        }
    }
}
