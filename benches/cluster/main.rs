//! Measures a cluster: a director and nodes as processes of this machine, with small views. Nodes and directors are killed, stopped and cut off at random
//! moments; the logs of all processes record which frames each of them showed, and when. `cargo bench --bench cluster -- --help`.
//!
//! All processes run on one machine, so all times come from one monotonic clock. A frame counts as shown when the node hands it to streams and
//! windows.

#[allow(clippy::unwrap_used, reason = "a bench may panic on unexpected values")]
#[path = "../../tests/cluster/certificates.rs"]
mod certificates;
#[allow(clippy::unwrap_used, dead_code, reason = "only tests of windows use all of it; tests may panic")]
#[path = "../../tests/windows/desktop.rs"]
mod desktop;
mod events;
mod machine_clock;
mod network;
mod processes;
mod report;
mod runs;
#[path = "../../tests/windows/stamps.rs"]
mod stamps;
mod wire;

use std::{error::Error, fs, path::PathBuf};

use clap::{Parser, Subcommand};

use desktop::Desktop;
use machine_clock::Disciplined;
use network::Network;
use processes::{Cluster, Form};

/// Measures a cluster of processes on this machine.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(subcommand)]
    run: Run,
    /// Number of nodes.
    #[arg(long, global = true, default_value_t = 6)]
    nodes: usize,
    /// Frames per second.
    #[arg(long, global = true, default_value_t = 20.0)]
    rate: f64,
    /// Pixels of each node's view, as WIDTHxHEIGHT.
    #[arg(long, global = true, default_value = "64x48", value_parser = size)]
    size: [u32; 2],
    /// Policy if a node misses the deadline: together or apart.
    #[arg(long, global = true, default_value = "together")]
    at_deadline: String,
    /// Number of late frames in a row after which a node is left out.
    #[arg(long, global = true, default_value_t = 3)]
    misses: u8,
    /// Program that all processes run.
    #[arg(long, global = true, default_value = env!("CARGO_BIN_EXE_steradian"))]
    program: String,
    /// Seed of the random moments.
    #[arg(long, global = true, default_value_t = 1)]
    seed: u64,
    /// Use a network namespace per process, with TLS, instead of loopback. Needs root, `ip` and `nft`.
    #[arg(long, global = true)]
    namespaces: bool,
    /// With --namespaces: how many of a thousand arriving packets are dropped.
    #[arg(long, global = true, value_parser = clap::value_parser!(u32).range(1..1000))]
    loss: Option<u32>,
    /// With --namespaces: the shortest time-out of TCP, us (`tcp_rto_min_us` of Linux 6.11 and later).
    #[arg(long, global = true)]
    rto_min_us: Option<u32>,
    /// Nodes open windows on an Xvfb and show one star, which is in a different column in every frame. The run `steady` reads the columns.
    #[arg(long, global = true)]
    windows: bool,
    /// Give frames a time of presentation. For this, the kernel's clock is marked as synchronised, which needs root and a machine without a time
    /// service. The run `wire` needs neither: it passes the monotonic clock to the lock instead.
    #[arg(long, global = true)]
    disciplined: bool,
    /// Keep the configuration and the logs, and print their folder.
    #[arg(long, global = true)]
    keep: bool,
    /// Option that cargo passes to every benchmark.
    #[arg(long, hide = true, global = true)]
    bench: bool,
}

#[derive(Clone, Debug, Subcommand)]
enum Run {
    /// Runs without faults.
    Steady {
        /// Number of frames to request.
        #[arg(long, default_value_t = 20_000)]
        frames: u64,
    },
    /// Kills nodes and starts them again.
    Kills {
        #[arg(long, default_value_t = 50)]
        count: u32,
        /// Kill the next node only when all nodes take part again. By default, the next node is killed as soon as the participating nodes are one
        /// more than a majority.
        #[arg(long)]
        one_at_a_time: bool,
    },
    /// Stops nodes and resumes them.
    Hangs {
        #[arg(long, default_value_t = 20)]
        count: u32,
    },
    /// Kills the director and starts it again.
    DirectorKills {
        #[arg(long, default_value_t = 20)]
        count: u32,
    },
    /// Sets the clock of the machine forward or back by up to half a second, and later undoes this. Needs --disciplined.
    ClockSteps {
        #[arg(long, default_value_t = 20)]
        count: u32,
    },
    /// Stops the director, starts another one, and then resumes the first one.
    OldDirector {
        #[arg(long, default_value_t = 5)]
        count: u32,
    },
    /// Starts a second director. At first, half of the nodes reach each of the two; then one node more reaches the second one instead of the first.
    /// Needs --namespaces.
    Partition {
        /// Length of each part, seconds.
        #[arg(long, default_value_t = 15.0)]
        seconds: f64,
    },
    /// Measures only the lock, its messages and the network, with processes that draw nothing.
    Wire(wire::Options),
    /// A process of `wire`.
    #[command(hide = true)]
    WireProcess(wire::Place),
    /// Prints the figures from the logs that an earlier run kept (--keep), except the figures of faults.
    Report {
        folder: PathBuf,
        /// Time after the first frame during which nothing is counted, seconds.
        #[arg(long, default_value_t = 5.0)]
        skip: f64,
        /// Number of the last frame that is counted.
        #[arg(long, default_value_t = u64::MAX)]
        frames: u64,
    },
}

impl Run {
    fn directors(&self) -> usize {
        match self {
            Self::OldDirector { .. } | Self::Partition { .. } => 2,
            _ => 1,
        }
    }
}

/// Reads WIDTHxHEIGHT.
fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    sides.ok_or_else(|| "must be WIDTHxHEIGHT, for example 64x48".to_owned())
}

/// Load averages of the machine.
fn load() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().take(3).collect::<Vec<_>>().join(" ")
}

#[tokio::main(flavor = "multi_thread", worker_threads = 1)]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let directors = arguments.run.directors();
    let desktop = arguments.windows.then(Desktop::virtual_frame_buffer).transpose()?;
    let form = Form {
        nodes: arguments.nodes,
        program: arguments.program.clone(),
        display: desktop.as_ref().map(|desktop| desktop.display.clone()),
        rate_hz: arguments.rate,
        size: arguments.size,
        at_deadline: arguments.at_deadline.clone(),
        misses: arguments.misses,
        has_clock: arguments.disciplined,
    };
    match &arguments.run {
        Run::Report { folder, skip, frames } => return runs::report_logs(folder, &form, *skip, *frames),
        Run::WireProcess(place) => return wire::take_part(&form, place),
        _ => {}
    }
    let is_wire = matches!(arguments.run, Run::Wire(_));
    let is_namespaced = arguments.namespaces;
    if !is_namespaced && (arguments.loss.is_some() || arguments.rto_min_us.is_some()) {
        return Err("--loss and --rto-min-us need --namespaces".into());
    }
    let timeout_us = arguments.rto_min_us;
    let clock = (arguments.disciplined && !is_wire).then(Disciplined::begin).transpose()?;
    let mut cluster = Cluster::new(&form, move |folder, nodes| {
        if is_namespaced {
            Network::namespaces(folder, directors, nodes, timeout_us)
        } else {
            Network::loopback(directors)
        }
    })?;
    println!(
        "{:?}, {} nodes of {} x {} pixels, {} Hz, {}, {}, seed {}; load {}",
        arguments.run,
        form.nodes,
        form.size[0],
        form.size[1],
        form.rate_hz,
        form.at_deadline,
        match (is_namespaced, arguments.loss) {
            (false, _) => "loopback".to_owned(),
            (true, None) => "namespaces, TLS".to_owned(),
            (true, Some(loss)) => format!("namespaces, TLS, {} % of packets lost", f64::from(loss) * 0.1),
        },
        arguments.seed,
        load()
    );
    if let Run::Wire(options) = &arguments.run {
        let outcome = wire::run(&cluster, &form, *options, arguments.loss);
        println!("load at the end {}", load());
        return outcome;
    }
    let outcome = runs::run(
        &mut cluster,
        &form,
        arguments.run.clone(),
        (desktop, clock.as_ref(), arguments.loss),
        arguments.seed,
    )
    .await;
    println!("load at the end {}", load());
    cluster.end();
    if arguments.keep {
        cluster.folder.disable_cleanup(true);
        println!("logs: {}", cluster.folder.path().display());
    }
    outcome
}
