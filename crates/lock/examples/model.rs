//! Reports frame rate, drops, skew, gaps and recovery of simulated clusters:
//! `cargo run --release --example model -- --nodes 6,24 --hertz 60 --loss 0.01`.
//!
//! Runs the director and the nodes of this crate in the simulation of its tests, with delays and losses from measured distributions. The output is
//! the same for the same arguments. Exits with 1 if the checker of the simulation finds a violation.

use std::{error::Error, io::Write, process::ExitCode};

use clap::{Parser, ValueEnum};
use sim::figures::{Cluster, Figures, Load, MEASURED_PER_NODE_NS};
use steradian_lock::{Policy, Rules};

#[allow(dead_code, reason = "the tests use all of it")]
#[path = "../tests/lock/sim/mod.rs"]
mod sim;

/// Simulates clusters under frame lock.
#[derive(Debug, Parser)]
struct Arguments {
    /// Numbers of nodes: one cluster is simulated for each.
    #[arg(long, value_delimiter = ',', default_values_t = [6, 24, 60, 200])]
    nodes: Vec<u16>,
    /// Frames per second.
    #[arg(long, default_value_t = 60.0)]
    hertz: f64,
    /// Probability that a message is lost and sent again by TCP.
    #[arg(long, default_value_t = 0.0)]
    loss: f64,
    /// Shortest retransmission time-out of TCP, ms.
    #[arg(long, default_value_t = 200)]
    timeout_ms: u64,
    /// Load of the processors.
    #[arg(long, value_enum, default_value_t = LoadName::Idle)]
    load: LoadName,
    /// Policy at the deadline if a node is not READY.
    #[arg(long, value_enum, default_value_t = PolicyName::Together)]
    policy: PolicyName,
    /// Mean duration of drawing, ms.
    #[arg(long, default_value_t = 4.0)]
    draw_ms: f64,
    /// Time from the deadline to presentation, ms.
    #[arg(long, default_value_t = 33)]
    lead_ms: u64,
    /// Time that each additional node adds to sending one message to all nodes, microseconds.
    #[arg(long, default_value_t = MEASURED_PER_NODE_NS / 1_000)]
    per_node_us: u64,
    /// Largest error of a disciplined clock, ms.
    #[arg(long, default_value_t = 0.2)]
    clock_error_ms: f64,
    /// Simulated time, s.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u64).range(10..=3600))]
    seconds: u64,
    /// Number of times that a node is killed; each time it is absent for half a second.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(0..=1000))]
    kills: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LoadName {
    Idle,
    One,
    Two,
    RealTime,
}

impl From<LoadName> for Load {
    fn from(name: LoadName) -> Self {
        match name {
            LoadName::Idle => Self::Idle,
            LoadName::One => Self::One,
            LoadName::Two => Self::Two,
            LoadName::RealTime => Self::RealTime,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PolicyName {
    Together,
    Apart,
}

impl From<PolicyName> for Policy {
    fn from(name: PolicyName) -> Self {
        match name {
            PolicyName::Together => Self::Together,
            PolicyName::Apart => Self::Apart,
        }
    }
}

const HEAD: &str = "\
| nodes | frames/s | dropped % | of it skipped for all % | skew ms | STATE to COMMIT ms | longest gap ms | recovery ms | gap, director killed ms |
|---|---|---|---|---|---|---|---|---|";

fn row(figures: &Figures) -> String {
    let ms = |values: &[u64]| {
        if values.iter().all(|&ns| ns == 0) {
            return "none".to_owned();
        }
        let texts: Vec<String> = values.iter().map(|&ns| format!("{:.1}", ns as f64 / 1e6)).collect();
        texts.join(" / ")
    };
    let percent = |share: f64| format!("{:.2}", share * 100.0);
    let columns = [
        figures.nodes.to_string(),
        format!("{:.1}", figures.frames_per_s),
        percent(figures.dropped),
        percent(figures.skipped),
        ms(&figures.skew_ns),
        ms(&figures.all_ready_ns),
        ms(&[figures.longest_gap_ns]),
        ms(&figures.recovery_ns),
        ms(&[figures.director_gap_ns]),
    ];
    format!("| {} |", columns.join(" | "))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if !(0.0..=0.5).contains(&arguments.loss) {
        return Err(format!("--loss {}: must be between 0 and 0.5", arguments.loss).into());
    }
    if !(0.0..=1e4).contains(&arguments.draw_ms) || !(0.0..=1e3).contains(&arguments.clock_error_ms) {
        return Err("--draw-ms must be between 0 and 10000, --clock-error-ms between 0 and 1000".into());
    }
    let mut violations = 0;
    println!("{HEAD}");
    for &nodes in &arguments.nodes {
        let lead_ns = arguments.lead_ms.saturating_mul(1_000_000);
        let rules = Rules { policy: arguments.policy.into(), lead_ns, ..Rules::at_hertz(nodes, arguments.hertz)? };
        let cluster = Cluster {
            rules: rules.checked()?,
            seed: arguments.seed,
            load: arguments.load.into(),
            per_node_ns: arguments.per_node_us.saturating_mul(1_000),
            loss: arguments.loss,
            timeout_ns: arguments.timeout_ms.saturating_mul(1_000_000),
            draw_ms: arguments.draw_ms,
            clock_error_ns: (arguments.clock_error_ms * 1e6) as i64,
            seconds: arguments.seconds,
            kills: arguments.kills,
        };
        let figures = cluster.figures();
        println!("{}", row(&figures));
        violations += figures.violations;
    }
    if violations > 0 {
        return Err(format!("the checker found {violations} violations").into());
    }
    Ok(())
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Even if standard error is closed, the exit code reports the failure.
            match writeln!(std::io::stderr(), "error: {error}") {
                Ok(()) | Err(_) => ExitCode::FAILURE,
            }
        }
    }
}
