//! The processes of a measured cluster: starts, kills, stops and resumes them, and records the times.

use std::{
    error::Error,
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Child, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::{
    process::{Pid, Signal, kill_process},
    time::{ClockId, clock_gettime},
};
use steradian::service::{Client, proto};

use crate::{network::Network, stamps::STAR};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// A process that does not reach a state within this time has failed.
pub const PATIENCE: Duration = Duration::from_secs(180);
/// Interval at which a process is polled.
const LOOK: Duration = Duration::from_millis(20);
/// Time from the deadline of a frame to its presentation, ns.
const LEAD_NS: f64 = 33e6;
/// Log filter with which directors and nodes log their frames.
const LOG: &str = "info,zenoh=error,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn,steradian::cluster::frames=trace";

/// Returns the monotonic time, ns. The lines of the logs contain the same time.
pub fn now_ns() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    u64::try_from(i128::from(time.tv_sec) * 1_000_000_000 + i128::from(time.tv_nsec)).unwrap_or(0)
}

/// One run of a director or node.
#[derive(Clone, Debug)]
pub struct Life {
    /// Name of the node; `None` for a director.
    pub node: Option<String>,
    pub log: PathBuf,
    pub killed_ns: Option<u64>,
    /// Times at which it was stopped and resumed.
    pub stops: Vec<(u64, u64)>,
}

/// A running process.
struct Process {
    child: Child,
    socket: String,
    life: usize,
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process may have ended already. SIGKILL ends even a stopped process.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Size and rate of a cluster.
#[derive(Clone, Debug)]
pub struct Form {
    pub nodes: usize,
    /// Program of all processes.
    pub program: String,
    /// Display for the windows in which nodes show a sky of one star. With `None` there are no windows, and the sky has the bright stars.
    pub display: Option<String>,
    pub rate_hz: f64,
    pub size: [u32; 2],
    pub at_deadline: String,
    pub misses: u8,
    /// Whether frames are shown at a time of presentation.
    pub has_clock: bool,
}

impl Form {
    /// Time after its COMMIT, ns, from which a shown frame belongs to a backlog. It is one period. With a clock, the period begins at the time of
    /// presentation of a frame that is committed at once.
    pub fn backlog_ns(&self) -> u64 {
        let period_ns = 1e9 / self.rate_hz;
        let ahead_ns = if self.has_clock { 0.75 * period_ns + LEAD_NS } else { 0.0 };
        (period_ns + ahead_ns) as u64
    }
}

/// A cluster of processes. Hosts are `d0`, `d1` (the directors) and the names of the nodes.
pub struct Cluster {
    pub folder: tempfile::TempDir,
    pub network: Network,
    pub nodes: Vec<String>,
    program: String,
    display: Option<String>,
    running: Vec<(String, Process)>,
    pub lives: Vec<Life>,
}

/// Width of a window, pixels.
pub const SKY_WIDTH: u16 = 160;

/// Names of the nodes.
pub fn names(nodes: usize) -> Vec<String> {
    (1..=nodes).map(|node| format!("n{node}")).collect()
}

fn configuration(form: &Form, nodes: &[String], network: &Network) -> String {
    let (stars, glare) = match form.display {
        Some(_) => ("star.csv", "[glare]\nmethod = 'none'\n"),
        None => ("builtin:bright", ""),
    };
    let mut text = format!(
        "[scene]\ncatalogues = ['{stars}']\ntime = 2026-01-01T00:00:00Z\n{glare}[cluster]\nendpoints = {:?}\n\
         rate_hz = {}\nat_deadline = '{}'\nmisses = {}\ngather_s = 3\n{}\n",
        network.endpoints(),
        form.rate_hz,
        form.at_deadline,
        form.misses,
        network.keys()
    );
    for (index, node) in nodes.iter().enumerate() {
        if form.display.is_some() {
            // All show the same part of the sky.
            text += &format!(
                "[[views]]\nname = 'of_{node}'\ntype = 'perspective'\nsize = [{SKY_WIDTH}, 24]\nfov_y_deg = 5.0\n\
                 [[windows]]\nview = 'of_{node}'\nposition = [{}, 0]\n\
                 [[nodes]]\nname = '{node}'\nviews = ['of_{node}']\n",
                usize::from(SKY_WIDTH) * index,
            );
            continue;
        }
        let half_rad = 0.2 * index as f64;
        text += &format!(
            "[[views]]\nname = 'of_{node}'\ntype = 'perspective'\nsize = {:?}\nfov_y_deg = 50.0\n\
             orientation = [0.0, {}, 0.0, {}]\n[[nodes]]\nname = '{node}'\nviews = ['of_{node}']\n",
            form.size,
            half_rad.sin(),
            half_rad.cos(),
        );
    }
    text
}

/// Returns the processes whose logs are in a folder, as `HOST.NUMBER.log`. It is unknown when they were killed or stopped.
pub fn lives(folder: &Path) -> Outcome<Vec<Life>> {
    let mut lives = Vec::new();
    for entry in fs::read_dir(folder)? {
        let log = entry?.path();
        let name = log.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if let Some((host, _)) = name.split_once('.').filter(|_| name.ends_with(".log")) {
            let node = host.starts_with('n').then(|| host.to_owned());
            lives.push(Life { node, log, killed_ns: None, stops: Vec::new() });
        }
    }
    Ok(lives)
}

impl Cluster {
    /// Creates a cluster without processes.
    pub fn new(form: &Form, network: impl FnOnce(&Path, &[String]) -> Outcome<Network>) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let nodes = names(form.nodes);
        let network = network(folder.path(), &nodes)?;
        fs::write(folder.path().join("cluster.toml"), configuration(form, &nodes, &network))?;
        fs::write(folder.path().join("star.csv"), STAR)?;
        let (program, display) = (form.program.clone(), form.display.clone());
        Ok(Self { folder, network, nodes, program, display, running: Vec::new(), lives: Vec::new() })
    }

    /// Starts the process of a host without waiting for it.
    pub fn start(&mut self, host: &str) -> Outcome<()> {
        let life = self.lives.len();
        let path = |kind: &str| self.folder.path().join(format!("{host}.{life}.{kind}"));
        let (socket, log) = (format!("unix:{}", path("socket").display()), path("log"));
        let director = host.strip_prefix('d').map(str::parse::<usize>).transpose()?;
        let mut command = self.network.command(host, &self.program);
        command.args(["--log", LOG, "serve", "--config", "cluster.toml", "--listen", &socket]);
        match director {
            Some(director) => command.args(["--role", "director", "--endpoint", &self.network.endpoints()[director]]),
            None => command.args(["--role", "node", "--node", host]),
        };
        command.current_dir(self.folder.path()).stdin(Stdio::null());
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        command.envs(self.display.iter().map(|display| ("DISPLAY", display)));
        command.stdout(Stdio::null()).stderr(File::create(&log)?);
        let node = director.is_none().then(|| host.to_owned());
        self.lives.push(Life { node, log, killed_ns: None, stops: Vec::new() });
        self.running.push((host.to_owned(), Process { child: command.spawn()?, socket, life }));
        Ok(())
    }

    fn process(&self, host: &str) -> Outcome<&Process> {
        let found = self.running.iter().find(|(name, _)| name == host);
        Ok(&found.ok_or_else(|| format!("{host} does not run"))?.1)
    }

    /// Kills a process; returns the time.
    pub fn kill(&mut self, host: &str) -> Outcome<u64> {
        let index = self.running.iter().position(|(name, _)| name == host);
        let (_, process) = self.running.remove(index.ok_or_else(|| format!("{host} does not run"))?);
        let at_ns = now_ns();
        self.lives[process.life].killed_ns = Some(at_ns);
        drop(process);
        Ok(at_ns)
    }

    fn signal(&self, host: &str, signal: Signal) -> Outcome<usize> {
        let process = self.process(host)?;
        let id = i32::try_from(process.child.id())?;
        kill_process(Pid::from_raw(id).ok_or("no process number")?, signal)?;
        Ok(process.life)
    }

    /// Stops a process, as if it hung; returns the time.
    pub fn stop(&mut self, host: &str) -> Outcome<u64> {
        let at_ns = now_ns();
        let life = self.signal(host, Signal::STOP)?;
        self.lives[life].stops.push((at_ns, u64::MAX));
        Ok(at_ns)
    }

    /// Resumes a stopped process; returns the time.
    pub fn resume(&mut self, host: &str) -> Outcome<u64> {
        let at_ns = now_ns();
        let life = self.signal(host, Signal::CONT)?;
        if let Some((_, resumed_ns)) = self.lives[life].stops.last_mut() {
            *resumed_ns = at_ns;
        }
        Ok(at_ns)
    }

    /// Connects a client to a process, which may still be starting.
    pub async fn client(&self, host: &str) -> Outcome<Client> {
        let begin = Instant::now();
        let process = self.process(host)?;
        loop {
            match Client::connect(&process.socket).await {
                Ok(client) => return Ok(client),
                Err(error) if begin.elapsed() > PATIENCE => {
                    let log = fs::read_to_string(&self.lives[process.life].log)?;
                    return Err(format!("{host} does not serve: {error}; its log:\n{log}").into());
                }
                Err(_) => tokio::time::sleep(LOOK).await,
            }
        }
    }

    /// Queries the statistics of the cluster from a process, which may still be starting.
    pub async fn stats(&self, host: &str) -> Outcome<proto::ClusterStats> {
        let begin = Instant::now();
        loop {
            let mut client = self.client(host).await?;
            match client.watch_stats(Some(0.1)).await {
                Ok(mut stats) => {
                    let stats = stats.next().await?.ok_or("the daemon ended")?;
                    return Ok(stats.cluster.ok_or("the daemon is in no cluster")?);
                }
                Err(error) if begin.elapsed() > PATIENCE => return Err(format!("{host}: {error}").into()),
                Err(_) => tokio::time::sleep(LOOK).await,
            }
        }
    }

    /// Waits until the statistics of a process satisfy a condition.
    pub async fn until(
        &self,
        host: &str,
        what: &str,
        is_it: impl Fn(&proto::ClusterStats) -> bool,
    ) -> Outcome<proto::ClusterStats> {
        let begin = Instant::now();
        loop {
            let stats = self.stats(host).await?;
            if is_it(&stats) {
                return Ok(stats);
            }
            if begin.elapsed() > PATIENCE {
                return Err(format!("{host} is not {what}: {stats:#?}").into());
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }

    /// Waits until all nodes take part and have the scene of a director.
    pub async fn all_in(&self, director: &str) -> Outcome<proto::ClusterStats> {
        self.until(director, "with all nodes", |stats| {
            let is_in = |node: &proto::ClusterNodeStats| node.state == "in" && node.scene_hash == stats.scene_hash;
            stats.state == "running" && stats.nodes.iter().all(is_in)
        })
        .await
    }

    /// Ends all processes.
    pub fn end(&mut self) {
        self.running.clear();
        // Logs are complete once their writers have ended.
        thread::sleep(LOOK);
    }
}
