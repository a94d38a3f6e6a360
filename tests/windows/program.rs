//! The built program on the display of a test.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Output, Stdio},
};

use crate::desktop::until;

/// Returns a command for `steradian` with arguments, without a display unless one is given.
pub fn steradian(arguments: &[&str], display: Option<&str>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(arguments).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").stdin(Stdio::null());
    if let Some(display) = display {
        command.env("DISPLAY", display);
    }
    command
}

/// A folder with a configuration for one test.
pub struct Scene {
    folder: tempfile::TempDir,
}

impl Scene {
    pub fn new(configuration: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene.toml"), configuration).unwrap();
        Self { folder }
    }

    pub fn path(&self) -> String {
        self.folder.path().join("scene.toml").to_str().unwrap().to_owned()
    }

    /// Writes a file next to the configuration.
    pub fn write(&self, name: &str, content: &str) {
        fs::write(self.folder.path().join(name), content).unwrap();
    }

    /// Renders the configuration and returns the folder of the images.
    pub fn render(&self, overrides: &[&str]) -> PathBuf {
        let out = self.folder.path().join(format!("out{}", overrides.len()));
        let path = self.path();
        let mut arguments = vec!["render", "--config", &path, "--files", "png", "--out", out.to_str().unwrap()];
        arguments.extend(overrides.iter().flat_map(|over| ["--set", over]));
        let output = steradian(&arguments, None).output().unwrap();
        assert!(output.status.success(), "{}", describe(&output));
        out
    }

    /// Starts `show` with the configuration.
    pub fn show(&self, display: &str, arguments: &[&str]) -> Running {
        let path = self.path();
        let all = [&["show", "--config", &path, "--log", "info,steradian::windows=trace"], arguments].concat();
        Running::start(steradian(&all, Some(display)), self.folder.path())
    }

    /// Starts `serve` with the configuration on a free port.
    pub fn serve(&self, display: Option<&str>) -> Running {
        let path = self.path();
        let arguments =
            ["serve", "--config", &path, "--listen", "127.0.0.1:0", "--log", "info,steradian::windows=trace"];
        Running::start(steradian(&arguments, display), self.folder.path())
    }

    /// Starts `serve` as a process of a cluster, whose log has a name.
    #[cfg(feature = "cluster")]
    pub fn serve_as(&self, name: &str, display: Option<&str>, arguments: &[&str]) -> Running {
        let path = self.path();
        let log = ["--log", "info,zenoh=error,steradian::windows=trace"];
        let all = [&["serve", "--config", &path, "--listen", "127.0.0.1:0"], &log[..], arguments].concat();
        let folder = self.folder.path().join(name);
        fs::create_dir_all(&folder).unwrap();
        Running::start(steradian(&all, display), &folder)
    }
}

pub fn describe(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// The running program, killed on drop.
pub struct Running {
    child: Child,
    out: PathBuf,
    log: PathBuf,
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Running {
    fn start(mut command: Command, folder: &Path) -> Self {
        let (out, log) = (folder.join("stdout"), folder.join("log"));
        command.stdout(fs::File::create(&out).unwrap()).stderr(fs::File::create(&log).unwrap());
        Self { child: command.spawn().unwrap(), out, log }
    }

    pub fn log(&self) -> String {
        fs::read_to_string(&self.log).unwrap()
    }

    pub fn out(&self) -> String {
        fs::read_to_string(&self.out).unwrap()
    }

    pub fn wait_for_log(&self, text: &str) {
        until(|| self.log().contains(text).then_some(()), || format!("`{text}` is not in the log:\n{}", self.log()));
    }

    /// Returns the address on which a daemon listens.
    pub fn address(&self) -> String {
        let address = || Some(self.out().lines().next()?.strip_prefix("listening on ")?.to_owned());
        until(address, || format!("it does not listen:\n{}", self.log()))
    }

    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Sends a signal, such as `STOP`.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").arg(format!("-{name}")).arg(self.child.id().to_string()).status().unwrap();
        assert!(sent.success());
    }

    /// Sends SIGTERM.
    pub fn terminate(&mut self) -> ExitStatus {
        self.signal("TERM");
        self.wait()
    }

    /// Ends it at once.
    #[cfg(feature = "cluster")]
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        let log = self.log.clone();
        until(|| self.child.try_wait().unwrap(), || format!("it does not end:\n{}", fs::read_to_string(&log).unwrap()))
    }
}
