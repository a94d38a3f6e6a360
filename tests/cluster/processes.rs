//! Starts directors and nodes, reads their logs, and ends them.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use steradian::service::{Client, proto};

/// A process that does not reach a state within this time has failed.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Frames per second. A software driver on one core can draw small views at this rate.
pub const RATE_HZ: u32 = 10;

/// Writes the configuration of a cluster whose nodes draw one view each; `keys` are additional lines of `[cluster]`.
pub fn configuration(folder: &Path, nodes: &[&str], endpoints: &[String], keys: &str) -> String {
    let endpoints = format!("{endpoints:?}");
    let mut text = format!(
        "[scene]\ncatalogues = ['builtin:bright']\ntime = 2026-01-01T00:00:00Z\n\
         [cluster]\nendpoints = {endpoints}\nrate_hz = {RATE_HZ}\ngather_s = 60\n{keys}\n"
    );
    for (index, node) in nodes.iter().enumerate() {
        text += &format!(
            "[[views]]\nname = 'of_{node}'\ntype = 'perspective'\nsize = [64, 48]\nfov_y_deg = 50.0\n\
             orientation = [0.0, {:.3}, 0.0, {:.3}]\n[[nodes]]\nname = '{node}'\nviews = ['of_{node}']\n",
            (0.4 * index as f64).sin(),
            (0.4 * index as f64).cos(),
        );
    }
    fs::write(folder.join("cluster.toml"), &text).unwrap();
    text
}

/// A director or node.
pub struct Process {
    child: Child,
    pub address: String,
    log: Arc<Mutex<String>>,
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads a stream into a string, in a thread, until the stream ends.
fn collect(stream: impl std::io::Read + Send + 'static) -> Arc<Mutex<String>> {
    let text = Arc::new(Mutex::new(String::new()));
    let into = Arc::clone(&text);
    thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            let mut text = into.lock().unwrap();
            text.push_str(&line);
            text.push('\n');
        }
    });
    text
}

impl Process {
    /// Starts a process of the cluster in a folder, without waiting for it.
    pub fn spawn(folder: &Path, configuration: &str, arguments: &[&str]) -> Self {
        Self::spawn_program(env!("CARGO_BIN_EXE_steradian"), folder, configuration, arguments)
    }

    /// Like [`Self::spawn`], with another program.
    pub fn spawn_program(program: &str, folder: &Path, configuration: &str, arguments: &[&str]) -> Self {
        let mut child = Command::new(program)
            .args(["--log", "info", "serve", "--config", configuration, "--listen", "127.0.0.1:0"])
            .args(arguments)
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let log = collect(child.stderr.take().unwrap());
        let out = collect(child.stdout.take().unwrap());
        let mut process = Self { child, address: String::new(), log };
        let line = process.wait_for("`listening on`", |_| {
            let out = out.lock().unwrap();
            out.lines().find_map(|line| line.strip_prefix("listening on ").map(str::to_owned))
        });
        process.address = line;
        process
    }

    pub fn director(folder: &Path) -> Self {
        Self::spawn(folder, "cluster.toml", &["--role", "director"])
    }

    pub fn node(folder: &Path, name: &str) -> Self {
        Self::spawn(folder, "cluster.toml", &["--role", "node", "--node", name])
    }

    pub fn log(&self) -> String {
        self.log.lock().unwrap().clone()
    }

    /// Waits until `found` returns a value.
    fn wait_for<T>(&self, what: &str, mut found: impl FnMut(&Self) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            if let Some(value) = found(self) {
                return value;
            }
            assert!(start.elapsed() < PATIENCE, "no {what}; the log is:\n{}", self.log());
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the log contains a text.
    pub fn wait_for_log(&self, text: &str) {
        self.wait_for(text, |process| process.log().contains(text).then_some(()));
    }

    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub async fn client(&self) -> Client {
        let connected = Client::connect(&format!("http://{}", self.address)).await;
        connected.unwrap_or_else(|error| panic!("{error}; the log is:\n{}", self.log()))
    }

    /// Waits until the statistics of the cluster satisfy a condition.
    pub async fn stats_when(&self, what: &str, is_it: impl Fn(&proto::ClusterStats) -> bool) -> proto::ClusterStats {
        let mut receiver = self.client().await.watch_stats(Some(0.1)).await.unwrap();
        let start = Instant::now();
        let mut last = None;
        while start.elapsed() < PATIENCE {
            let stats = receiver.next().await.unwrap().unwrap();
            let cluster = stats.cluster.unwrap();
            if is_it(&cluster) {
                return cluster;
            }
            last = Some(cluster);
        }
        panic!("not {what}: {last:#?}\nlog:\n{}", self.log())
    }

    /// Waits until all nodes of this director take part; returns the statistics.
    pub async fn all_in(&self) -> proto::ClusterStats {
        self.stats_when("all in", |cluster| {
            cluster.state == "running" && cluster.nodes.iter().all(|node| node.state == "in")
        })
        .await
    }

    /// Waits until `frames` more frames have been committed.
    pub async fn advances(&self, frames: u64) {
        let first = self.stats_when("begun", |_| true).await.counts["committed"];
        self.stats_when("advancing", |cluster| cluster.counts["committed"] >= first + frames).await;
    }
}
