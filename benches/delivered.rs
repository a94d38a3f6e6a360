//! Measures the frames per second that reach a client over gRPC while the camera turns: the complete path with all
//! features on. Two daemons, or two configurations, are measured in turn within one run; the medians over the rounds
//! are printed with their ratio. `cargo bench --bench delivered -- --help`.

use std::{
    error::Error,
    ffi::OsString,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::Parser;
use steradian::{
    output::Encoding,
    service::{Delivered, DeliveryRound, LocalDaemon, measure_delivery, median_parts},
};

/// A daemon has failed if it does not listen within this time, or if it delivers no frame for this long.
const PATIENCE: Duration = Duration::from_secs(300);
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
    /// Program of the second daemon. Default: the same program. Without this option, there is a second daemon only if
    /// it has separate overrides or a separate encoding.
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

fn start(program: &Path, arguments: &Arguments, set: &[String]) -> Result<LocalDaemon, Box<dyn Error>> {
    let mut words: Vec<OsString> = ["--log", "error", "serve", "--config"].map(OsString::from).to_vec();
    words.push(arguments.config.clone().into());
    for key in arguments.set.iter().chain(set) {
        words.extend(["--set".into(), key.into()]);
    }
    let begin = Instant::now();
    let daemon = LocalDaemon::start(program, &words, PATIENCE)?;
    println!("{} listens after {:.1} s", program.display(), begin.elapsed().as_secs_f64());
    Ok(daemon)
}

/// Median time of each part of a frame.
fn parts_line(rounds: &[Delivered]) -> String {
    let frames: Vec<_> = rounds.iter().flat_map(|round| round.parts_ms.iter().cloned()).collect();
    let parts: Vec<_> = median_parts(&frames).iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect();
    if parts.is_empty() { "no statistics".to_owned() } else { format!("medians, ms: {}", parts.join(", ")) }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let own = PathBuf::from(env!("CARGO_BIN_EXE_steradian"));
    let mut daemons = vec![(start(&own, &arguments, &[])?, arguments.encoding)];
    if arguments.beside.is_some() || !arguments.beside_set.is_empty() || arguments.beside_encoding.is_some() {
        let program = arguments.beside.as_ref().unwrap_or(&own);
        let encoding = arguments.beside_encoding.unwrap_or(arguments.encoding);
        daemons.push((start(program, &arguments, &arguments.beside_set)?, encoding));
    }
    let mut rounds: Vec<Vec<Delivered>> = daemons.iter().map(|_| Vec::new()).collect();
    for number in 0..arguments.rounds {
        for ((daemon, encoding), rounds) in daemons.iter().zip(&mut rounds) {
            let round = DeliveryRound {
                view: arguments.view.clone(),
                encoding: *encoding,
                // Do not count the first frames, which build the map of faint light, among other things.
                skipped: if number == 0 { 12 } else { 3 },
                length: Duration::from_secs_f64(arguments.seconds),
                turn_deg_s: arguments.turn_deg_s,
                poses_hz: POSES_HZ,
                patience: PATIENCE,
            };
            rounds.push(measure_delivery(daemon.address(), &round).await?);
        }
    }
    let median_of = |rounds: &[Delivered], value: fn(&Delivered) -> f64| median(rounds.iter().map(value).collect());
    for (name, rounds) in ["this", "beside"].into_iter().zip(&rounds) {
        let (fps, age) = (median_of(rounds, |round| round.frames_per_s), median_of(rounds, |round| round.age_ms));
        println!(
            "{name:7} {} px, EV {:.2}, stars to {:.1} mag: {fps:.1} frames/s delivered ({:.1} ms), pose {age:.1} ms old, median of {} rounds",
            rounds[0].pixels,
            rounds[0].ev100,
            rounds[0].limiting_magnitude.unwrap_or(f64::NAN),
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
