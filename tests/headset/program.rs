//! The program under test, started as a program of a service: what it says, how it ends, and `serve` with a client.

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
    service::{Client, ClientError, HeadsetStatus, ReceivedFrame, ReceivedHeadset},
};
use tempfile::TempDir;
use tokio::{runtime::Runtime, task::JoinHandle};

use crate::monado::Service;

/// How long a step of a program may take on a busy machine; most take less than a second.
pub const LIMIT: Duration = Duration::from_secs(60);

/// The executable.
pub fn executable() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_steradian"))
}

/// Asks until there is an answer.
///
/// # Panics
/// There is none in time: with the message of `why`.
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

/// A running program; killed if its test ends early.
pub struct Program {
    process: Child,
    /// Its configuration and output are files in here.
    folder: TempDir,
}

/// How a program has ended.
#[derive(Debug)]
pub struct Ended {
    /// Exit code; none after a signal.
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Program {
    /// Starts `steradian` by a command that has its executable already: a subcommand, and a configuration.
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

    /// What it has written to standard output so far.
    pub fn out(&self) -> String {
        self.read("out")
    }

    /// What it has written to standard error so far.
    pub fn log(&self) -> String {
        self.read("err")
    }

    /// Waits until its log holds a text so many times.
    ///
    /// # Panics
    /// The program ends before, or takes too long.
    pub fn wait_for_log(&mut self, text: &str, times: usize) {
        let start = Instant::now();
        loop {
            let running = self.is_running();
            let log = self.log();
            if log.matches(text).count() >= times {
                return;
            }
            assert!(running && start.elapsed() < LIMIT, "the log does not hold `{text}` {times} times:\n{log}");
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
    /// It does not end.
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

    /// What it takes of the system now.
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
        // It may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// What a process takes of the system.
#[derive(Clone, Copy, Debug)]
pub struct Resources {
    /// Resident memory, KiB.
    pub resident_kib: u64,
    /// Open files.
    pub files: usize,
    pub threads: usize,
    /// Areas of memory that are mapped.
    pub mappings: usize,
}

/// A running `serve` with a client in this process.
pub struct Daemon {
    pub program: Program,
    client: Client,
    runtime: Runtime,
}

/// What a stream of frames has brought so far.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Frames.
    pub frames: usize,
    /// When the pose of each was asked for, or its camera received.
    pub pose_times: Vec<SystemTime>,
    /// The last one.
    pub last: Option<ReceivedFrame>,
    /// How the stream has ended, if it has.
    pub ended: Option<String>,
}

/// A stream of frames, read from now on.
pub struct Stream {
    seen: Arc<Mutex<Seen>>,
    reader: JoinHandle<()>,
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.reader.abort();
    }
}

impl Stream {
    pub fn seen(&self) -> Seen {
        self.seen.lock().unwrap().clone()
    }

    /// Frames so far.
    ///
    /// # Panics
    /// It has ended.
    pub fn count(&self) -> usize {
        let seen = self.seen();
        assert_eq!(seen.ended, None, "the stream has ended");
        seen.frames
    }

    /// Waits until there are more than so many frames.
    pub fn wait_beyond(&self, frames: usize) -> ReceivedFrame {
        let more = || (self.count() > frames).then(|| self.seen().last).flatten();
        until(more, || format!("no more than {frames} frames"))
    }
}

impl Daemon {
    /// Starts `serve` as a program of a service, on a free port, and connects to it.
    pub fn start(service: &Service, configuration: &str) -> Self {
        Self::of(service.command(executable()), configuration)
    }

    /// The same by a command that has its program already.
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

    /// Begins to read the frames of a view.
    pub fn stream(&mut self, view: &str, encoding: Encoding, max_rate_hz: f64) -> Stream {
        let mut frames = self.call(async |client| client.stream_frames(view, encoding, max_rate_hz).await).unwrap();
        let seen = Arc::new(Mutex::new(Seen::default()));
        let known = Arc::clone(&seen);
        let reader = self.runtime.spawn(async move {
            loop {
                let next = frames.next().await;
                let mut seen = known.lock().unwrap();
                match next {
                    Ok(Some(frame)) => {
                        seen.frames += 1;
                        seen.pose_times.push(frame.pose_time);
                        seen.last = Some(frame);
                    }
                    end => {
                        seen.ended = Some(format!("{end:?}"));
                        return;
                    }
                }
            }
        });
        Stream { seen, reader }
    }

    /// A frame of a view.
    pub fn frame(&mut self, view: &str, encoding: Encoding) -> Result<ReceivedFrame, ClientError> {
        self.call(async |client| client.render_frame(view, encoding).await)
    }

    /// The camera now.
    pub fn camera(&mut self) -> Camera {
        self.call(async |client| client.camera().await).unwrap()
    }

    /// The figures of the headset now.
    pub fn headset(&mut self) -> ReceivedHeadset {
        let stats = self.call(async |client| client.watch_stats(None).await.unwrap().next().await);
        stats.unwrap().unwrap().headset.expect("the daemon drives a headset")
    }

    /// Waits until the headset is as `is` says; returns its figures.
    pub fn wait_for_headset(&mut self, is: impl Fn(&ReceivedHeadset) -> bool) -> ReceivedHeadset {
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

    /// Waits until the session has the focus: it shows frames and takes what the controllers say.
    pub fn wait_for_focus(&mut self) -> ReceivedHeadset {
        self.wait_for_headset(|headset| matches!(&headset.status, HeadsetStatus::Connected { session_state, .. } if session_state == "focused"))
    }

    /// Ends it in good order.
    pub fn terminate(self) -> Ended {
        self.program.signal("TERM");
        self.program.wait()
    }
}
