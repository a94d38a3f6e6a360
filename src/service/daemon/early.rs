//! The time before the daemon serves: it listens at once and reports the progress of its start to clients.
//!
//! Meanwhile, health is NOT_SERVING; every other call gets UNAVAILABLE, and every page gets the status 503. Both contain the progress. The access
//! rules already apply. The daemon then takes over the same socket, so no connection is refused during the change.

use std::{
    collections::BTreeMap,
    fmt,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use tokio::{
    runtime::{Builder, Runtime},
    sync::{oneshot, watch},
    task::JoinHandle,
    time::timeout,
};
use tonic::{
    Status,
    body::Body,
    codegen::http::{HeaderValue, Request, Response, StatusCode, header},
    transport::Server,
};
use tonic_health::{ServingStatus, server::HealthReporter};

use super::{Address, NetworkOptions, ServeError, end_health, listen::Listening, report_health};
use crate::service::network::{
    access::Gate,
    clients::Shares,
    connections::{Bounds, Incoming},
    http_handler::{HEALTH, HandleFirst, HttpHandler, PLAIN, refused_call, text},
};

/// Calls of the health service.
const HEALTH_CALLS: &str = "/grpc.health.v1.Health/";
/// Connections that do not end within this time are cut off. No call takes long here.
const FAREWELL: Duration = Duration::from_millis(200);
/// Maximum number of streams in which clients watch the health.
const WATCHES: usize = 256;

/// Work that the daemon waits for, by kind.
#[derive(Debug, Default)]
pub struct StartProgress(Mutex<BTreeMap<&'static str, String>>);

impl StartProgress {
    /// Records the current step of a kind of work.
    pub fn tell(&self, work: &'static str, step: String) {
        // No code panics while it holds the lock, so the content is consistent even if the lock is poisoned.
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(work, step);
    }

    /// Records that a kind of work is done.
    pub fn done(&self, work: &'static str) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(work);
    }
}

impl fmt::Display for StartProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let steps: Vec<String> = self.0.lock().unwrap_or_else(PoisonError::into_inner).values().cloned().collect();
        f.write_str(if steps.is_empty() { "it begins".to_owned() } else { steps.join("; ") }.as_str())
    }
}

/// The server that runs until the daemon serves.
pub struct EarlyServer {
    listening: Listening,
    server: Running,
}

struct Running {
    close: Option<oneshot::Sender<()>>,
    health: HealthReporter,
    task: JoinHandle<()>,
    /// `None` while it is dropped.
    runtime: Option<Runtime>,
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

impl EarlyServer {
    /// Listens on the address of the network's options. Needs a tokio runtime with I/O and time.
    ///
    /// # Errors
    ///
    /// The errors of [`super::run`] about the access rules and the address.
    pub async fn open(network: &NetworkOptions, progress: Arc<StartProgress>) -> Result<Self, ServeError> {
        let Listening { listener, address, access, hangups } = Listening::open(network).await?;
        // Use a separate runtime. When it ends, all connections end, even those without a request, which browsers open in advance.
        let runtime = Builder::new_multi_thread().worker_threads(1).thread_name("starting").enable_all().build()?;
        let (listener, early) = listener.twice(runtime.handle())?;
        // The rules are not reloaded before the daemon serves; a signal is remembered until then.
        let (rules, current) = watch::channel(Arc::new(access.clone()));
        let (health, health_service) = tonic_health::server::health_reporter();
        report_health(&health, ServingStatus::NotServing).await;
        let (close, closed) = oneshot::channel::<()>();
        let serving = Server::builder()
            .accept_http1(true)
            .layer(Bounds::new(network.hosts.clone()))
            .layer(Gate::new(current.clone(), None))
            .layer(HandleFirst(Starting(progress)))
            .add_service(health_service)
            .serve_with_incoming_shutdown(Incoming::new(early, current, Arc::new(Shares::new(WATCHES))), async move {
                // A dropped sender also ends this server.
                let _ = closed.await;
            });
        let task = runtime.spawn(async move {
            if let Err(error) = serving.await {
                tracing::warn!("clients cannot follow the start: {error}");
            }
            drop(rules);
        });
        tracing::info!("starting on {address}");
        Ok(Self {
            listening: Listening { listener, address, access, hangups },
            server: Running { close: Some(close), health, task, runtime: Some(runtime) },
        })
    }

    /// Returns the address.
    pub fn address(&self) -> &Address {
        &self.listening.address
    }

    /// Hands the socket to the daemon; the future ends the server.
    pub(super) fn hand_over(self) -> (Listening, impl Future<Output = ()>) {
        (self.listening, self.server.end())
    }

    /// Ends the server, because the daemon will not serve.
    pub async fn give_up(self) {
        self.server.end().await;
        self.listening.address.remove_socket();
    }
}

impl Running {
    /// Ends calls normally, and then all connections.
    async fn end(mut self) {
        drop(self.close.take());
        end_health(&mut self.health).await;
        if timeout(FAREWELL, &mut self.task).await.is_err() {
            tracing::debug!("connections that were opened during the start are cut off");
        }
    }
}

/// Answers everything but the calls of the health service.
#[derive(Clone)]
struct Starting(Arc<StartProgress>);

impl HttpHandler for Starting {
    fn answer(&self, request: &Request<Body>) -> Option<Response<Body>> {
        let path = request.uri().path();
        if path.starts_with(HEALTH_CALLS) {
            return None;
        }
        let status = Status::unavailable(format!("the daemon is starting: {}", self.0));
        if let Some(response) = refused_call(request, &status) {
            return Some(response);
        }
        // Any client may ask for the health, so it reveals nothing else.
        let told = if path == HEALTH { "starting" } else { status.message() };
        let mut response = text(StatusCode::SERVICE_UNAVAILABLE, PLAIN, format!("{told}\n"));
        let headers = response.headers_mut();
        // A browser asks again after a second.
        headers.insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
        headers.insert(header::REFRESH, HeaderValue::from_static("1"));
        Some(response)
    }
}
