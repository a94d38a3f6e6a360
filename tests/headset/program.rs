//! Runs the program under test as a program of a service, and reads its output and its exit code. Also runs `serve`
//! with a client.

use std::{
    fs::File,
    path::{Path, PathBuf},
    process::{Child, Command},
    sync::{Arc, Mutex},
    time::{Duration, Instant, SystemTime},
};

use steradian::{
    output::Encoding,
    scene::Camera,
    service::{Client, ClientError, ReceivedFrame, proto::HeadsetStats},
};
use tempfile::TempDir;
use tokio::{runtime::Runtime, task::JoinHandle};

use crate::monado::Service;

/// Time limit of a step of a program on a busy machine; most steps take less than a second.
pub const LIMIT: Duration = Duration::from_secs(60);

/// Returns the executable.
pub fn executable() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_steradian"))
}

/// Repeats a query until it has a result.
///
/// # Panics
/// If there is no result in time, with the message of `why`.
pub fn until<T>(mut ask: impl FnMut() -> Option<T>, why: impl FnOnce() -> String) -> T {
    let start = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        if start.elapsed() > LIMIT {
            panic!("{}", why());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A running program, killed on drop.
pub struct Program {
    process: Child,
    /// Folder of its configuration and output.
    folder: TempDir,
}

/// Result of a program.
#[derive(Debug)]
pub struct Ended {
    /// Exit code; `None` after a signal.
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Program {
    /// Starts `steradian` with a command that already names its executable, a subcommand and a configuration.
    pub fn steradian(mut command: Command, arguments: &[&str], configuration: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, configuration).unwrap();
        command.args(arguments).arg("--config").arg(path);
        Self::start_in(command, folder)
    }

    /// Starts a command.
    pub fn start(command: Command) -> Self {
        Self::start_in(command, tempfile::tempdir().unwrap())
    }

    fn start_in(mut command: Command, folder: TempDir) -> Self {
        let create = |name: &str| File::create(folder.path().join(name)).unwrap();
        let process = command.env_remove("STERADIAN_LOG").stdout(create("out")).stderr(create("err")).spawn().unwrap();
        Self { process, folder }
    }

    fn read(&self, name: &str) -> String {
        let path: PathBuf = self.folder.path().join(name);
        String::from_utf8_lossy(&std::fs::read(path).unwrap()).into_owned()
    }

    /// Returns its standard output so far.
    pub fn out(&self) -> String {
        self.read("out")
    }

    /// Returns its standard error so far.
    pub fn log(&self) -> String {
        self.read("err")
    }

    /// Waits until its log contains a text `times` times.
    ///
    /// # Panics
    /// If the program ends first, or takes too long.
    pub fn wait_for_log(&mut self, text: &str, times: usize) {
        let start = Instant::now();
        loop {
            let running = self.is_running();
            let log = self.log();
            if log.matches(text).count() >= times {
                return;
            }
            assert!(running && start.elapsed() < LIMIT, "the log does not contain `{text}` {times} times:\n{log}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn is_running(&mut self) -> bool {
        self.process.try_wait().unwrap().is_none()
    }

    /// Sends a signal by its name.
    pub fn signal(&self, name: &str) {
        let process = self.process.id().to_string();
        assert!(Command::new("kill").args([format!("-{name}"), process]).status().unwrap().success());
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// If it does not end.
    pub fn wait(mut self) -> Ended {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.process.try_wait().unwrap() {
                break status;
            }
            assert!(start.elapsed() < LIMIT, "the program does not end:\n{}", self.log());
            std::thread::sleep(Duration::from_millis(10));
        };
        Ended { code: status.code(), out: self.out(), err: self.log() }
    }

    /// Returns its current use of resources.
    pub fn resources(&self) -> Resources {
        let folder = PathBuf::from(format!("/proc/{}", self.process.id()));
        let status = std::fs::read_to_string(folder.join("status")).unwrap();
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        let entries = |name: &str| std::fs::read_dir(folder.join(name)).unwrap().count();
        Resources {
            resident_kib: resident.trim().trim_end_matches(" kB").parse().unwrap(),
            files: entries("fd"),
            threads: entries("task"),
            mappings: std::fs::read_to_string(folder.join("maps")).unwrap().lines().count(),
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The program may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Resources used by a process.
#[derive(Clone, Copy, Debug)]
pub struct Resources {
    /// Resident memory, KiB.
    pub resident_kib: u64,
    /// Open files.
    pub files: usize,
    pub threads: usize,
    /// Number of mapped memory areas.
    pub mappings: usize,
}

/// A running `serve`, with a client in the test's process.
pub struct Daemon {
    pub program: Program,
    client: Client,
    runtime: Runtime,
}

/// State of a stream of frames.
#[derive(Clone, Debug, Default)]
pub struct Received {
    /// Number of frames.
    pub frames: usize,
    /// Times at which the pose of each frame was queried, or its camera received.
    pub pose_times: Vec<SystemTime>,
    /// Last frame.
    pub last: Option<ReceivedFrame>,
    /// Reason why the stream ended, if it did.
    pub ended: Option<String>,
}

/// A stream of frames that is read in the background.
pub struct Stream {
    received: Arc<Mutex<Received>>,
    reader: JoinHandle<()>,
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.reader.abort();
    }
}

impl Stream {
    pub fn received(&self) -> Received {
        self.received.lock().unwrap().clone()
    }

    /// Returns the number of frames so far.
    ///
    /// # Panics
    /// If the stream has ended.
    pub fn count(&self) -> usize {
        let received = self.received();
        assert_eq!(received.ended, None, "the stream has ended");
        received.frames
    }

    /// Waits until there are more than `frames` frames.
    pub fn wait_beyond(&self, frames: usize) -> ReceivedFrame {
        let more = || (self.count() > frames).then(|| self.received().last).flatten();
        until(more, || format!("at most {frames} frames arrived"))
    }
}

impl Daemon {
    /// Starts `serve` as a program of a service on a free port, and connects to it.
    pub fn start(service: &Service, configuration: &str) -> Self {
        Self::of(service.command(executable()), configuration)
    }

    /// Starts `serve` with a command that already names its program.
    pub fn of(command: Command, configuration: &str) -> Self {
        let mut program = Program::steradian(command, &["serve", "--listen", "127.0.0.1:0"], configuration);
        let start = Instant::now();
        let address = loop {
            let running = program.is_running();
            if let Some((line, _)) = program.out().split_once('\n') {
                break line.strip_prefix("listening on ").unwrap().to_owned();
            }
            assert!(running && start.elapsed() < LIMIT, "the daemon does not listen:\n{}", program.log());
            std::thread::sleep(Duration::from_millis(10));
        };
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        let client = runtime.block_on(Client::connect(&format!("http://{address}"))).unwrap();
        Self { program, client, runtime }
    }

    /// Makes a call and waits for its answer.
    pub fn call<T>(&mut self, call: impl AsyncFnOnce(&mut Client) -> T) -> T {
        let client = &mut self.client;
        self.runtime.block_on(async { tokio::time::timeout(LIMIT, call(client)).await.expect("the daemon answers") })
    }

    /// Starts to read the frames of a view.
    pub fn stream(&mut self, view: &str, encoding: Encoding, max_rate_hz: f64) -> Stream {
        let mut frames = self.call(async |client| client.stream_frames(view, encoding, max_rate_hz).await).unwrap();
        let received = Arc::new(Mutex::new(Received::default()));
        let known = Arc::clone(&received);
        let reader = self.runtime.spawn(async move {
            loop {
                let next = frames.next().await;
                let mut received = known.lock().unwrap();
                match next {
                    Ok(Some(frame)) => {
                        received.frames += 1;
                        received.pose_times.push(frame.pose_time);
                        received.last = Some(frame);
                    }
                    end => {
                        received.ended = Some(format!("{end:?}"));
                        return;
                    }
                }
            }
        });
        Stream { received, reader }
    }

    /// Requests a frame of a view.
    pub fn frame(&mut self, view: &str, encoding: Encoding) -> Result<ReceivedFrame, ClientError> {
        self.call(async |client| client.render_frame(view, encoding).await)
    }

    /// Returns the current camera.
    pub fn camera(&mut self) -> Camera {
        self.call(async |client| client.camera().await).unwrap()
    }

    /// Returns the current statistics of the headset.
    pub fn headset(&mut self) -> HeadsetStats {
        let stats = self.call(async |client| client.watch_stats(None).await.unwrap().next().await);
        stats.unwrap().unwrap().headset.expect("the daemon drives a headset")
    }

    /// Waits until the headset satisfies `is`; returns its statistics.
    pub fn wait_for_headset(&mut self, is: impl Fn(&HeadsetStats) -> bool) -> HeadsetStats {
        let start = Instant::now();
        loop {
            let headset = self.headset();
            if is(&headset) {
                return headset;
            }
            assert!(start.elapsed() < LIMIT, "{headset:?}\n{}", self.program.log());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the session has the focus, so that it shows frames and accepts input of the controllers.
    pub fn wait_for_focus(&mut self) -> HeadsetStats {
        self.wait_for_headset(|headset| headset.status.as_ref().is_some_and(|status| status.session_state == "focused"))
    }

    /// Ends the daemon in order.
    pub fn terminate(self) -> Ended {
        self.program.signal("TERM");
        self.program.wait()
    }
}
