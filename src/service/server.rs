//! The daemon: binds, serves, and on a signal drains: health turns to NOT_SERVING, no new connection is accepted, streams end
//! cleanly, calls in flight finish, the render thread ends.

use std::{any::Any, fmt, io, net::SocketAddr, pin::Pin, sync::Arc, time::Duration};

use tokio::{net::TcpListener, signal, sync::oneshot, time::timeout};
use tonic::{
    server::NamedService,
    transport::{Server, server::TcpIncoming},
};
use tonic_health::{ServingStatus, server::HealthReporter};
use tonic_web::GrpcWebLayer;

use super::{
    engine::Engine,
    handlers::Service,
    proto::{
        self, camera_service_server::CameraServiceServer, diagnostics_service_server::DiagnosticsServiceServer,
        view_service_server::ViewServiceServer,
    },
    render::{self, RenderThread},
};
use crate::{plan::settings::RenderSettings, scene::SceneSnapshot, view::Rig};

/// A client that has not answered for this long is asked whether it is still there.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
/// A client that does not answer that is taken for gone.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// How long calls and clients may take to finish once the daemon is told to end.
const DRAIN: Duration = Duration::from_secs(5);
/// Calls of `RenderFrame` at the same time, from the queue to the last encoded byte; more are refused.
const PENDING_RENDERS: usize = 16;

/// Names of the services whose health is reported, besides that of the whole (the empty name).
const SERVICES: [&str; 3] = [
    <CameraServiceServer<Service> as NamedService>::NAME,
    <ViewServiceServer<Service> as NamedService>::NAME,
    <DiagnosticsServiceServer<Service> as NamedService>::NAME,
];

/// What tells the daemon to end.
pub enum Shutdown {
    /// SIGINT or SIGTERM (elsewhere than on Unix: Ctrl-C).
    Signals,
    /// The end of a future.
    When(Pin<Box<dyn Future<Output = ()> + Send>>),
}

impl fmt::Debug for Shutdown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Shutdown::Signals => "Signals",
            Shutdown::When(_) => "When",
        })
    }
}

/// Everything that [`run`] needs.
pub struct ServeOptions {
    /// Address to listen on, `host:port`; port 0 takes a free one.
    pub listen: String,
    /// The renderer.
    pub engine: Box<dyn Engine>,
    /// The scene; its camera is the first pose.
    pub scene: SceneSnapshot,
    /// The views.
    pub rig: Rig,
    /// How they are drawn.
    pub settings: RenderSettings,
    /// Called once with the address when clients can connect.
    pub ready: Box<dyn FnOnce(SocketAddr) + Send>,
    /// What tells the daemon to end.
    pub shutdown: Shutdown,
    /// How long calls and clients may take to finish then; afterwards they are cut off.
    pub drain: Duration,
    /// Calls of `RenderFrame` at the same time; more get RESOURCE_EXHAUSTED.
    pub pending_renders: usize,
}

impl ServeOptions {
    /// Options that end on signals, after a drain of at most 5 s, with up to 16 pending calls of `RenderFrame`.
    pub fn new(
        listen: impl Into<String>,
        engine: Box<dyn Engine>,
        scene: SceneSnapshot,
        rig: Rig,
        settings: RenderSettings,
        ready: impl FnOnce(SocketAddr) + Send + 'static,
    ) -> Self {
        Self {
            listen: listen.into(),
            engine,
            scene,
            rig,
            settings,
            ready: Box::new(ready),
            shutdown: Shutdown::Signals,
            drain: DRAIN,
            pending_renders: PENDING_RENDERS,
        }
    }
}

/// Why the daemon could not start, or ended other than it was told to.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address is none.
    #[error("listen = `{listen}`: {problem}; needed is host:port, for example 127.0.0.1:7143, port 0 for a free one")]
    Address {
        /// What was given.
        listen: String,
        /// What is wrong.
        problem: String,
    },
    /// Something listens there already.
    #[error("{address} is in use by another process: stop it, or listen on another port (port 0 takes a free one)")]
    AddressInUse {
        /// The address.
        address: SocketAddr,
    },
    /// The system refuses the address.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// Signals cannot be received or a thread cannot be started.
    #[error("cannot set up the daemon: {0}")]
    System(#[from] io::Error),
    /// The protocol's descriptors are broken.
    #[error("server reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The server failed.
    #[error("the server failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The renderer panicked.
    #[error("the render thread panicked: {message}")]
    Panicked {
        /// Its message.
        message: String,
    },
    /// The renderer did not come back.
    #[error("the render thread did not end within {seconds} s")]
    Stuck {
        /// How long it was waited for, s.
        seconds: f64,
    },
}

async fn bind(listen: &str) -> Result<TcpListener, ServeError> {
    let wrong = |problem: String| ServeError::Address { listen: listen.to_owned(), problem };
    let mut addresses = tokio::net::lookup_host(listen).await.map_err(|error| wrong(error.to_string()))?;
    let address = addresses.next().ok_or_else(|| wrong("the host has no address".to_owned()))?;
    TcpListener::bind(address).await.map_err(|source| match source.kind() {
        io::ErrorKind::AddrInUse => ServeError::AddressInUse { address },
        _ => ServeError::Bind { address, source },
    })
}

/// A future that ends when the process is told to; the handlers are in place when this function returns.
#[cfg(unix)]
fn signals() -> io::Result<impl Future<Output = ()> + Send> {
    use signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => tracing::info!("SIGINT: draining"),
            _ = terminate.recv() => tracing::info!("SIGTERM: draining"),
        }
    })
}

/// A future that ends when the process is told to.
#[cfg(not(unix))]
fn signals() -> io::Result<impl Future<Output = ()> + Send> {
    Ok(async {
        match signal::ctrl_c().await {
            Ok(()) => tracing::info!("Ctrl-C: draining"),
            Err(error) => tracing::error!("no signals can be received, draining: {error}"),
        }
    })
}

async fn report_health(health: &HealthReporter, status: ServingStatus) {
    health.set_service_status("", status).await;
    for service in SERVICES {
        health.set_service_status(service, status).await;
    }
}

/// Lets every `Watch` call end, which would keep its connection open otherwise.
async fn end_health(health: &mut HealthReporter) {
    health.clear_service_status("").await;
    for service in SERVICES {
        health.clear_service_status(service).await;
    }
}

/// The text of a panic.
fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}

/// Waits for the render thread, which was told to end.
async fn join(mut thread: RenderThread, ended: bool, patience: Duration) -> Result<(), ServeError> {
    // The receiver must not be asked again once it has answered.
    if !ended && timeout(patience, &mut thread.ended).await.is_err() {
        return Err(ServeError::Stuck { seconds: patience.as_secs_f64() });
    }
    thread.join.join().map_err(|payload| ServeError::Panicked { message: panic_message(payload.as_ref()) })
}

/// Serves until told to end. Needs a tokio runtime with I/O and time.
///
/// # Errors
///
/// See [`ServeError`]; after an orderly end, even if clients had to be cut off, there is none.
pub async fn run(options: ServeOptions) -> Result<(), ServeError> {
    let ServeOptions { listen, engine, scene, rig, settings, ready, shutdown, drain, pending_renders } = options;
    let listener = bind(&listen).await?;
    let address = listener.local_addr()?;
    let mut shutdown = match shutdown {
        Shutdown::Signals => Box::pin(signals()?),
        Shutdown::When(future) => future,
    };

    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(proto::DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let (reflection_v1, reflection_v1alpha) = (reflection().build_v1()?, reflection().build_v1alpha()?);
    let (mut health, health_service) = tonic_health::server::health_reporter();
    report_health(&health, ServingStatus::Serving).await;

    let (rig, info) = (Arc::new(rig), engine.info());
    let (stars, revision) = (scene.stars.stars.len() as u64, scene.revision);
    let (handle, mut thread) = render::spawn(engine, scene, Arc::clone(&rig), settings, pending_renders)?;
    let service = Service::new(handle.clone(), rig, info, stars, revision, pending_renders);

    let (close, closed) = oneshot::channel::<()>();
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
    let serving = Server::builder()
        .accept_http1(true)
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
        .layer(GrpcWebLayer::new())
        .add_service(CameraServiceServer::new(service.clone()))
        .add_service(ViewServiceServer::new(service.clone()))
        .add_service(DiagnosticsServiceServer::new(service))
        .add_service(health_service)
        .add_service(reflection_v1)
        .add_service(reflection_v1alpha)
        .serve_with_incoming_shutdown(incoming, async move {
            // A sender that is gone means the same as one that speaks.
            let _ = closed.await;
        });
    tokio::pin!(serving);
    tracing::info!("serving on {address}");
    ready(address);

    // Until told to end, or until something breaks that the daemon cannot do without.
    let mut render_ended = false;
    let mut outcome = tokio::select! {
        () = &mut shutdown => Ok(()),
        _ = &mut thread.ended => {
            render_ended = true;
            Ok(())
        }
        result = &mut serving => {
            handle.stop();
            join(thread, false, drain).await?;
            return result.map_err(ServeError::from);
        }
    };

    report_health(&health, ServingStatus::NotServing).await;
    handle.drain();
    drop(close);
    end_health(&mut health).await;
    match timeout(drain, &mut serving).await {
        Ok(result) => outcome = result.map_err(ServeError::from),
        Err(_) => tracing::warn!("cut off clients that did not finish within {} s", drain.as_secs_f64()),
    }
    handle.stop();
    join(thread, render_ended, drain).await?;
    outcome
}
