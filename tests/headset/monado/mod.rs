//! Monado, a real OpenXR runtime that needs no headset, for the tests of the headset. `scripts/monado.sh` fetches it;
//! here are its services ([`Service`]), the poses that a test gives it ([`Remote`]) and a harness that shows the tests as
//! ignored, with the reason, where it cannot run ([`harness`]).
//!
//! Monado's libraries want a newer C library than a test's own process may have, so a test never loads them itself. It
//! starts a program through the dynamic linker that was fetched along with them: Steradian ([`Service::command`]), or a
//! function of its own executable ([`Service::run_inner`]).
#![allow(dead_code, unused_imports, reason = "each test binary uses its own part of this")]

pub mod harness;
mod remote;
mod service;

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::OnceLock,
};

use serde::Deserialize;

pub use self::{
    remote::{Buttons, Controller, Eye, Pose, Remote, RemoteState},
    service::{Driver, Lifetime, Service},
};

/// What `scripts/monado.sh` writes about the folder that it unpacked Monado to.
#[derive(Clone, Debug, Deserialize)]
pub struct Monado {
    /// Number of the script's recipe.
    pub recipe: u32,
    /// The folder that all of this stands in.
    pub folder: PathBuf,
    /// Dynamic linker of the C library that the runtime wants.
    pub linker: PathBuf,
    /// Argument of the linker's `--library-path`.
    pub library_path: String,
    /// `monado-service`.
    pub service: PathBuf,
    /// `monado-ctl`.
    pub control: PathBuf,
    /// Manifest of the runtime, for `XR_RUNTIME_JSON`.
    pub openxr_runtime: PathBuf,
    /// `libopenxr_loader.so.1`.
    pub openxr_loader: PathBuf,
    /// Folder with the manifest of the core validation layer, for `XR_API_LAYER_PATH`.
    pub openxr_layers: PathBuf,
    /// Manifest of the software Vulkan driver, for `VK_DRIVER_FILES`.
    pub vulkan_driver: PathBuf,
    /// `libvulkan.so.1`.
    pub vulkan_loader: PathBuf,
}

impl Monado {
    /// Finds Monado, fetching it if it is not there yet; once per process.
    ///
    /// # Errors
    /// The reason why it cannot be had here, in one line.
    pub fn find() -> Result<&'static Self, String> {
        static FOUND: OnceLock<Result<Monado, String>> = OnceLock::new();
        FOUND.get_or_init(fetch).as_ref().map_err(Clone::clone)
    }

    /// A command that starts a program with Monado's C library and Vulkan driver. The program's own libraries are looked
    /// for among Monado's too: it must need none but those of C, and what it opens at run time.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(&self.linker);
        command.arg("--library-path").arg(&self.library_path).arg(program);
        // Nothing of this machine's or user's set-up may change a result.
        for (name, _) in std::env::vars_os() {
            let prefixes = ["XR_", "XRT_", "IPC_", "SIMULATED_", "REMOTE_", "U_PACING_", "VK_", "MESA_", "LD_"];
            if name.to_str().is_some_and(|name| prefixes.iter().any(|prefix| name.starts_with(prefix))) {
                command.env_remove(name);
            }
        }
        command
            .env("VK_DRIVER_FILES", &self.vulkan_driver)
            .env("VK_LOADER_LAYERS_DISABLE", "~implicit~")
            .env("MESA_SHADER_CACHE_DIR", self.folder.join("shaders"))
            .stdin(Stdio::null());
        command
    }
}

/// Runs the script, and reads what it wrote.
fn fetch() -> Result<Monado, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/monado.sh");
    let output = Command::new(&script)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("{} cannot be started: {error}", script.display()))?;
    if !output.status.success() {
        // The script's last line says why; what stands before are the messages of its tools.
        let messages = String::from_utf8_lossy(&output.stderr);
        let reason = messages.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gives no reason");
        return Err(format!("{} ({})", reason.trim_start_matches("setup: "), output.status));
    }
    let folder = String::from_utf8_lossy(&output.stdout);
    let description = Path::new(folder.trim_end_matches('\n')).join("runtime.json");
    let text = std::fs::read_to_string(&description).map_err(|error| format!("{}: {error}", description.display()))?;
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", description.display()))
}
