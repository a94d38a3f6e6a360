//! Logs: to standard error, filtered by `--log` or the environment variable `STERADIAN_LOG`.

use std::io::{self, IsTerminal};

use tracing_subscriber::EnvFilter;

use super::CliError;

/// What is logged unless something else is asked for; the graphics libraries only when it matters.
const DEFAULT: &str = "info,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn";

/// Starts logging; once per process.
pub fn start(argument: Option<&str>) -> Result<(), CliError> {
    let (name, filter) = match (argument, std::env::var("STERADIAN_LOG")) {
        (Some(filter), _) => ("--log", filter.to_owned()),
        (None, Ok(filter)) if !filter.is_empty() => ("STERADIAN_LOG", filter),
        _ => ("the default", DEFAULT.to_owned()),
    };
    let wrong = |problem: String| {
        CliError::Usage(format!(
            "{name} {filter}: {problem}; allowed are error, warn, info, debug, trace, and filters such as info,steradian::service=debug"
        ))
    };
    let filter = EnvFilter::try_new(&filter).map_err(|error| wrong(error.to_string()))?;
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal())
        .with_target(false)
        .try_init()
        .map_err(|error| wrong(error.to_string()))
}
