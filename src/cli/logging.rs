//! Logs to standard error, filtered by `--log` or the environment variable `STERADIAN_LOG`.

use std::io::{self, IsTerminal};

use tracing_log::AsLog;
use tracing_subscriber::{
    EnvFilter, Layer, Registry,
    layer::{Layered, SubscriberExt},
    util::SubscriberInitExt,
};

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
    let most = filter.max_level_hint();
    let (exporting, traces) = telemetry::start()?.unzip();
    subscriber(filter, traces.map(Layer::boxed)).try_init().map_err(|error| wrong(error.to_string()))?;
    // Only the filtered layer reads lines of the `log` crate; the other layers read targets that use `tracing`. Without this limit, Naga formats a line for
    // every expression of a shader.
    if let Some(most) = most {
        tracing_log::log::set_max_level(most.as_log());
    }
    Ok(exporting)
}

type BoxedLayer = Box<dyn Layer<Registry> + Send + Sync>;

/// The layers that receive the log. Absent layers are left out of the list: with a layer that is `None`, every call would create spans of the network
/// libraries, although every filter rejects them.
fn subscriber(filter: EnvFilter, traces: Option<BoxedLayer>) -> Layered<Vec<BoxedLayer>, Registry> {
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal())
        .with_target(false)
        .with_filter(filter);
    let mut layers = vec![lines.boxed()];
    layers.extend(traces);
    #[cfg(feature = "cluster")]
    layers.push(crate::service::cluster::watch_refusals().boxed());
    tracing_subscriber::registry().with(layers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::unwrap_used, reason = "a test may panic")]
    fn spans_that_no_filter_wants_are_not_created() {
        let filter = EnvFilter::try_new(DEFAULT).unwrap();
        tracing::subscriber::with_default(subscriber(filter, None), || {
            assert!(tracing::trace_span!(target: "h2::codec", "poll").is_disabled());
            assert!(!tracing::info_span!(target: "steradian", "work").is_disabled());
        });
    }
}
