//! Measures the network traffic alone: processes of this benchmark run the lock over the network, and draw nothing. READY follows STATE at once, so
//! the figures show only the times of messages, network and scheduling.

use std::{
    error::Error,
    fmt::Write as _,
    fs,
    path::PathBuf,
    process::{Child, Stdio},
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    time::{Duration, Instant},
};

use clap::Args;
use steradian::service::cluster::{
    Heard, To, Wire, decode_to_director, decode_to_node, encode_to_director, encode_to_node, new_run,
    zenoh::{ZENOH_THREADS, ZenohOptions, ZenohTls},
};
use steradian_lock::{
    clock::Now,
    director::{self, Director, Phase},
    messages::{Cue, Epoch, FrameId, Hash, Identity, NodeId, PROTOCOL, Report, ToDirector, ToNode},
    node::{self, Node},
    rules::{Policy, Rules},
};

use crate::{
    events::Events,
    network::Network,
    processes::{Cluster, Form, Life, PATIENCE, names, now_ns},
    report,
};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Size of a cue in bytes: larger than the cue of a rig with twelve groups of exposure.
const CUE_BYTES: usize = 256;
/// Size of a node's report in bytes.
const REPORT_BYTES: usize = 40;
/// A node ends when it has been without a director for this time, ns.
const WITHOUT_DIRECTOR_NS: u64 = 3_000_000_000;
/// Time after the first frame during which nothing is counted, ns.
const SETTLE_NS: u64 = 1_000_000_000;

/// A run.
#[derive(Args, Clone, Copy, Debug)]
pub struct Options {
    /// Number of frames to request.
    #[arg(long, default_value_t = 20_000)]
    frames: u64,
    /// Use real-time scheduling for all threads (`chrt`). Needs `ulimit -r 10`.
    #[arg(long)]
    real_time: bool,
}

/// A process of a run.
#[derive(Args, Clone, Debug)]
pub struct Place {
    /// Number of the node. Default: the process is the director.
    #[arg(long)]
    node: Option<u16>,
    /// Endpoint of the director.
    #[arg(long)]
    dial: String,
    /// File for the events.
    #[arg(long)]
    events: PathBuf,
    /// Number of frames to request.
    #[arg(long)]
    ask: u64,
    /// Folder of the certificates.
    #[arg(long)]
    certificates: Option<PathBuf>,
    /// Whether the machine's monotonic clock is passed to the lock.
    #[arg(long)]
    clock: bool,
}

/// A process that is killed on drop.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a director and nodes, and prints their figures.
pub fn run(cluster: &Cluster, form: &Form, options: Options, loss: Option<u32>) -> Outcome<()> {
    let folder = cluster.folder.path();
    let own = std::env::current_exe()?.display().to_string();
    let begin = |host: &str, node: Option<usize>| -> Outcome<(Running, Life)> {
        let log = folder.join(format!("{host}.0.log"));
        let mut command = if options.real_time {
            let mut command = cluster.network.command(host, "chrt");
            command.args(["-r", "10", &own]);
            command
        } else {
            cluster.network.command(host, &own)
        };
        command.args(["--nodes", &form.nodes.to_string(), "--rate", &form.rate_hz.to_string()]);
        command.args(["--at-deadline", &form.at_deadline, "--misses", &form.misses.to_string(), "wire-process"]);
        command.args(["--dial", &cluster.network.endpoints()[0], "--ask", &options.frames.to_string()]);
        command.arg("--events").arg(&log);
        command.args(node.iter().flat_map(|node| ["--node".to_owned(), node.to_string()]));
        command.args(form.has_clock.then_some("--clock"));
        if let Network::Namespaces(_) = cluster.network {
            command.arg("--certificates").arg(folder).env(ZENOH_THREADS.0, ZENOH_THREADS.1);
        }
        let child = Running(command.stdin(Stdio::null()).spawn()?);
        let life = Life { node: node.map(|_| host.to_owned()), log, killed_ns: None, stops: Vec::new() };
        Ok((child, life))
    };
    let (mut director, life) = begin("d0", None)?;
    let mut lives = vec![life];
    let mut nodes = Vec::new();
    for (index, host) in cluster.nodes.iter().enumerate() {
        let (child, life) = begin(host, Some(index))?;
        nodes.push(child);
        lives.push(life);
    }
    if let Some(loss) = loss {
        cluster.network.lose(loss)?;
    }
    // The director ends after the last frame, and the nodes when it has ended.
    let longest = Duration::from_secs_f64(2.0 * options.frames as f64 / form.rate_hz) + PATIENCE;
    wait(&mut director, longest, "the director")?;
    for (node, host) in nodes.iter_mut().zip(&cluster.nodes) {
        wait(node, PATIENCE, host)?;
    }
    let events = Events::read(&lives)?;
    let from_ns = events.committed().first().ok_or("no frame was committed")?.3 + SETTLE_NS;
    // The director does not wait for the last verdict.
    let judged = events.frames.values().filter(|frame| frame.verdict.is_some());
    let until_ns = judged.filter_map(|frame| frame.state_ns).max().unwrap_or(from_ns);
    let events = events.within(from_ns, until_ns);
    report::print(&events, &lives, form.nodes, form.backlog_ns());
    Ok(())
}

fn wait(process: &mut Running, longest: Duration, name: &str) -> Outcome<()> {
    let begin = Instant::now();
    while begin.elapsed() < longest {
        match process.0.try_wait()? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(format!("{name} ended with {status}").into()),
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    }
    Err(format!("{name} does not end").into())
}

/// Returns the time of this process, with its clock, as the lock expects it.
struct Station {
    wire: Box<dyn Wire>,
    heard: Receiver<Heard>,
    has_clock: bool,
    /// Log of frames, in the format of a daemon's log.
    events: String,
}

impl Station {
    fn open(form: &Form, place: &Place, run: u64) -> Outcome<Self> {
        let names = names(form.nodes);
        let name = place.node.and_then(|node| names.get(usize::from(node))).map_or("director", String::as_str);
        let tls = place.certificates.as_deref().map(|folder| ZenohTls {
            files: ["ca.pem", &format!("{name}.pem"), &format!("{name}.key")].map(|file| folder.join(file)),
            director: "director".to_owned(),
        });
        let options = ZenohOptions {
            cluster: "wire".to_owned(),
            nodes: names.iter().map(|name| (name.clone(), name.clone())).collect(),
            node: place.node.map(NodeId),
            endpoints: vec![place.dial.clone()],
            run,
            tls,
        };
        let (sender, heard) = channel();
        // The receiver lives as long as the session.
        let wire = options.open()(Arc::new(move |what| drop(sender.send(what))))?;
        Ok(Self { wire, heard, has_clock: place.clock, events: String::new() })
    }

    fn now(&self) -> Now {
        let monotonic_ns = now_ns();
        Now { monotonic_ns, tai_ns: i64::try_from(monotonic_ns).ok().filter(|_| self.has_clock) }
    }

    /// Waits for an event or a time; returns all events.
    fn wait(&self, wake_ns: u64) -> Vec<Heard> {
        let wait = Duration::from_nanos(wake_ns.saturating_sub(now_ns()));
        self.heard.recv_timeout(wait).ok().into_iter().chain(self.heard.try_iter()).collect()
    }

    fn note(&mut self, what: &str, FrameId { epoch, number }: FrameId, rest: &str) {
        let at_ns = now_ns();
        // Writing to a string cannot fail.
        let _ =
            writeln!(self.events, "wire TRACE {what} {}.{:016x} {number} at {at_ns}{rest}", epoch.counter, epoch.run);
    }
}

/// Takes part in a run as director or node.
pub fn take_part(form: &Form, place: &Place) -> Outcome<()> {
    let policy = match form.at_deadline.as_str() {
        "together" => Policy::Together,
        "apart" => Policy::Apart,
        _ => return Err("--at-deadline: must be together or apart".into()),
    };
    let rules = Rules::at_hertz(u16::try_from(form.nodes)?, form.rate_hz)?;
    let rules = Rules { policy, misses_until_out: form.misses, ..rules }.checked()?;
    let run = new_run()?;
    let mut station = Station::open(form, place, run)?;
    let identity = Identity {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        protocol: PROTOCOL,
        configuration: Hash([0; 32]),
        catalogues: Vec::new(),
        adapter: String::new(),
        driver: String::new(),
        views: Vec::new(),
        windows: Vec::new(),
    };
    match place.node {
        None => lead(&mut station, &mut Director::new(rules, run, identity), place.ask)?,
        Some(node) => {
            let mut lock = Node::new(rules, NodeId(node), run, Epoch::NONE, identity, station.now());
            follow(&mut station, &mut lock)?;
        }
    }
    fs::write(&place.events, &station.events)?;
    Ok(())
}

/// Runs the director, which requests a number of frames once it is running.
fn lead(station: &mut Station, lock: &mut Director, frames: u64) -> Outcome<()> {
    let cue = Cue::new(&[7; CUE_BYTES])?;
    let mut asked = 0;
    let mut has_work = false;
    while asked < frames {
        let wake_ns = if has_work { 0 } else { lock.wake_at().unwrap_or(u64::MAX) };
        let heard = station.wait(wake_ns);
        let now = station.now();
        for what in heard {
            match what {
                Heard::FromNode(node, bytes) => {
                    let message = decode_to_director(&bytes)?;
                    if let ToDirector::Ready(ready) = &message {
                        station.note("ready", ready.id, &format!(" n{} {}", node.0 + 1, ready.drawn_ns));
                    }
                    lock.hear(now, node, message);
                }
                Heard::Node(node, false) => lock.lost(now, node),
                _ => {}
            }
        }
        has_work = false;
        for action in lock.act(now) {
            match action {
                director::Action::Send { to, message } => station.wire.send(To::Node(to), &encode_to_node(&message))?,
                director::Action::SendAll(message) => {
                    station.wire.send(To::Nodes, &encode_to_node(&message))?;
                    match message {
                        ToNode::State(state) => {
                            asked += u64::from(lock.phase() == Phase::Running);
                            station.note("state", state.id, "");
                        }
                        ToNode::Commit(commit) => station.note("commit", commit.id, &format!(" {}", commit.mask.len())),
                        ToNode::Skip(skip) => station.note("skip", skip.id, &format!(" {:?}", skip.why)),
                        _ => {}
                    }
                }
                director::Action::Compose { id, .. } => {
                    lock.composed(now, id, cue.clone());
                    has_work = true;
                }
                director::Action::Deposed { .. } => return Err("another director leads".into()),
            }
        }
    }
    Ok(())
}

/// Runs a node until it has been without a director for [`WITHOUT_DIRECTOR_NS`].
fn follow(station: &mut Station, lock: &mut Node) -> Outcome<()> {
    let report = Report([7; REPORT_BYTES].as_slice().into());
    let mut has_work = false;
    let mut end_ns = u64::MAX;
    while now_ns() < end_ns {
        let heard = station.wait(if has_work { 0 } else { lock.wake_at().min(end_ns) });
        let now = station.now();
        for what in heard {
            match what {
                Heard::FromDirector(bytes) => lock.hear(now, decode_to_node(&bytes)?),
                Heard::Director(true) => {
                    end_ns = u64::MAX;
                    lock.connected(now);
                }
                Heard::Director(false) => end_ns = now.monotonic_ns + WITHOUT_DIRECTOR_NS,
                _ => {}
            }
        }
        has_work = false;
        for action in lock.act(now) {
            match action {
                node::Action::Send(message) => station.wire.send(To::Directors, &encode_to_director(&message))?,
                node::Action::Draw { id, .. } => {
                    lock.drawn(now, id, 0, report.clone());
                    has_work = true;
                }
                node::Action::Show { id } => station.note("shown", id, ""),
                // The process is never restarted, and it draws nothing.
                node::Action::Remember(_) | node::Action::Discard { .. } | node::Action::Black => {}
            }
        }
    }
    Ok(())
}
