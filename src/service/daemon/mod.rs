//! The daemon's life: it binds, serves, and drains on a signal. Draining turns health to NOT_SERVING, accepts no new
//! connection, ends streams, finishes calls in flight, and ends the render thread. Work that exceeds the drain time is
//! abandoned. The rules for listening are in [`listen`].

mod displays;
mod early;
mod initial_state;
mod listen;
mod options;
mod server;
mod threads;

use std::{io, path::PathBuf, pin::Pin, sync::Arc};

use tokio::{
    sync::{oneshot, watch},
    time::{Instant, timeout_at},
};
use tonic::{codegen::BoxFuture, server::NamedService};
use tonic_health::{ServingStatus, server::HealthReporter};

use self::{
    displays::Displays,
    initial_state::Begun,
    listen::{Listening, keep_access},
    server::Front,
    threads::{FAREWELL, Threads},
};
pub use self::{
    early::{EarlyServer, StartProgress},
    listen::check_listen,
    options::{Address, LimitOptions, NetworkOptions, Reloads, SceneOptions, ServeOptions, Shutdown, ViewOptions},
};
use crate::{
    platform::signals,
    service::{
        cluster::{Cluster, ClusterThread},
        engine::{
            background_jobs::BackgroundJobs,
            interface::EngineError,
            render_thread::{self},
            shared_state::Capacity,
        },
        handlers::service::{OptionalParts, Service},
        network::{clients::Shares, connections::Incoming},
        proto::{
            camera_service_server::CameraServiceServer, diagnostics_service_server::DiagnosticsServiceServer,
            scene_service_server::SceneServiceServer, view_service_server::ViewServiceServer,
        },
        state_file::{StateError, StateFile},
        threads::panic_message,
    },
    view::RigError,
};

/// Services whose health is reported, besides the overall health (the empty name).
const SERVICES: [&str; 4] = [
    <SceneServiceServer<Service> as NamedService>::NAME,
    <CameraServiceServer<Service> as NamedService>::NAME,
    <ViewServiceServer<Service> as NamedService>::NAME,
    <DiagnosticsServiceServer<Service> as NamedService>::NAME,
];

/// Advice if the address is taken.
fn other_address(taken: &Address) -> &'static str {
    match taken {
        Address::Tcp(_) => "listen on another port (port 0 takes a free one)",
        Address::Unix(_) => "name another path",
    }
}

/// Errors at the start of the daemon, or reasons of a premature end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address is invalid.
    #[error(
        "listen = `{listen}`: {problem}; must be host:port, for example 127.0.0.1:7143 (port 0 takes a free one), or unix:PATH"
    )]
    Address {
        /// The configured address.
        listen: String,
        /// Cause.
        problem: String,
    },
    /// Another process listens there.
    #[error("{address} is in use by another process: stop it, or {}", other_address(address))]
    AddressInUse {
        /// The address.
        address: Address,
    },
    /// The path of the socket leads to something else.
    #[error("listen = `unix:{path}`: a {what} is there, not a socket: name another path, or move it away", path = path.display())]
    NotSocket {
        /// The path.
        path: PathBuf,
        /// What is there.
        what: &'static str,
    },
    /// The system has no such sockets.
    #[error(
        "listen = `{listen}`: {problem}: name a host and a port, for example 127.0.0.1:7143 (port 0 takes a free one)"
    )]
    Unsupported {
        /// The configured address.
        listen: String,
        /// Cause.
        problem: &'static str,
    },
    /// The access rules or the certificates cannot be read.
    #[error("{0}")]
    Access(String),
    /// The address needs encryption or access control.
    #[error("listen = `{listen}`: {problem}")]
    Open {
        /// The configured address.
        listen: String,
        /// The missing parts.
        problem: String,
    },
    /// The system refuses the address.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// The address.
        address: Address,
        /// Error of the system.
        source: io::Error,
    },
    /// The definitions of the observer or the asteroid fields do not match the scene.
    #[error("the scene's objects: {0}")]
    Objects(String),
    /// The views' own settings are invalid.
    #[error("{0}")]
    Views(String),
    /// The state file cannot be used.
    #[error(transparent)]
    State(#[from] StateError),
    /// The headset's name is invalid, or is the name of a view.
    #[error("headset: {0}")]
    Headset(RigError),
    /// Signal handlers or threads cannot be created.
    #[error("cannot set up the daemon: {0}")]
    System(#[from] io::Error),
    /// The protocol's descriptors are invalid.
    #[error("server reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The server failed.
    #[error("the server failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The renderer is lost for good, such as after the loss of its device: the daemon can be restarted.
    #[error("the renderer was lost: {0}")]
    Lost(EngineError),
    /// The daemon's part in the cluster has failed.
    #[error("cluster: {0}")]
    Cluster(String),
    /// The renderer panicked.
    #[error("the render thread panicked: {message}")]
    Panicked {
        /// Message of the panic.
        message: String,
    },
}

/// Returns a future that resolves on SIGINT or SIGTERM, on Windows on Ctrl-C, Ctrl-Break and the end of the console or session; the handlers are
/// installed when this function returns. Needs a tokio runtime with I/O.
///
/// # Errors
///
/// The system refuses the handlers.
pub fn signals() -> io::Result<impl Future<Output = ()> + Send> {
    signals::end()
}

async fn report_health(health: &HealthReporter, status: ServingStatus) {
    health.set_service_status("", status).await;
    for service in SERVICES {
        health.set_service_status(service, status).await;
    }
}

/// Ends every `Watch` call, which would otherwise keep its connection open.
async fn end_health(health: &mut HealthReporter) {
    health.clear_service_status("").await;
    for service in SERVICES {
        health.clear_service_status(service).await;
    }
}

impl Shutdown {
    /// The future that resolves when the daemon is to end.
    fn future(self) -> io::Result<Pin<Box<dyn Future<Output = ()> + Send>>> {
        Ok(match self {
            Self::Signals => Box::pin(signals()?),
            Self::When(future) => future,
        })
    }
}

/// Waits until the task that saves the camera has ended, until `deadline` and at least [`FAREWELL`].
async fn wait_for_camera(keeper: tokio::task::JoinHandle<()>, deadline: Instant) {
    if !matches!(timeout_at(deadline.max(Instant::now() + FAREWELL), keeper).await, Ok(Ok(()))) {
        tracing::warn!("the last camera may not be saved");
    }
}

/// Serves until asked to end. Needs a tokio runtime with I/O and time. Encoders and a frame that exceed the drain time
/// may still run when it returns: to exit then, do not wait for the runtime's threads.
///
/// # Errors
///
/// See [`ServeError`]. An orderly end is not an error, even if clients had to be cut off.
pub fn run(options: ServeOptions) -> BoxFuture<(), ServeError> {
    // Without the box, every crate that awaits the future would compile the whole daemon again.
    Box::pin(serve(options))
}

async fn serve(options: ServeOptions) -> Result<(), ServeError> {
    let ServeOptions {
        engine,
        network,
        early,
        limits,
        scene,
        views,
        headset,
        windows,
        cluster,
        state,
        ready,
        reloads,
        shutdown,
    } = options;
    let LimitOptions { drain, pending_renders, subscribers } = limits;
    let catalogues = scene.catalogues.clone();
    let time = scene.time.clone();
    let begin = || -> Result<_, ServeError> {
        let file = state.map(|path| StateFile::open(&path)).transpose()?;
        let begun = Begun::new(scene, views, headset.as_ref(), file.as_ref())?;
        Ok((file, begun))
    };
    let (file, (Begun { scene, objects, clock, views, settings }, seen_stars)) = match begin() {
        Ok(begun) => begun,
        Err(problem) => {
            if let Some(early) = early {
                early.give_up().await;
            }
            return Err(problem);
        }
    };
    let (Listening { listener, address, access: first, hangups }, early) = match early.map(EarlyServer::hand_over) {
        Some((listening, end)) => (listening, Some(end)),
        None => (Listening::open(&network).await?, None),
    };
    let NetworkOptions { hosts, access, .. } = network;
    let (new_access, current_access) = watch::channel(Arc::new(first));
    let access_keeper = tokio::spawn(keep_access(reloads, hangups, access, new_access, time.clone()));
    let mut shutdown = shutdown.future()?;

    let (mut health, health_service) = tonic_health::server::health_reporter();
    report_health(&health, ServingStatus::Serving).await;

    let (info, limits) = (engine.info(), engine.limits());
    let background_jobs = BackgroundJobs::spawn(engine.beside(), engine.pipelines_ahead())?;
    let shares = Arc::new(Shares::new(subscribers));
    let stars = scene.stars.stars.len() as u64;
    let capacity = Capacity { requests: pending_renders, subscribers };
    let (handle, thread) =
        render_thread::spawn(engine, (scene, seen_stars), (objects, clock, views), settings, capacity, time)?;
    let (cluster, mut cluster_thread) = match cluster {
        Some(options) => {
            let (cluster, thread) = Cluster::spawn(options, &handle).inspect_err(|_| handle.stop())?;
            (Some(cluster), Some(thread))
        }
        None => (None, None),
    };
    let displays = Displays::new(headset, windows, &handle);
    let keeps_state = file.is_some();
    let (headset, windows) = displays.shared();
    let service = Service::new(
        handle.clone(),
        OptionalParts { headset, windows, cluster: cluster.clone() },
        (info, limits),
        (catalogues, stars),
        capacity,
        (background_jobs, Arc::clone(&shares), file),
    );
    let keeper = keeps_state.then(|| tokio::spawn(service.clone().keep_camera()));
    let (headset, windows) = displays.spawn(&service).inspect_err(|_| handle.stop())?;
    let mut threads = Threads { handle: handle.clone(), render: thread, headset, windows, render_ended: false };

    let (close, closed) = oneshot::channel::<()>();
    let incoming = Incoming::new(listener, current_access.clone(), shares);
    let refusal = cluster.as_ref().and_then(|cluster| cluster.refusal.clone());
    let front = Front { hosts, access: current_access, refusal, incoming, closed };
    let serving = server::serve(service, health_service, front).inspect_err(|_| handle.stop())?;
    tokio::pin!(serving);
    if let Some(end) = early {
        end.await;
    }
    tracing::info!("serving on {address}");
    ready(address.clone());

    // Wait for the request to end, or for the failure of a vital part.
    let mut outcome = tokio::select! {
        () = &mut shutdown => Ok(()),
        () = threads.render_end() => Ok(()),
        problem = ended(&mut cluster_thread) => Err(ServeError::Cluster(problem)),
        result = &mut serving => {
            threads.drain();
            handle.stop();
            threads.join(Instant::now() + drain).await?;
            return result.map_err(ServeError::from);
        }
    };

    let deadline = Instant::now() + drain;
    if let Some(cluster) = &cluster {
        cluster.stop();
    }
    report_health(&health, ServingStatus::NotServing).await;
    threads.drain();
    drop(close);
    end_health(&mut health).await;
    match timeout_at(deadline, &mut serving).await {
        Ok(result) => outcome = outcome.and(result.map_err(ServeError::from)),
        Err(_) => tracing::warn!("cut off clients that did not finish within {} s", drain.as_secs_f64()),
    }
    handle.stop();
    if let Some(keeper) = keeper {
        wait_for_camera(keeper, deadline).await;
    }
    access_keeper.abort();
    address.remove_socket();
    if let Some(thread) = cluster_thread {
        // A network that does not end in time is abandoned.
        thread.result(deadline.max(Instant::now() + FAREWELL)).await;
    }
    threads.join(deadline).await?;
    outcome
}

/// Resolves with the reason when the cluster's thread has ended by itself. Never resolves without such a thread.
async fn ended(thread: &mut Option<ClusterThread>) -> String {
    if let Some(running) = thread.as_mut() {
        // Nothing is sent.
        let _ = (&mut running.ended).await;
    }
    match thread.take() {
        None => std::future::pending().await,
        Some(ended) => match ended.join.join() {
            Ok(Ok(())) => "it ended".to_owned(),
            Ok(Err(problem)) => problem,
            Err(payload) => panic_message(payload.as_ref()),
        },
    }
}
