//! Daemons of the axis `live`: this program with `serve`, as child processes.
//!
//! A daemon is killed when it is dropped. It also ends if this process is killed, because its standard input is closed then.

use std::{ffi::OsString, path::PathBuf, sync::Arc, time::Duration};

use tokio::runtime::Runtime;

use crate::output::Encoding;
use crate::{
    chart::{LIVE_TURN_DEG_S, LiveDaemon, LiveRequest, LiveRound},
    cli::CliError,
    gpu::GpuOptions,
    service::{Delivered, DeliveryRound, LocalDaemon, measure_delivery, median_parts},
};

/// Time limit for the start of a daemon, and for each frame; a daemon that exceeds it has failed.
const PATIENCE: Duration = Duration::from_secs(120);
/// Poses per second.
const POSES_HZ: f64 = 250.0;

/// Starts daemons for [`chart::run`](crate::chart::run).
pub struct Daemons {
    program: PathBuf,
    runtime: Arc<Runtime>,
    /// Global arguments, which precede those of `serve`.
    global: Vec<OsString>,
}

impl Daemons {
    /// Prepares to start daemons. `program` must be this version of `steradian`; the daemons use the same adapter options, and the cache unless
    /// `no_cache` is set.
    ///
    /// # Errors
    /// The threads of the client cannot be started.
    pub fn new(program: PathBuf, options: &GpuOptions, no_cache: bool) -> Result<Self, CliError> {
        let mut global = vec!["--log".into(), "error".into()];
        if let Some(adapter) = &options.adapter {
            global.extend(["--adapter".into(), adapter.into()]);
        }
        let restrictions = options.restrictions();
        if !restrictions.is_empty() {
            global.extend(["--adapter-limits".into(), restrictions.into()]);
        }
        if no_cache {
            global.push("--no-cache".into());
        }
        let runtime = Arc::new(Runtime::new().map_err(CliError::Runtime)?);
        Ok(Self { program, runtime, global })
    }

    /// Starts a daemon.
    ///
    /// # Errors
    /// The reason why the daemon does not serve.
    pub fn start(&self, request: &LiveRequest<'_>) -> Result<Box<dyn LiveDaemon>, String> {
        // The daemon reads the file once, when it starts.
        let folder = tempfile::tempdir().map_err(|error| format!("no temporary folder: {error}"))?;
        let file = folder.path().join(format!("{}.toml", request.name));
        std::fs::write(&file, request.text).map_err(|error| format!("cannot write {}: {error}", file.display()))?;
        let mut arguments = self.global.clone();
        arguments.extend(["serve".into(), "--until-input-closes".into(), "--config".into(), file.into()]);
        for key in &request.set {
            arguments.extend(["--set".into(), key.into()]);
        }
        let daemon = LocalDaemon::start(&self.program, &arguments, PATIENCE);
        let daemon = daemon.map_err(|error| error.to_string())?;
        Ok(Box::new(Measured { daemon, runtime: Arc::clone(&self.runtime) }))
    }
}

struct Measured {
    daemon: LocalDaemon,
    runtime: Arc<Runtime>,
}

impl LiveDaemon for Measured {
    fn measure(&mut self, view: &str, skipped: usize, length: Duration) -> Result<LiveRound, String> {
        let round = DeliveryRound {
            view: view.to_owned(),
            encoding: Encoding::Rgba8,
            skipped,
            length,
            turn_deg_s: LIVE_TURN_DEG_S,
            poses_hz: POSES_HZ,
            patience: PATIENCE,
        };
        let delivered = self.runtime.block_on(measure_delivery(self.daemon.address(), &round));
        delivered.map(round_of).map_err(|error| error.to_string())
    }
}

fn round_of(delivered: Delivered) -> LiveRound {
    LiveRound {
        frames_per_s: delivered.frames_per_s,
        interval_ms: delivered.interval_ms(),
        age_ms: delivered.age_ms,
        ev100: delivered.ev100,
        pixels: delivered.pixels,
        parts_ms: median_parts(&delivered.parts_ms),
    }
}
