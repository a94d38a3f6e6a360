//! The daemon's life: it binds, serves, and drains on a signal. Draining turns health to NOT_SERVING, accepts no new
//! connection, ends streams, finishes calls in flight, and ends the render thread. Work that exceeds the drain time is
//! abandoned. The rules for listening are in [`listen`].

mod listen;
mod options;

use std::{io, sync::Arc, time::Duration};

use tokio::{
    signal,
    sync::{oneshot, watch},
    time::{Instant, timeout_at},
};
use tonic::{server::NamedService, transport::Server};
use tonic_health::{ServingStatus, server::HealthReporter};
use tonic_web::GrpcWebLayer;

use self::listen::{bind, keep_access};
pub use self::{
    listen::check_listen,
    options::{Address, LimitOptions, NetworkOptions, Reloads, SceneOptions, ServeOptions, Shutdown, ViewOptions},
};
use crate::{
    config::ViewSpec,
    plan::settings::RenderSettings,
    scene::{SceneClock, SceneSnapshot, SeenStars},
    service::{
        displays::{
            headset::{Headset, HeadsetOptions, HeadsetThread},
            windows::{Windows, WindowsOptions, WindowsThread},
        },
        engine::{
            background_jobs::BackgroundJobs,
            interface::EngineError,
            render_handle::Capacity,
            render_thread::{self, RenderThread},
        },
        handlers::{metrics::Metrics, service::Service},
        network::{
            access::{Access, Gate},
            clients::Shares,
            connections::{Bounds, Incoming},
            http_handler::HandleFirst,
            page::Page,
        },
        proto::{
            self, camera_service_server::CameraServiceServer, diagnostics_service_server::DiagnosticsServiceServer,
            scene_service_server::SceneServiceServer, view_service_server::ViewServiceServer,
        },
        scene::{objects::Objects, state::SceneState, views::ViewSet},
        state_file::{StateError, StateFile},
        threads::panic_message,
        wire::camera::camera_from_pb,
    },
    view::{RigError, check_name},
};

/// A client that has been silent for this long is pinged.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
/// A client that does not answer a ping within this time is disconnected.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Concurrent calls of one connection; further calls wait.
const CALLS: u32 = 128;
/// Maximum bytes of the headers of a call.
const HEADER_BYTES: u32 = 16 << 10;
/// Maximum bytes of a message, except for changes of the scene.
const SMALL_REQUEST_BYTES: usize = 64 << 10;
/// Minimum time for an idle thread to end, even if clients used up the drain time.
const FAREWELL: Duration = Duration::from_millis(500);

/// Services whose health is reported, besides the overall health (the empty name).
const SERVICES: [&str; 4] = [
    <SceneServiceServer<Service> as NamedService>::NAME,
    <CameraServiceServer<Service> as NamedService>::NAME,
    <ViewServiceServer<Service> as NamedService>::NAME,
    <DiagnosticsServiceServer<Service> as NamedService>::NAME,
];

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
    #[error("{address} is in use by another process: stop it, or listen on another port (port 0 takes a free one)")]
    AddressInUse {
        /// The address.
        address: Address,
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
    /// The renderer panicked.
    #[error("the render thread panicked: {message}")]
    Panicked {
        /// Message of the panic.
        message: String,
    },
}

/// Returns a future that resolves on SIGINT or SIGTERM; the handlers are installed when this function returns. Needs a
/// tokio runtime with I/O.
///
/// # Errors
///
/// The system refuses the handlers.
pub fn signals() -> io::Result<impl Future<Output = ()> + Send> {
    use signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => tracing::info!("SIGINT: ending"),
            _ = terminate.recv() => tracing::info!("SIGTERM: ending"),
        }
    })
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

/// Waits until `deadline`, and at least [`FAREWELL`], for the render thread, which was told to stop. A busy thread is
/// abandoned: it holds nothing that outlives the process.
async fn join(mut thread: RenderThread, ended: bool, deadline: Instant) -> Result<(), ServeError> {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    // The receiver must not be polled again after it has resolved.
    if !ended && timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the render thread is still busy with a frame: ending without it");
        return Ok(());
    }
    match thread.join.join() {
        Ok(end) => end.map_err(ServeError::Lost),
        Err(payload) => Err(ServeError::Panicked { message: panic_message(payload.as_ref()) }),
    }
}

/// Waits for the headset's thread in the same way. Its result is known already.
async fn join_headset(mut thread: HeadsetThread, deadline: Instant) {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    if timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the headset's thread is still busy: ending without it");
    } else if thread.join.join().is_err() {
        tracing::warn!("the headset's thread did not end in order");
    }
}

/// Waits for the thread of the windows in the same way.
async fn join_windows(mut thread: WindowsThread, deadline: Instant) {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    if timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the thread of the windows is still busy: ending without it");
    } else if thread.join.join().is_err() {
        tracing::warn!("the thread of the windows did not end in order");
    }
}

/// Initial state of a daemon.
struct Begun {
    scene: SceneSnapshot,
    objects: Objects,
    clock: SceneClock,
    views: ViewSet,
    settings: RenderSettings,
}

/// Returns the initial state with the saved values of a state file.
fn restored(file: &StateFile, begun: Begun) -> Result<Begun, StateError> {
    let Begun { mut scene, mut objects, mut clock, mut views, mut settings } = begun;
    let (saved, camera) = file.current_state()?;
    if let Some(saved) = saved {
        let configured = SceneState {
            revision: scene.revision,
            stars: settings.stars.clone(),
            asteroids: settings.asteroids.clone(),
            objects,
            clock,
            views: Arc::new(views),
            jumps: 0,
        };
        let restored = saved.applied(&configured, &settings).map_err(|problem| file.content(problem))?;
        let revision = saved.scene.as_ref().map_or(restored.revision, |scene| scene.revision);
        tracing::info!("restored revision {revision} of the scene");
        let of_clients = restored.views.kept().filter(|view| view.geometry.has_keys()).map(|view| view.name);
        let of_clients: Vec<String> = of_clients.collect();
        if !of_clients.is_empty() {
            tracing::info!("restored views that clients have defined: {}", of_clients.join(", "));
        }
        let deleted: Vec<&str> = restored.views.deleted().collect();
        if !deleted.is_empty() {
            tracing::info!("views of the configuration that clients have deleted: {}", deleted.join(", "));
        }
        let kept = |name: &str| restored.objects.drawn.bodies.iter().any(|body| body.name == name);
        let bodies = scene.objects.bodies.iter().map(|body| body.name.as_str());
        let gone: Vec<&str> = bodies.filter(|name| !kept(name)).collect();
        if !gone.is_empty() {
            tracing::info!("bodies of the configuration that the state file lacks: {}", gone.join(", "));
        }
        let (before, after) = (scene.objects.observer, restored.objects.drawn.observer);
        if before.map(|observer| observer.place) != after.map(|observer| observer.place) {
            tracing::info!("the place of the observer comes from the state file, not from the configuration");
        }
        let camera = scene.camera.on_horizon_of(before.as_ref(), after.as_ref());
        scene = SceneSnapshot { revision, objects: Arc::clone(&restored.objects.drawn), camera, ..scene };
        clock = saved.clock(restored.clock);
        (settings.stars, settings.asteroids) = (restored.stars, restored.asteroids);
        (objects, views) = (restored.objects, Arc::unwrap_or_clone(restored.views));
    }
    if let Some(camera) = camera {
        scene.camera = camera_from_pb(camera).map_err(|error| file.content(format!("the camera: {error}")))?;
    }
    Ok(Begun { scene, objects, clock, views, settings })
}

/// Serves until told to end. Needs a tokio runtime with I/O and time. Encoders and a frame that exceed the drain time
/// may still run when it returns: to exit then, do not wait for the runtime's threads.
///
/// # Errors
///
/// See [`ServeError`]. An orderly end returns none, even if clients had to be cut off.
pub async fn run(options: ServeOptions) -> Result<(), ServeError> {
    let ServeOptions { engine, network, limits, scene, views, headset, windows, state, ready, reloads, shutdown } =
        options;
    let NetworkOptions { listen, hosts, access } = network;
    let LimitOptions { drain, pending_renders, subscribers } = limits;
    let SceneOptions { snapshot: scene, clock, catalogues, asteroid_fields, observer, star_sources } = scene;
    let ViewOptions { rig, settings, specs, folder } = views;
    let objects = Objects::new(Arc::clone(&scene.objects), &asteroid_fields, observer).map_err(ServeError::Objects)?;
    if let Some(HeadsetOptions { name, .. }) = &headset {
        check_name(name).map_err(ServeError::Headset)?;
    }
    let specified = rig.views().iter().enumerate().map(|(index, view)| {
        let spec = specs.get(index).cloned();
        (spec.unwrap_or_else(|| ViewSpec::custom(&view.name)), view.clone())
    });
    let views = ViewSet::new(&settings, specified.collect(), &folder).map_err(ServeError::Views)?;
    let file = state.map(|path| StateFile::open(&path)).transpose()?;
    let clock = clock.unwrap_or_else(|| SceneClock::stopped(scene.objects.time_s));
    // The state file may have another place of the observer.
    let seen_stars = SeenStars::new(Arc::clone(&scene.stars), scene.objects.observer.as_ref(), star_sources);
    let begun = Begun { scene, objects, clock, views, settings };
    let Begun { scene, objects, clock, views, settings } = match &file {
        Some(file) => restored(file, begun)?,
        None => begun,
    };
    if let Some(HeadsetOptions { name, .. }) = headset.as_ref().filter(|headset| views.named(&headset.name).is_some()) {
        return Err(ServeError::Headset(RigError::Duplicate { name: name.clone() }));
    }
    let first = access.as_ref().map_or_else(|| Ok(Access::default()), |source| source()).map_err(ServeError::Access)?;
    let (listener, address) = bind(&listen, &first).await?;
    let (new_access, current_access) = watch::channel(Arc::new(first));
    let hangups = signal::unix::signal(signal::unix::SignalKind::hangup())?;
    let access_keeper = tokio::spawn(keep_access(reloads, hangups, access, new_access));
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

    let (info, limits) = (engine.info(), engine.limits());
    let background_jobs = BackgroundJobs::spawn(engine.beside())?;
    let shares: Arc<Shares> = Arc::default();
    let stars = scene.stars.stars.len() as u64;
    let capacity = Capacity { requests: pending_renders, subscribers };
    let (handle, mut thread) =
        render_thread::spawn(engine, (scene, seen_stars), (objects, clock, views), settings, capacity)?;
    let (headset, drive) =
        headset.map(|options| (Arc::new(Headset::new(options.name, handle.clone())), options.drive)).unzip();
    let (windows, window_work) = windows
        .map(|WindowsOptions { windows, open }| {
            let (known, pressed) = Windows::new(windows.clone(), handle.clone());
            (Arc::new(known), (open, windows, pressed))
        })
        .unzip();
    let keeps_state = file.is_some();
    let service = Service::new(
        handle.clone(),
        (headset.clone(), windows.clone()),
        (info, limits),
        (catalogues, stars),
        capacity,
        (background_jobs, Arc::clone(&shares), file),
    );
    let keeper = keeps_state.then(|| tokio::spawn(service.clone().keep_camera()));
    let headset_thread = match headset.as_ref().zip(drive) {
        Some((headset, drive)) => Some(headset.spawn(drive).inspect_err(|_| handle.stop())?),
        None => None,
    };
    let windows_thread = match windows.as_ref().zip(window_work) {
        Some((known, (open, of_windows, pressed))) => {
            // The task ends with the windows.
            tokio::spawn(service.clone().keep_test_patterns(of_windows, pressed));
            Some(known.spawn(open).inspect_err(|_| handle.stop())?)
        }
        None => None,
    };
    let drain_all = || {
        handle.drain();
        if let Some(windows) = &windows {
            windows.drain();
        }
        if let Some(headset) = &headset {
            headset.drain();
        }
    };

    let (close, closed) = oneshot::channel::<()>();
    let incoming = Incoming::new(listener, current_access.clone(), shares);
    let serving = Server::builder()
        .accept_http1(true)
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT))
        .max_concurrent_streams(CALLS)
        .http2_max_header_list_size(HEADER_BYTES)
        .layer(Bounds::new(hosts))
        .layer(Gate::new(current_access))
        .layer(HandleFirst(Metrics { service: service.clone() }))
        .layer(HandleFirst(Page::new()))
        .layer(GrpcWebLayer::new())
        .add_service(SceneServiceServer::new(service.clone()))
        .add_service(CameraServiceServer::new(service.clone()).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(ViewServiceServer::new(service.clone()).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(DiagnosticsServiceServer::new(service).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(health_service)
        .add_service(reflection_v1)
        .add_service(reflection_v1alpha)
        .serve_with_incoming_shutdown(incoming, async move {
            // A dropped sender has the same meaning.
            let _ = closed.await;
        });
    tokio::pin!(serving);
    tracing::info!("serving on {address}");
    ready(address.clone());

    // Wait until told to end, or until a vital part fails.
    let mut render_ended = false;
    let mut outcome = tokio::select! {
        () = &mut shutdown => Ok(()),
        _ = &mut thread.ended => {
            render_ended = true;
            Ok(())
        }
        result = &mut serving => {
            let deadline = Instant::now() + drain;
            drain_all();
            handle.stop();
            if let Some(thread) = headset_thread {
                join_headset(thread, deadline).await;
            }
            if let Some(thread) = windows_thread {
                join_windows(thread, deadline).await;
            }
            join(thread, false, deadline).await?;
            return result.map_err(ServeError::from);
        }
    };

    let deadline = Instant::now() + drain;
    report_health(&health, ServingStatus::NotServing).await;
    drain_all();
    drop(close);
    end_health(&mut health).await;
    match timeout_at(deadline, &mut serving).await {
        Ok(result) => outcome = result.map_err(ServeError::from),
        Err(_) => tracing::warn!("cut off clients that did not finish within {} s", drain.as_secs_f64()),
    }
    handle.stop();
    if let Some(keeper) = keeper
        && !matches!(timeout_at(deadline.max(Instant::now() + FAREWELL), keeper).await, Ok(Ok(())))
    {
        tracing::warn!("the last camera may not be saved");
    }
    if let Some(thread) = headset_thread {
        join_headset(thread, deadline).await;
    }
    if let Some(thread) = windows_thread {
        join_windows(thread, deadline).await;
    }
    access_keeper.abort();
    if let Address::Unix(path) = &address
        && let Err(error) = std::fs::remove_file(path)
    {
        tracing::warn!("cannot remove {address}: {error}");
    }
    join(thread, render_ended, deadline).await?;
    outcome
}
