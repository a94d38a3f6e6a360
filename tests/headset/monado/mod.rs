//! Monado, a real OpenXR runtime that needs no headset, for the headset tests. `scripts/monado.sh` fetches it; this
//! module has its services ([`Service`]), the poses that a test sends ([`Remote`]) and a harness that reports the tests
//! as ignored, with the reason, if it cannot run ([`harness`]).
//!
//! Monado's libraries need a newer C library than the process of a test may have, so a test never loads them itself. It
//! starts a program through the dynamic linker that was fetched with them: Steradian ([`Service::command`]), or a
//! function of the test executable ([`Service::run_inner`]).
#![allow(dead_code, unused_imports, reason = "each test binary uses only a part of this module")]

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

/// Description, written by `scripts/monado.sh`, of the folder with the unpacked Monado.
#[derive(Clone, Debug, Deserialize)]
pub struct Monado {
    /// Number of the script's recipe.
    pub recipe: u32,
    /// Folder with all files.
    pub folder: PathBuf,
    /// Dynamic linker of the C library that the runtime needs.
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
    /// Finds Monado, and fetches it if necessary. This is done once per process.
    ///
    /// # Errors
    /// The reason why it is not available, in one line.
    pub fn find() -> Result<&'static Self, String> {
        static FOUND: OnceLock<Result<Monado, String>> = OnceLock::new();
        FOUND.get_or_init(fetch).as_ref().map_err(Clone::clone)
    }

    /// Returns a command that starts a program with Monado's C library and Vulkan driver. The program's libraries are
    /// searched among those of Monado, so it must not need any libraries except the C library and those that it opens
    /// at run time.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(&self.linker);
        command.arg("--library-path").arg(&self.library_path).arg(program);
        // Settings of this machine or user must not change a result.
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

/// Runs the script and reads its description.
fn fetch() -> Result<Monado, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/monado.sh");
    let output = Command::new(&script)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("{} cannot be started: {error}", script.display()))?;
    if !output.status.success() {
        // The last line of the script gives the reason; the lines before it are messages of its tools.
        let messages = String::from_utf8_lossy(&output.stderr);
        let reason = messages.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gives no reason");
        return Err(format!("{} ({})", reason.trim_start_matches("setup: "), output.status));
    }
    let folder = String::from_utf8_lossy(&output.stdout);
    let description = Path::new(folder.trim_end_matches('\n')).join("runtime.json");
    let text = std::fs::read_to_string(&description).map_err(|error| format!("{}: {error}", description.display()))?;
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", description.display()))
}
