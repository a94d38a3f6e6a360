//! Frames that a daemon delivers to a client while the camera turns: the complete path of a user, from the pose to the
//! arrival of the image.
//!
//! [`LocalDaemon`] runs a daemon as a child process on a free port of this machine. [`measure_delivery`] runs one round:
//! one client turns the camera, a second one reads the frames of a view as fast as they come, and a third one reads the
//! times of the passes. The camera returns afterwards, so that all rounds show the same poses.

use std::{
    ffi::OsString,
    io::{self, BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{Arc, Mutex, PoisonError, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant, SystemTimeError},
};

use tokio::{task, time::sleep};

use super::connection::{Client, ClientError};
use crate::{
    output::Encoding,
    service::{proto, scene::camera::CameraUpdate},
};

/// Interval between statistics of the daemon, s: the shortest that it accepts.
const STATS_S: f64 = 0.1;
/// Maximum number of bytes that are kept of a daemon's messages.
const MOST_MESSAGE_BYTES: usize = 16 << 10;

/// Errors of a measurement.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeliveryError {
    /// The program cannot be run.
    #[error("cannot run {program}: {source}")]
    Run {
        /// The program.
        program: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The daemon ended before it served.
    #[error("the daemon ended before it served: {0}")]
    NotServing(String),
    /// The daemon did not serve in time.
    #[error("the daemon does not serve after {0} s")]
    Late(u64),
    /// A call failed.
    #[error(transparent)]
    Call(#[from] ClientError),
    /// The daemon ended the stream of frames.
    #[error("the daemon ended the stream of frames")]
    Ended,
    /// No frame arrived for a long time.
    #[error("no frame arrived within {0} s")]
    Silent(u64),
    /// The clock of the machine was set back.
    #[error(transparent)]
    Clock(#[from] SystemTimeError),
}

/// A daemon in a child process, which is killed on drop.
///
/// Its standard input stays open until then, so that a daemon with `--until-input-closes` also ends if this process is
/// killed.
#[derive(Debug)]
pub struct LocalDaemon {
    child: Child,
    address: String,
}

/// Kills the process on drop.
struct Killed(Option<Child>);

impl Drop for Killed {
    fn drop(&mut self) {
        self.0.iter_mut().for_each(end);
    }
}

/// Kills a process and waits for its end.
fn end(child: &mut Child) {
    // It may have ended already.
    let _ = child.kill();
    let _ = child.wait();
}

/// Collects the beginning of a stream's text on a thread, and reads the rest without keeping it.
fn collected(stream: Option<impl Read + Send + 'static>) -> (Arc<Mutex<String>>, Option<JoinHandle<()>>) {
    let text = Arc::new(Mutex::new(String::new()));
    let collecting = Arc::clone(&text);
    let reading = stream.map(|stream| {
        thread::spawn(move || {
            for line in BufReader::new(stream).lines().map_while(Result::ok) {
                let mut text = collecting.lock().unwrap_or_else(PoisonError::into_inner);
                if text.len() + line.len() < MOST_MESSAGE_BYTES {
                    text.push_str(&line);
                    text.push('\n');
                }
            }
        })
    });
    (text, reading)
}

impl LocalDaemon {
    /// Starts `program` with these arguments, which end with those of `serve`, on a free port of the loopback
    /// interface; waits up to `patience` until it serves.
    ///
    /// # Errors
    /// [`DeliveryError::Run`], [`DeliveryError::Late`], or [`DeliveryError::NotServing`] with the daemon's last message.
    pub fn start(program: &Path, arguments: &[OsString], patience: Duration) -> Result<Self, DeliveryError> {
        let mut command = Command::new(program);
        command.args(arguments).args(["--listen", "127.0.0.1:0"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().map_err(|source| DeliveryError::Run { program: program.to_owned(), source })?;
        let mut killed = Killed(Some(child));
        let streams = killed.0.as_mut().map(|child| (child.stdout.take(), child.stderr.take()));
        let (output, messages) = streams.unwrap_or_default();
        let (messages, reading) = collected(messages);
        // Read on a thread, because a daemon that hangs prints nothing.
        let (sender, addresses) = mpsc::channel();
        thread::spawn(move || {
            for line in output.into_iter().flat_map(|output| BufReader::new(output).lines()).map_while(Result::ok) {
                if let Some(address) = line.strip_prefix("listening on ")
                    && sender.send(address.to_owned()).is_err()
                {
                    return;
                }
            }
        });
        match addresses.recv_timeout(patience) {
            Ok(address) => match killed.0.take() {
                Some(child) => Ok(Self { child, address: format!("http://{address}") }),
                None => Err(DeliveryError::Late(patience.as_secs())),
            },
            Err(mpsc::RecvTimeoutError::Timeout) => Err(DeliveryError::Late(patience.as_secs())),
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                // Its output is closed, so it has ended or is about to; kill it, so that its messages end.
                thread::sleep(Duration::from_millis(200));
                drop(killed);
                let _ = reading.map(JoinHandle::join);
                let messages = messages.lock().unwrap_or_else(PoisonError::into_inner);
                let last = messages.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("without a message");
                Err(DeliveryError::NotServing(last.strip_prefix("error: ").unwrap_or(last).to_owned()))
            }
        }
    }

    /// Returns the address, for [`Client::connect`].
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Returns the number of its process.
    pub fn process_id(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for LocalDaemon {
    fn drop(&mut self) {
        end(&mut self.child);
    }
}

/// A round of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct DeliveryRound {
    /// View to read.
    pub view: String,
    /// Encoding of its images.
    pub encoding: Encoding,
    /// Number of frames that are read before the measurement starts. The first ones build the map of faint light and other data.
    pub skipped: usize,
    /// Length of the measurement.
    pub length: Duration,
    /// Turning rate of the camera about its vertical axis, degrees per second.
    pub turn_deg_s: f64,
    /// Poses per second.
    pub poses_hz: f64,
    /// A frame that does not arrive within this time is an error.
    pub patience: Duration,
}

/// Measurements of one round.
#[derive(Clone, Debug, PartialEq)]
pub struct Delivered {
    /// Frames per second that arrived.
    pub frames_per_s: f64,
    /// Times between the arrivals of consecutive frames, ms.
    pub intervals_ms: Vec<f64>,
    /// Time from the arrival of a frame's pose at the daemon to the arrival of the frame, median, ms.
    pub age_ms: f64,
    /// Exposure of the last frame, EV at ISO 100.
    pub ev100: f64,
    /// Pixels of all images of the view.
    pub pixels: u64,
    /// Limiting magnitude of the last display image; `None` if unknown.
    pub limiting_magnitude: Option<f64>,
    /// Times of frames of the daemon by part, ms: (name, time) in the order in which the parts run, from planning to the whole frame. Times of passes
    /// with the same name are added up.
    pub parts_ms: Vec<Vec<(String, f64)>>,
}

impl Delivered {
    /// Returns the median time between the arrivals of consecutive frames, ms.
    pub fn interval_ms(&self) -> f64 {
        median(self.intervals_ms.clone())
    }
}

/// Returns the median. For an even number of values, it is the upper one of the middle two; without values, it is 0.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Returns the median time of each part of a frame, in the order of the longest list.
pub fn median_parts(frames: &[Vec<(String, f64)>]) -> Vec<(String, f64)> {
    let Some(longest) = frames.iter().max_by_key(|parts| parts.len()) else { return Vec::new() };
    let times = |name: &str| {
        let time = |parts: &Vec<(String, f64)>| Some(parts.iter().find(|part| part.0 == name)?.1);
        frames.iter().filter_map(time).collect()
    };
    longest.iter().map(|(name, _)| (name.clone(), median(times(name)))).collect()
}

/// Returns the times of the parts of the daemon's last frame.
fn parts_of(stats: &proto::Stats) -> Option<Vec<(String, f64)>> {
    let times = stats.last_frame.as_ref()?;
    let mut parts = vec![("plan".to_owned(), times.plan_ms)];
    for pass in &times.passes {
        match parts.iter_mut().find(|(name, _)| *name == pass.name) {
            Some((_, ms)) => *ms += pass.ms,
            None => parts.push((pass.name.clone(), pass.ms)),
        }
    }
    parts.push(("frame".to_owned(), times.total_ms));
    Some(parts)
}

/// Ends a task on drop.
struct Ending<T>(task::JoinHandle<T>);

impl<T> Drop for Ending<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Measures one round with the daemon at an address.
///
/// # Errors
/// A call fails, the stream ends, or no frame arrives in time.
pub async fn measure_delivery(address: &str, round: &DeliveryRound) -> Result<Delivered, DeliveryError> {
    // Turn the camera from its current orientation.
    let mut client = Client::connect(address).await?;
    let start = client.camera().await?;
    let mut steering = Client::connect(address).await?;
    let (turn_deg_s, interval) = (round.turn_deg_s, Duration::from_secs_f64(1.0 / round.poses_hz));
    let turned = move |seconds: f64| {
        let turn = glam::DQuat::from_rotation_y((turn_deg_s * seconds).to_radians());
        let orientation = (start.world_from_camera * turn).normalize().to_array();
        CameraUpdate { orientation: Some(orientation), ..CameraUpdate::default() }
    };
    let steer = Ending(tokio::spawn(async move {
        let begin = Instant::now();
        while steering.set_camera(&turned(begin.elapsed().as_secs_f64())).await.is_ok() {
            sleep(interval).await;
        }
    }));
    // Read frames; the first ones do not count.
    let mut stream = client.stream_frames(&round.view, round.encoding, 0.0).await?;
    let silent = |_| DeliveryError::Silent(round.patience.as_secs());
    for _ in 0..round.skipped {
        let frame = tokio::time::timeout(round.patience, stream.next()).await.map_err(silent)?;
        frame?.ok_or(DeliveryError::Ended)?;
    }
    // Read the times of the passes meanwhile.
    let mut watch = Client::connect(address).await?.watch_stats(Some(STATS_S)).await?;
    let parts_ms = Arc::new(Mutex::new(Vec::new()));
    let collecting = Arc::clone(&parts_ms);
    let watching = Ending(tokio::spawn(async move {
        while let Ok(Some(stats)) = watch.next().await {
            collecting.lock().unwrap_or_else(PoisonError::into_inner).extend(parts_of(&stats));
        }
    }));
    let begin = Instant::now();
    let mut last_arrival: Option<Instant> = None;
    let (mut intervals_ms, mut ages_ms) = (Vec::new(), Vec::new());
    let (mut ev100, mut pixels, mut limiting_magnitude) = (0.0, 0, None);
    // Measure at least two frames, however slow they are.
    while ages_ms.len() < 2 || begin.elapsed() < round.length {
        let frame = tokio::time::timeout(round.patience, stream.next()).await.map_err(silent)?;
        let frame = frame?.ok_or(DeliveryError::Ended)?;
        let arrival = Instant::now();
        intervals_ms.extend(last_arrival.map(|last| (arrival - last).as_secs_f64() * 1e3));
        last_arrival = Some(arrival);
        ages_ms.push(frame.pose_time.elapsed()?.as_secs_f64() * 1e3);
        (ev100, limiting_magnitude) = (frame.exposure_ev100, frame.limiting_magnitude);
        pixels = frame.images.iter().map(|image| u64::from(image.width) * u64::from(image.height)).sum();
    }
    let frames_per_s = ages_ms.len() as f64 / begin.elapsed().as_secs_f64();
    // Wait until the last pose in transit has arrived, then return the camera.
    drop((steer, watching));
    sleep(interval).await;
    client.set_camera(&turned(0.0)).await?;
    let parts_ms = std::mem::take(&mut *parts_ms.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(Delivered { frames_per_s, intervals_ms, age_ms: median(ages_ms), ev100, pixels, limiting_magnitude, parts_ms })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_the_median_of_the_frames_that_have_them() {
        let frame = |parts: &[(&str, f64)]| parts.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect();
        let frames: Vec<Vec<(String, f64)>> = vec![
            frame(&[("plan", 1.0), ("frame", 9.0)]),
            frame(&[("plan", 3.0), ("stars", 5.0), ("frame", 7.0)]),
            frame(&[("plan", 2.0), ("frame", 8.0)]),
        ];
        let found = median_parts(&frames);
        let found: Vec<(&str, f64)> = found.iter().map(|(name, ms)| (name.as_str(), *ms)).collect();
        assert_eq!(found, [("plan", 2.0), ("stars", 5.0), ("frame", 8.0)]);
        assert!(median_parts(&[]).is_empty());
        assert_eq!(median(vec![3.0, 1.0, 2.0, 9.0]), 3.0);
    }

    #[test]
    fn program_that_cannot_be_run_is_an_error_with_its_name() {
        let error = LocalDaemon::start(Path::new("/no/such/program"), &[], Duration::from_secs(5)).unwrap_err();
        assert!(matches!(&error, DeliveryError::Run { .. }) && error.to_string().contains("/no/such/program"));
    }
}
