//! Measures the frames per second that reach a client over gRPC while the camera turns: the complete path with all
//! features on. Two daemons, or two configurations, take turns in one run; medians over rounds are printed with their
//! ratio. `cargo bench --bench delivered -- --help`.

use std::{
    error::Error,
    io::{BufRead, BufReader},
    path::PathBuf,
    process::{Child, Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use clap::Parser;
use steradian::{
    output::Encoding,
    service::{CameraUpdate, Client, proto},
};
use tokio::time::{sleep, timeout};

/// A daemon that does not listen by then has failed.
const START: Duration = Duration::from_secs(300);
/// Interval between statistics of the daemon, s.
const STATS_S: f64 = 0.1;
/// Poses per second.
const POSES_HZ: f64 = 250.0;

/// Measures the frames per second that a daemon delivers while the camera turns.
#[derive(Debug, Parser)]
struct Arguments {
    /// Configuration of the daemon.
    #[arg(long, default_value = "configs/dome.toml")]
    config: PathBuf,
    /// View to read.
    #[arg(long, default_value = "dome")]
    view: String,
    /// Overrides of keys for both daemons.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Overrides of keys for the second daemon only.
    #[arg(long = "beside-set")]
    beside_set: Vec<String>,
    /// Encoding of the images: rgba8 or rgb32f.
    #[arg(long, default_value = "rgba8", value_parser = encoding)]
    encoding: Encoding,
    /// Encoding of the images of the second daemon. Default: the same.
    #[arg(long = "beside-encoding", value_parser = encoding)]
    beside_encoding: Option<Encoding>,
    /// Program of the second daemon. Default: the same program, if it has separate overrides.
    #[arg(long)]
    beside: Option<PathBuf>,
    /// Number of rounds; each daemon is measured once per round.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Length of a round, seconds.
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// Turn of the camera, degrees per second.
    #[arg(long, default_value_t = 5.0)]
    turn_deg_s: f64,
    /// Option that cargo passes to every benchmark.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Reads the name of an encoding.
fn encoding(name: &str) -> Result<Encoding, String> {
    match name {
        "rgba8" => Ok(Encoding::Rgba8),
        "rgb32f" => Ok(Encoding::Rgb32f),
        _ => Err("must be rgba8 or rgb32f".to_owned()),
    }
}

/// A daemon that is killed on drop.
struct Daemon {
    child: Child,
    address: String,
    /// Encoding of its images.
    encoding: Encoding,
}

impl Daemon {
    fn start(
        program: &PathBuf,
        arguments: &Arguments,
        set: &[String],
        encoding: Encoding,
    ) -> Result<Self, Box<dyn Error>> {
        let mut command = Command::new(program);
        command.args(["--log", "error", "serve", "--listen", "127.0.0.1:0", "--config"]).arg(&arguments.config);
        for key in arguments.set.iter().chain(set) {
            command.args(["--set", key]);
        }
        let mut child = command.stdout(Stdio::piped()).spawn()?;
        let output = child.stdout.take().ok_or("the daemon has no output")?;
        let begin = Instant::now();
        for line in BufReader::new(output).lines() {
            if let Some(address) = line?.strip_prefix("listening on ") {
                println!("{} listens after {:.1} s", program.display(), begin.elapsed().as_secs_f64());
                return Ok(Self { child, address: format!("http://{address}"), encoding });
            }
            if begin.elapsed() > START {
                break;
            }
        }
        child.kill()?;
        Err(format!("{} does not listen", program.display()).into())
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // The daemon may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Measurements of a client in a round.
struct Round {
    frames_per_s: f64,
    /// Median time from the pose of a frame to its arrival, ms.
    age_ms: f64,
    ev100: f64,
    pixels: u64,
    /// Limiting magnitude of the display image.
    limit: f64,
    /// Times of frames of the daemon by part, ms: (name, time) in the order in which the parts run.
    parts_ms: Vec<Vec<(String, f64)>>,
}

/// Parts of a frame of the daemon, passes of one name as one.
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

/// Runs one round of one daemon: one client turns the camera, another one reads.
async fn round(daemon: &Daemon, arguments: &Arguments, number: u32) -> Result<Round, Box<dyn Error>> {
    let mut client = Client::connect(&daemon.address).await?;
    let start = client.camera().await?;
    let mut steering = Client::connect(&daemon.address).await?;
    let turn_deg_s = arguments.turn_deg_s;
    let steer = tokio::spawn(async move {
        let begin = Instant::now();
        loop {
            let angle = (turn_deg_s * begin.elapsed().as_secs_f64()).to_radians();
            let orientation = (start.world_from_camera * glam::DQuat::from_rotation_y(angle)).normalize().to_array();
            let update = CameraUpdate { orientation: Some(orientation), ..CameraUpdate::default() };
            if steering.set_camera(&update).await.is_err() {
                return;
            }
            sleep(Duration::from_secs_f64(1.0 / POSES_HZ)).await;
        }
    });
    let mut stream = client.stream_frames(&arguments.view, daemon.encoding, 0.0).await?;
    // Skip the first frames, which build the map of faint light among others.
    for _ in 0..if number == 0 { 12 } else { 3 } {
        stream.next().await?.ok_or("the stream has ended")?;
    }
    let ended = Arc::new(AtomicBool::new(false));
    let has_ended = Arc::clone(&ended);
    let mut watch = Client::connect(&daemon.address).await?.watch_stats(Some(STATS_S)).await?;
    let begin = Instant::now();
    let mut ages_ms = Vec::new();
    let watching = tokio::spawn(async move {
        let mut parts_ms = Vec::new();
        while !has_ended.load(Ordering::Relaxed)
            && let Ok(Some(stats)) = watch.next().await
        {
            parts_ms.extend(parts_of(&stats));
        }
        parts_ms
    });
    let (mut ev100, mut pixels, mut limit) = (0.0, 0, 0.0);
    while begin.elapsed().as_secs_f64() < arguments.seconds {
        let frame = timeout(START, stream.next()).await??.ok_or("the stream has ended")?;
        ages_ms.push(frame.pose_time.elapsed()?.as_secs_f64() * 1e3);
        ev100 = frame.exposure_ev100;
        limit = frame.limiting_magnitude.unwrap_or(f64::NAN);
        pixels = frame.images.iter().map(|image| u64::from(image.width) * u64::from(image.height)).sum();
    }
    let frames_per_s = ages_ms.len() as f64 / begin.elapsed().as_secs_f64();
    steer.abort();
    ended.store(true, Ordering::Relaxed);
    let parts_ms = watching.await?;
    Ok(Round { frames_per_s, age_ms: median(ages_ms), ev100, pixels, limit, parts_ms })
}

/// Median time of each part of a frame.
fn parts_line(rounds: &[Round]) -> String {
    let frames = || rounds.iter().flat_map(|round| &round.parts_ms);
    let Some(longest) = frames().max_by_key(|parts| parts.len()) else { return "no statistics".to_owned() };
    let median_of =
        |name: &str| median(frames().filter_map(|parts| Some(parts.iter().find(|part| part.0 == name)?.1)).collect());
    let parts: Vec<_> = longest.iter().map(|(name, _)| format!("{name} {:.1}", median_of(name))).collect();
    format!("medians, ms: {}", parts.join(", "))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let own = PathBuf::from(env!("CARGO_BIN_EXE_steradian"));
    let mut daemons = vec![Daemon::start(&own, &arguments, &[], arguments.encoding)?];
    if arguments.beside.is_some() || !arguments.beside_set.is_empty() || arguments.beside_encoding.is_some() {
        let program = arguments.beside.as_ref().unwrap_or(&own);
        daemons.push(Daemon::start(
            program,
            &arguments,
            &arguments.beside_set,
            arguments.beside_encoding.unwrap_or(arguments.encoding),
        )?);
    }
    let mut rounds: Vec<Vec<Round>> = daemons.iter().map(|_| Vec::new()).collect();
    for number in 0..arguments.rounds {
        for (daemon, rounds) in daemons.iter().zip(&mut rounds) {
            rounds.push(round(daemon, &arguments, number).await?);
        }
    }
    let median_of = |rounds: &[Round], value: fn(&Round) -> f64| median(rounds.iter().map(value).collect());
    for (name, rounds) in ["this", "beside"].into_iter().zip(&rounds) {
        let (fps, age) = (median_of(rounds, |round| round.frames_per_s), median_of(rounds, |round| round.age_ms));
        println!(
            "{name:7} {} px, EV {:.2}, stars to {:.1} mag: {fps:.1} frames/s delivered ({:.1} ms), pose {age:.1} ms old, median of {} rounds",
            rounds[0].pixels,
            rounds[0].ev100,
            rounds[0].limit,
            1e3 / fps,
            rounds.len()
        );
        println!("        {}", parts_line(rounds));
    }
    if let [this, beside] = &rounds[..] {
        let ratios = this.iter().zip(beside).map(|(this, beside)| this.frames_per_s / beside.frames_per_s).collect();
        println!("ratio   {:.2}, median of pairs", median(ratios));
    }
    Ok(())
}
