//! Runs the program with small views of the brightest stars.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
};

use steradian::service::Client;
use tempfile::TempDir;

const CONFIGURATION: &str = "
[scene]
catalogues = ['builtin:bright']
time = 2026-01-01T00:00:00Z
[scene.camera]
orientation = [0.6998836, -0.0379043, -0.0385717, 0.7122067]  # looks at Orion, north up
[[views]]
name = 'window'
type = 'perspective'
size = [640, 400]
fov_y_deg = 60.0
orientation = [0.0, 0.1305262, 0.0, 0.9914449]  # to the left by 15 degrees
[[views]]
name = 'dome'
type = 'dome_master'
size = [512, 512]
fov_deg = 180.0
tilt_deg = 20.0
[[views]]
name = 'eyes'
type = 'stereo'
ipd_m = 0.064
size = [320, 320]
fov = { left_deg = -52.0, right_deg = 44.0, up_deg = 48.0, down_deg = -50.0 }
[[views]]
name = 'lens'
type = 'fisheye'
mapping = 'equisolid'
fov_deg = 220.0
size = [512, 400]
[[views]]
name = 'around'
type = 'equirectangular'
size = [1024, 512]
";

/// A running daemon; killed on drop.
pub struct Daemon {
    process: Child,
    folder: TempDir,
    pub address: String,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        self.kill();
    }
}

impl Daemon {
    pub fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("views.toml"), CONFIGURATION).unwrap();
        let (process, address) = launch(&folder, "127.0.0.1:0");
        Self { process, folder, address }
    }

    /// Sends a signal by its name.
    pub fn signal(&self, name: &str) {
        let status = Command::new("kill").args([&format!("-{name}"), &self.process.id().to_string()]).status().unwrap();
        assert!(status.success());
    }

    /// SIGKILL.
    pub fn kill(&mut self) {
        // The daemon may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    /// Restarts it on the same port.
    pub fn restart(&mut self) {
        self.kill();
        let (process, address) = launch(&self.folder, &self.address);
        assert_eq!(address, self.address);
        self.process = process;
    }

    /// Restarts it with an extended configuration.
    pub fn restart_with(&mut self, more: &str) {
        std::fs::write(self.folder.path().join("views.toml"), format!("{CONFIGURATION}\n{more}")).unwrap();
        self.restart();
    }

    /// Restarts it with a configuration that has an observer instead of the camera.
    pub fn restart_at(&mut self, observer: &str) {
        let (before, after) = CONFIGURATION.split_once("[scene.camera]").unwrap();
        let (_, views) = after.split_once("[[views]]").unwrap();
        std::fs::write(self.folder.path().join("views.toml"), format!("{before}{observer}\n[[views]]{views}")).unwrap();
        self.restart();
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Returns another client.
    pub async fn client(&self) -> Client {
        Client::connect(&self.url()).await.unwrap()
    }
}

fn launch(folder: &TempDir, listen: &str) -> (Child, String) {
    let mut process = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["serve", "--config", "views.toml", "--listen", listen])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("the daemon says: {line}"));
    (process, address.to_owned())
}
