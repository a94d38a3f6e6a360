//! Logs to standard error, filtered by `--log` or the environment variable `STERADIAN_LOG`.

use std::io::{self, IsTerminal};

use tracing_subscriber::{EnvFilter, Layer, layer::SubscriberExt, util::SubscriberInitExt};

use super::{
    CliError,
    telemetry::{self, Exporting},
};

/// Default filter. Graphics and window libraries log only warnings and errors.
const DEFAULT: &str = "info,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn,winit=error,zenoh=error";

/// Starts logging, and tracing if a collector is configured; called once per process. The returned exporter sends
/// traces until it is dropped.
pub fn start(argument: Option<&str>) -> Result<Option<Exporting>, CliError> {
    let (name, filter) = match (argument, std::env::var("STERADIAN_LOG")) {
        (Some(filter), _) => ("--log", filter.to_owned()),
        (None, Ok(filter)) if !filter.is_empty() => ("STERADIAN_LOG", filter),
        _ => ("the default", DEFAULT.to_owned()),
    };
    let wrong = |problem: String| {
        CliError::Usage(format!(
            "{name} {filter}: {problem}; must be error, warn, info, debug, trace or a filter such as info,steradian::service=debug"
        ))
    };
    let filter = EnvFilter::try_new(&filter).map_err(|error| wrong(error.to_string()))?;
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal())
        .with_target(false)
        .with_filter(filter);
    let (exporting, traces) = telemetry::start()?.unzip();
    let all = tracing_subscriber::registry().with(lines).with(traces);
    #[cfg(feature = "cluster")]
    let all = all.with(crate::service::cluster::watch_refusals());
    all.try_init().map_err(|error| wrong(error.to_string()))?;
    Ok(exporting)
}
