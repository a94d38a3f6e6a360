//! Monado's service with the null compositor, which displays its frames nowhere.

use std::{
    fs::{File, OpenOptions},
    net::{Ipv4Addr, TcpListener},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use tempfile::TempDir;

use super::{Monado, Remote, harness::INNER_VARIABLE};

/// Maximum time for a service to start or end on a busy machine; it usually takes 0.1 s.
const START_LIMIT: Duration = Duration::from_secs(60);
/// Number of lines of the service's log that an error includes.
const LOG_LINES: usize = 40;
/// Name of the core validation layer.
const VALIDATION_LAYER: &str = "XR_APILAYER_LUNARG_core_validation";

/// Headset of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// A simulated headset, which moves by itself.
    Simulated,
    /// A headset whose poses the test sends: see [`Remote`].
    Remote,
}

/// Condition under which a service ends by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lifetime {
    /// It never ends by itself: programs may connect and disconnect.
    UntilDropped,
    /// It ends when its first program disconnects.
    UntilProgramLeaves,
}

/// A running service with a separate folder. It ends when it is dropped, and when the process of the test ends in any
/// way.
pub struct Service {
    monado: &'static Monado,
    driver: Driver,
    lifetime: Lifetime,
    port: Option<u16>,
    process: Option<Process>,
    /// `XDG_RUNTIME_DIR` of the service and its programs, with the service's socket, configuration and log.
    folder: TempDir,
}

struct Process {
    child: Child,
    /// The service ends when its standard input is closed.
    input: ChildStdin,
}

impl Service {
    /// Starts a service with a simulated headset, for several programs one after the other or at once.
    ///
    /// # Panics
    /// If it does not start.
    pub fn simulated(monado: &'static Monado) -> Self {
        Self::start(monado, Driver::Simulated, Lifetime::UntilDropped)
    }

    /// Starts a service with a headset whose poses the test sends.
    ///
    /// # Panics
    /// If it does not start.
    pub fn remote(monado: &'static Monado) -> Self {
        Self::start(monado, Driver::Remote, Lifetime::UntilDropped)
    }

    /// Starts a service and waits until it accepts programs.
    ///
    /// # Panics
    /// If it does not start; the message has its log.
    pub fn start(monado: &'static Monado, driver: Driver, lifetime: Lifetime) -> Self {
        // The runtime requires a folder that only its owner can enter. The folder is directly in the one for temporary
        // files, because the path of a socket must be short.
        let folder = tempfile::Builder::new().prefix("monado-").tempdir().expect("a temporary folder");
        let port = (driver == Driver::Remote).then(|| {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
            listener.local_addr().expect("the address of a listener").port()
        });
        let mut service = Self { monado, driver, lifetime, port, process: None, folder };
        service.configure();
        service.restart();
        service
    }

    /// Writes the configuration for both drivers, so that the service does not use the user's configuration.
    fn configure(&self) {
        let folder = self.folder.path().join("config/monado");
        std::fs::create_dir_all(&folder).expect("a folder for the configuration");
        let configuration = match self.port {
            Some(port) => serde_json::json!({
                "active": "remote",
                "remote": { "version": 0, "port": port, "view_count": 2 },
            }),
            None => serde_json::json!({}),
        };
        std::fs::write(folder.join("config_v0.json"), configuration.to_string()).expect("the configuration is written");
    }

    /// Starts the service again in the same folder and on the same port, after [`Self::kill`] or after it has ended by
    /// itself.
    ///
    /// # Panics
    /// If it still runs, or does not start; the message has its log.
    pub fn restart(&mut self) {
        assert!(!self.is_running(), "the service must not run");
        let socket = self.socket();
        // A killed service leaves its socket behind.
        if socket.exists() {
            std::fs::remove_file(&socket).expect("the old socket is removed");
        }
        let log = OpenOptions::new().create(true).append(true).open(self.log_path()).expect("a log");
        let mut command = self.monado.command(&self.monado.service);
        self.environment(&mut command)
            .env("XRT_COMPOSITOR_NULL", "1")
            .env("XRT_LOG", "info")
            .stdin(Stdio::piped())
            .stdout(log.try_clone().expect("a second handle of the log"))
            .stderr(log);
        if self.driver == Driver::Simulated {
            command.env("SIMULATED_ENABLE", "1");
        }
        if self.lifetime == Lifetime::UntilProgramLeaves {
            command.env("IPC_EXIT_ON_DISCONNECT", "1");
        }
        let mut child = command.spawn().expect("the dynamic linker of Monado starts");
        let input = child.stdin.take().expect("standard input is piped");
        self.process = Some(Process { child, input });

        let start = Instant::now();
        while !listens(&socket) {
            if let Some(status) = self.wait(Duration::ZERO) {
                panic!("the service ended while starting ({status}); its log:\n{}", self.log_tail());
            }
            assert!(
                start.elapsed() < START_LIMIT,
                "the service does not accept programs; its log:\n{}",
                self.log_tail()
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Kills the service at once (SIGKILL), as a crash would.
    ///
    /// # Panics
    /// If it does not run.
    pub fn kill(&mut self) {
        let mut process = self.process.take().expect("the service runs");
        process.child.kill().expect("the service is killed");
        process.child.wait().expect("the service has ended");
    }

    /// Ends the service in order, as a user would.
    ///
    /// # Panics
    /// If it does not run, or does not end; the message has its log.
    pub fn quit(&mut self) {
        let mut process = self.process.take().expect("the service runs");
        drop(process.input);
        if wait(&mut process.child, START_LIMIT).is_none() {
            process.child.kill().expect("the service is killed");
            process.child.wait().expect("the service has ended");
            panic!("the service does not end on request; its log:\n{}", self.log_tail());
        }
    }

    /// Whether the service runs.
    pub fn is_running(&mut self) -> bool {
        self.process.is_some() && self.wait(Duration::ZERO).is_none()
    }

    /// Waits until the service has ended by itself; `None` if it still runs after this time.
    ///
    /// # Panics
    /// If it was not running.
    pub fn wait(&mut self, limit: Duration) -> Option<ExitStatus> {
        let process = self.process.as_mut().expect("the service runs");
        let status = wait(&mut process.child, limit);
        if status.is_some() {
            self.process = None;
        }
        status
    }

    /// Returns the process id of the service.
    ///
    /// # Panics
    /// If it does not run.
    pub fn process_id(&self) -> u32 {
        self.process.as_ref().expect("the service runs").child.id()
    }

    /// Connects to the remote driver.
    ///
    /// # Panics
    /// If the service has no remote driver, or the driver does not answer.
    pub fn connect_remote(&self) -> Remote {
        Remote::connect(self.remote_port())
            .unwrap_or_else(|error| panic!("{error}; the service's log:\n{}", self.log_tail()))
    }

    /// Returns the port of the remote driver, for programs that connect to it themselves.
    ///
    /// # Panics
    /// If the service has no remote driver.
    pub fn remote_port(&self) -> u16 {
        self.port.expect("a service with the remote driver")
    }

    /// Returns a command that starts a program which finds this service's runtime. The program is started through
    /// Monado's dynamic linker, so it uses Monado's OpenXR loader, Vulkan loader and software Vulkan driver. To use
    /// another service or none, change `XDG_RUNTIME_DIR` of the command.
    ///
    /// In the program, `std::env::current_exe` is the dynamic linker.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = self.monado.command(program);
        self.environment(&mut command).env("XR_RUNTIME_JSON", &self.monado.openxr_runtime);
        command
    }

    /// Inserts the core validation layer between the program of a command and the runtime. It writes its complaints to
    /// `log`: see [`Self::complaints`].
    pub fn validated<'a>(&self, command: &'a mut Command, log: &Path) -> &'a mut Command {
        command
            .env("XR_API_LAYER_PATH", &self.monado.openxr_layers)
            .env("XR_ENABLE_API_LAYERS", VALIDATION_LAYER)
            .env("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
            .env("XR_CORE_VALIDATION_FILE_NAME", log)
    }

    /// Returns the complaints of the core validation layer.
    ///
    /// # Panics
    /// If the layer was not loaded.
    pub fn complaints(log: &Path) -> Vec<String> {
        let log = read(log);
        assert!(log.contains("Core Validation Layer is initialized"), "not a log of the validation layer: {log}");
        let entries = log.lines().filter(|line| line.contains("][VALID_"));
        entries
            .filter(|line| !["VALID_DEBUG", "VALID_INFO"].iter().any(|kind| line.contains(kind)))
            .map(str::to_owned)
            .collect()
    }

    /// Starts this test executable again as a program of this service, which runs an inner function instead of the
    /// tests (see [`super::harness::main`]). Returns its output.
    ///
    /// # Panics
    /// If it fails or exceeds the time limit.
    pub fn run_inner(&self, name: &str, limit: Duration) -> String {
        self.run(&mut self.inner(name), limit).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Returns the command that [`Self::run_inner`] runs.
    pub fn inner(&self, name: &str) -> Command {
        let program = std::env::current_exe().expect("the path of this executable");
        let mut command = self.command(&program);
        command.env(INNER_VARIABLE, name);
        command
    }

    /// Runs a command to its end and returns its standard output.
    ///
    /// # Errors
    /// It fails or exceeds the time limit; the error has its output and the service's log.
    pub fn run(&self, command: &mut Command, limit: Duration) -> Result<String, String> {
        // Use files, because an unread pipe fills up.
        let folder = tempfile::tempdir_in(self.folder.path()).expect("a temporary folder");
        let [out, err] = ["out", "err"].map(|name| folder.path().join(name));
        let create = |path: &PathBuf| File::create(path).expect("a file for the output of the program");
        let mut child = command.stdout(create(&out)).stderr(create(&err)).spawn().expect("the program starts");
        let status = wait(&mut child, limit);
        if status.is_none() {
            child.kill().expect("the program is killed");
            child.wait().expect("the program has ended");
        }
        let [out, err] = [out, err].map(|path| read(&path));
        match status {
            Some(status) if status.success() => Ok(out),
            status => {
                let status = status.map_or_else(|| format!("did not end in {limit:?}"), |status| status.to_string());
                let log = self.log_tail();
                Err(format!("{status}\n--- output:\n{out}\n--- errors:\n{err}\n--- the service's log:\n{log}"))
            }
        }
    }

    /// Runs `monado-ctl`: without arguments it lists the programs and devices, `-c` recentres, `-f ID` gives a program
    /// the focus, `-p ID` makes it the primary one, `-i ID` enables or disables its input.
    ///
    /// # Panics
    /// If it fails.
    pub fn control(&self, arguments: &[&str]) -> String {
        let mut command = self.command(&self.monado.control);
        self.run(command.args(arguments), Duration::from_secs(60)).unwrap_or_else(|error| panic!("monado-ctl: {error}"))
    }

    /// Returns the log of all starts of the service.
    pub fn log(&self) -> String {
        read(&self.log_path())
    }

    fn log_tail(&self) -> String {
        let log = self.log();
        let lines: Vec<&str> = log.lines().collect();
        lines[lines.len().saturating_sub(LOG_LINES)..].join("\n")
    }

    fn log_path(&self) -> PathBuf {
        self.folder.path().join("service.log")
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("monado_comp_ipc")
    }

    /// Sets the environment such that a program of Monado finds the service, and no settings of the user.
    fn environment<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command.env("XDG_RUNTIME_DIR", self.folder.path()).env("XDG_CONFIG_HOME", self.folder.path().join("config"))
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        if let Some(process) = &mut self.process {
            // The service may have ended by itself just now.
            let _ = process.child.kill();
            let _ = process.child.wait();
        }
    }
}

/// Whether a socket has a listener. The existence of the file does not show this, because the file is created a little
/// earlier. A connection would count as a program.
fn listens(socket: &Path) -> bool {
    /// `SO_ACCEPTCON`, the flag of a listening socket in this table (proc(5)).
    const ACCEPTS_CONNECTIONS: &str = "00010000";
    let sockets = std::fs::read_to_string("/proc/net/unix").expect("the kernel's table of sockets");
    let path = socket.to_str().expect("a path of readable characters");
    sockets.lines().any(|line| {
        let mut fields = line.split_whitespace();
        fields.nth(3) == Some(ACCEPTS_CONNECTIONS) && fields.next_back() == Some(path)
    })
}

/// Waits for the end of a process for a limited time.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    loop {
        let status = child.try_wait().expect("the state of a child");
        if status.is_some() || start.elapsed() >= limit {
            return status;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn read(path: &Path) -> String {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    String::from_utf8_lossy(&bytes).into_owned()
}
