//! Exports traces to an OpenTelemetry collector (OTLP over gRPC) if the standard variable `OTEL_EXPORTER_OTLP_ENDPOINT`
//! names one.
//!
//! Spans have the target [`SPANS`](crate::service::SPANS): `frame` (from the start of planning to the finished image),
//! `encode` (the images of a view) and `call` (from a request to its answer, or to the start of a stream).

use super::CliError;

/// Environment variable that names the collector, defined by OpenTelemetry.
const ENDPOINT: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";

/// Returns the address of the collector; `None` disables traces.
fn endpoint() -> Option<String> {
    std::env::var(ENDPOINT).ok().filter(|endpoint| !endpoint.is_empty())
}

#[cfg(feature = "opentelemetry")]
mod exporting {
    use opentelemetry::trace::TracerProvider as _;
    use opentelemetry_otlp::{SpanExporter, WithExportConfig};
    use opentelemetry_sdk::{
        Resource,
        trace::{SdkTracer, SdkTracerProvider},
    };
    use tokio::runtime::Runtime;
    use tracing_opentelemetry::OpenTelemetryLayer;
    use tracing_subscriber::{Layer, filter::Targets, layer::Filter, registry::LookupSpan};

    use super::{CliError, ENDPOINT, endpoint};
    use crate::service::SPANS;

    /// Sends spans until it is dropped, which sends the last ones.
    #[derive(Debug)]
    pub struct Exporting {
        provider: SdkTracerProvider,
        // The threads of this runtime run the exporter.
        _runtime: Runtime,
    }

    impl Drop for Exporting {
        fn drop(&mut self) {
            if let Err(error) = self.provider.shutdown() {
                tracing::warn!("the last traces were not sent: {error}");
            }
        }
    }

    /// Returns the exporter and the layer that feeds it; `None` if no collector is named.
    pub fn start<S>() -> Result<Option<(Exporting, impl Layer<S>)>, CliError>
    where
        S: tracing::Subscriber + for<'span> LookupSpan<'span>,
        Targets: Filter<S>,
    {
        let Some(endpoint) = endpoint() else { return Ok(None) };
        let wrong = |problem: String| {
            CliError::Usage(format!("{ENDPOINT} = {endpoint}: {problem}; must be a URL such as http://127.0.0.1:4317"))
        };
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().thread_name("traces").build();
        let runtime = runtime.map_err(|error| wrong(error.to_string()))?;
        let exporter = {
            let _entered = runtime.enter();
            SpanExporter::builder().with_tonic().with_endpoint(&endpoint).build()
        };
        let exporter = exporter.map_err(|error| wrong(error.to_string()))?;
        let resource = Resource::builder().with_service_name("steradian").build();
        let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build();
        let layer: OpenTelemetryLayer<S, SdkTracer> =
            tracing_opentelemetry::layer().with_tracer(provider.tracer("steradian"));
        let layer = layer.with_filter(Targets::new().with_target(SPANS, tracing::Level::TRACE));
        Ok(Some((Exporting { provider, _runtime: runtime }, layer)))
    }
}

#[cfg(not(feature = "opentelemetry"))]
mod exporting {
    use tracing_subscriber::layer::Identity;

    use super::{CliError, ENDPOINT, endpoint};

    /// Exporter of a build without traces: sends nothing.
    #[derive(Debug)]
    pub struct Exporting;

    /// Returns an error if a collector is named, because it would receive no traces.
    pub fn start() -> Result<Option<(Exporting, Identity)>, CliError> {
        match endpoint() {
            None => Ok(None),
            Some(endpoint) => Err(CliError::Usage(format!(
                "{ENDPOINT} = {endpoint}: this program was built without traces; rebuild it with --features opentelemetry, or unset the variable"
            ))),
        }
    }
}

pub use exporting::{Exporting, start};
