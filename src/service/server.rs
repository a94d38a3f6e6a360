//! The daemon: binds, serves, and on a signal drains: health turns to NOT_SERVING, no new connection is accepted, streams end
//! cleanly, calls in flight finish, the render thread ends. What is not done within the drain time is left behind. Where it may listen is judged in
//! [`binding`].

mod binding;

use std::{fmt, io, net::SocketAddr, path::PathBuf, pin::Pin, sync::Arc, time::Duration};

use tokio::{
    signal,
    sync::{mpsc, oneshot, watch},
    time::{Instant, timeout_at},
};
use toml::Table;
use tonic::{server::NamedService, transport::Server};
use tonic_health::{ServingStatus, server::HealthReporter};
use tonic_web::GrpcWebLayer;

pub use self::binding::check_listen;
use self::binding::{bind, keep_access};
use super::{
    access::{Access, AccessSource, Gate},
    answers::AnswersFirst,
    client::camera_from_pb,
    clients::Shares,
    connections::{Bounds, Incoming},
    engine::{Engine, EngineError},
    handlers::Service,
    headset::{Headset, HeadsetOptions, HeadsetThread, panic_message},
    metrics::Metrics,
    objects::Objects,
    page::Page,
    proto::{
        self, camera_service_server::CameraServiceServer, diagnostics_service_server::DiagnosticsServiceServer,
        scene_service_server::SceneServiceServer, view_service_server::ViewServiceServer,
    },
    render::Capacity,
    scene::SceneState,
    state::{StateError, StateFile},
    views::{GivenView, ViewSet},
    windows::{Windows, WindowsOptions, WindowsThread},
    worker::{self, RenderThread},
    workshop::Workshop,
};
use crate::{
    config::{ObserverConfig, UNIX_PREFIX, ViewTables},
    plan::settings::RenderSettings,
    scene::{SceneClock, SceneSnapshot, SeenStars, asteroids::FieldSpec, loader::StarSource},
    view::{Rig, RigError, check_name},
};

/// A client that has not answered for this long is asked whether it is still there.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(20);
/// A client that does not answer that is taken for gone.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Calls of one connection at the same time; more wait.
const CALLS: u32 = 128;
/// Bytes of the headers of a call.
const HEADER_BYTES: u32 = 16 << 10;
/// Bytes of a message, but for changes of the scene.
const SMALL_REQUEST_BYTES: usize = 64 << 10;
/// How long calls and clients may take to finish once the daemon is told to end.
const DRAIN: Duration = Duration::from_secs(5);
/// Calls of `RenderFrame` at the same time, from the queue to the last encoded byte; more are refused.
const PENDING_RENDERS: usize = 16;
/// Streams at the same time; more are refused. Each holds a frame, and every frame looks at all of them.
const SUBSCRIBERS: usize = 256;
/// What an idle render thread gets to end in, even if clients took all of the drain time.
const FAREWELL: Duration = Duration::from_millis(500);

/// Names of the services whose health is reported, besides that of the whole (the empty name).
const SERVICES: [&str; 4] = [
    <SceneServiceServer<Service> as NamedService>::NAME,
    <CameraServiceServer<Service> as NamedService>::NAME,
    <ViewServiceServer<Service> as NamedService>::NAME,
    <DiagnosticsServiceServer<Service> as NamedService>::NAME,
];

/// What tells the daemon to end.
pub enum Shutdown {
    /// SIGINT or SIGTERM.
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

/// What tells the daemon to read [`ServeOptions::access`] again.
#[derive(Debug)]
pub enum Reloads {
    /// SIGHUP.
    Signals,
    /// Messages.
    When(mpsc::Receiver<()>),
}

impl Reloads {
    /// Waits for the next; `None`: there will be none.
    async fn next(&mut self, hangups: &mut signal::unix::Signal) -> Option<()> {
        match self {
            Self::Signals => hangups.recv().await,
            Self::When(messages) => messages.recv().await,
        }
    }
}

/// Where the daemon listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A port.
    Tcp(SocketAddr),
    /// A socket of this machine.
    Unix(PathBuf),
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Unix(path) => write!(f, "{UNIX_PREFIX}{}", path.display()),
        }
    }
}

/// A catalogue of the scene, as clients are told of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneCatalogue {
    /// Its name.
    pub name: String,
    /// Number of its stars.
    pub stars: u64,
}

/// Everything that [`run`] needs.
pub struct ServeOptions {
    /// Address to listen on: `host:port`, port 0 takes a free one, or `unix:PATH`.
    pub listen: String,
    /// The renderer.
    pub engine: Box<dyn Engine>,
    /// The scene; its camera is the first pose.
    pub scene: SceneSnapshot,
    /// The scene's time where it runs; `None`: it stays that of its objects.
    pub clock: Option<SceneClock>,
    /// Where the scene's stars come from.
    pub catalogues: Vec<SceneCatalogue>,
    /// What the scene's asteroid fields were made from, one for each in their order.
    pub asteroid_fields: Vec<Arc<FieldSpec>>,
    /// What the scene's observer was made from; `None`: it has none.
    pub observer: Option<ObserverConfig>,
    /// From where its stars are loaded for times that are years away; empty: they have no motion of their own.
    pub star_sources: Vec<StarSource>,
    /// The views.
    pub rig: Rig,
    /// How they are drawn.
    pub settings: RenderSettings,
    /// What views have of their own, in the order of the rig; views beyond its end have nothing.
    pub view_tables: Vec<ViewTables>,
    /// The keys of the geometry of views ([`ViewConfig::definition`](crate::config::ViewConfig::definition)), in the order of the rig. Views beyond its end
    /// and those without keys, such as projectors, are made of something else: clients are not told of what, and change their geometry as a whole alone.
    pub view_definitions: Vec<Option<Table>>,
    /// The folder at which relative paths in these start.
    pub folder: PathBuf,
    /// A headset, as one more view.
    pub headset: Option<HeadsetOptions>,
    /// Windows on monitors of this machine.
    pub windows: Option<WindowsOptions>,
    /// File in which acknowledged changes are kept; `None`: they are lost at the end.
    pub state: Option<PathBuf>,
    /// Names by which clients may call the daemon, without ports, besides `localhost` and addresses.
    pub hosts: Vec<String>,
    /// Who may call; `None`: everybody, on the loopback address or a Unix socket.
    pub access: Option<AccessSource>,
    /// What tells the daemon to read it again.
    pub reloads: Reloads,
    /// Called once with the address when clients can connect.
    pub ready: Box<dyn FnOnce(Address) + Send>,
    /// What tells the daemon to end.
    pub shutdown: Shutdown,
    /// How long calls, clients and the renderer may take to finish then; afterwards they are cut off.
    pub drain: Duration,
    /// Calls of `RenderFrame` at the same time; more get RESOURCE_EXHAUSTED.
    pub pending_renders: usize,
    /// Streams at the same time; more get RESOURCE_EXHAUSTED.
    pub subscribers: usize,
}

impl ServeOptions {
    /// Options without a headset and windows, that end on signals, after a drain of at most 5 s, with up to 16 pending calls of `RenderFrame`
    /// and 256 streams.
    pub fn new(
        listen: impl Into<String>,
        engine: Box<dyn Engine>,
        scene: SceneSnapshot,
        rig: Rig,
        settings: RenderSettings,
        ready: impl FnOnce(Address) + Send + 'static,
    ) -> Self {
        Self {
            listen: listen.into(),
            engine,
            clock: None,
            scene,
            catalogues: Vec::new(),
            asteroid_fields: Vec::new(),
            observer: None,
            star_sources: Vec::new(),
            rig,
            settings,
            view_tables: Vec::new(),
            view_definitions: Vec::new(),
            folder: PathBuf::new(),
            headset: None,
            windows: None,
            hosts: Vec::new(),
            access: None,
            reloads: Reloads::Signals,
            state: None,
            ready: Box::new(ready),
            shutdown: Shutdown::Signals,
            drain: DRAIN,
            pending_renders: PENDING_RENDERS,
            subscribers: SUBSCRIBERS,
        }
    }
}

/// Why the daemon could not start, or ended other than it was told to.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address is none.
    #[error(
        "listen = `{listen}`: {problem}; needed is host:port, for example 127.0.0.1:7143, port 0 for a free one, or unix:PATH"
    )]
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
        address: Address,
    },
    /// Who may call, or how connections are encrypted, cannot be read.
    #[error("{0}")]
    Access(String),
    /// Everybody could listen in, or steer.
    #[error("listen = `{listen}`: {problem}")]
    Open {
        /// What was given.
        listen: String,
        /// What is missing.
        problem: String,
    },
    /// The system refuses the address.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// The address.
        address: Address,
        /// What the system says.
        source: io::Error,
    },
    /// What was told of the observer or the asteroid fields is not of those of the scene.
    #[error("the scene's objects: {0}")]
    Objects(String),
    /// What views have of their own is not allowed.
    #[error("{0}")]
    Views(String),
    /// The file of states is of no use.
    #[error(transparent)]
    State(#[from] StateError),
    /// The headset's name is none, or a view's.
    #[error("headset: {0}")]
    Headset(RigError),
    /// Signals cannot be received or a thread cannot be started.
    #[error("cannot set up the daemon: {0}")]
    System(#[from] io::Error),
    /// The protocol's descriptors are broken.
    #[error("server reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The server failed.
    #[error("the server failed: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The renderer is of no use any more, as when its device is lost: whoever started the daemon may start it anew.
    #[error("the renderer was lost: {0}")]
    Lost(EngineError),
    /// The renderer panicked.
    #[error("the render thread panicked: {message}")]
    Panicked {
        /// Its message.
        message: String,
    },
}

/// A future that ends when the process is told to by SIGINT or SIGTERM; the handlers are in place when this function returns.
/// Needs a tokio runtime with I/O.
///
/// # Errors
///
/// The system does not take the handlers.
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

/// Lets every `Watch` call end, which would keep its connection open otherwise.
async fn end_health(health: &mut HealthReporter) {
    health.clear_service_status("").await;
    for service in SERVICES {
        health.clear_service_status(service).await;
    }
}

/// Waits until `deadline`, and a moment at least, for the render thread, which was told to end. One that is still busy then
/// is left behind: it holds nothing that outlives the process.
async fn join(mut thread: RenderThread, ended: bool, deadline: Instant) -> Result<(), ServeError> {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    // The receiver must not be asked again once it has answered.
    if !ended && timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the render thread is still busy with a frame: ending without it");
        return Ok(());
    }
    match thread.join.join() {
        Ok(end) => end.map_err(ServeError::Lost),
        Err(payload) => Err(ServeError::Panicked { message: panic_message(payload.as_ref()) }),
    }
}

/// The same for the headset's thread. How it has ended is known already.
async fn join_headset(mut thread: HeadsetThread, deadline: Instant) {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    if timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the headset's thread is still busy: ending without it");
    } else if thread.join.join().is_err() {
        tracing::warn!("the headset's thread did not end in order");
    }
}

/// The same for the thread of the windows.
async fn join_windows(mut thread: WindowsThread, deadline: Instant) {
    let deadline = deadline.max(Instant::now() + FAREWELL);
    if timeout_at(deadline, &mut thread.ended).await.is_err() {
        tracing::warn!("the thread of the windows is still busy: ending without it");
    } else if thread.join.join().is_err() {
        tracing::warn!("the thread of the windows did not end in order");
    }
}

/// What a daemon begins with.
struct Begun {
    scene: SceneSnapshot,
    objects: Objects,
    clock: SceneClock,
    views: ViewSet,
    settings: RenderSettings,
}

/// The same with what a file of states has kept.
fn restored(file: &StateFile, begun: Begun) -> Result<Begun, StateError> {
    let Begun { mut scene, mut objects, mut clock, mut views, mut settings } = begun;
    let (saved, camera) = file.shown()?;
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
        tracing::info!("goes on with revision {revision} of the scene");
        let of_clients = restored.views.kept().filter(|view| view.definition.is_some()).map(|view| view.name);
        let of_clients: Vec<String> = of_clients.collect();
        if !of_clients.is_empty() {
            tracing::info!("views as clients have defined them: {}", of_clients.join(", "));
        }
        let deleted: Vec<&str> = restored.views.deleted().collect();
        if !deleted.is_empty() {
            tracing::info!("views of the configuration that clients have deleted: {}", deleted.join(", "));
        }
        let kept = |name: &str| restored.objects.drawn.bodies.iter().any(|body| body.name == name);
        let bodies = scene.objects.bodies.iter().map(|body| body.name.as_str());
        let gone: Vec<&str> = bodies.filter(|name| !kept(name)).collect();
        if !gone.is_empty() {
            tracing::info!("bodies of the configuration that the file of states does not have: {}", gone.join(", "));
        }
        let (before, after) = (scene.objects.observer, restored.objects.drawn.observer);
        if before.map(|observer| observer.place) != after.map(|observer| observer.place) {
            tracing::info!("the observer stands where the file of states has it, not where the configuration does");
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

/// Serves until told to end. Needs a tokio runtime with I/O and time. Encoders and a frame that were not finished within the
/// drain time may still run when it returns: a caller who wants to end then must not wait for the runtime's threads.
///
/// # Errors
///
/// See [`ServeError`]; after an orderly end, even if clients had to be cut off, there is none.
pub async fn run(options: ServeOptions) -> Result<(), ServeError> {
    let ServeOptions {
        listen,
        engine,
        scene,
        clock,
        catalogues,
        asteroid_fields,
        observer,
        star_sources,
        rig,
        settings,
        view_tables,
        view_definitions,
        folder,
        headset,
        windows,
        hosts,
        access,
        reloads,
        state,
        ready,
        shutdown,
        drain,
        pending_renders,
        subscribers,
    } = options;
    let objects = Objects::new(Arc::clone(&scene.objects), &asteroid_fields, observer).map_err(ServeError::Objects)?;
    if let Some(HeadsetOptions { name, .. }) = &headset {
        check_name(name).map_err(ServeError::Headset)?;
    }
    let given = rig.views().iter().enumerate().map(|(index, view)| GivenView {
        view: view.clone(),
        definition: view_definitions.get(index).cloned().flatten(),
        tables: view_tables.get(index).cloned().unwrap_or_default(),
    });
    let views = ViewSet::new(&settings, given.collect(), &folder).map_err(ServeError::Views)?;
    let file = state.map(|path| StateFile::open(&path)).transpose()?;
    let clock = clock.unwrap_or_else(|| SceneClock::stopped(scene.objects.time_s));
    // A file of states may have the observer elsewhere.
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
    let workshop = Workshop::spawn(engine.beside())?;
    let shares: Arc<Shares> = Arc::default();
    let stars = scene.stars.stars.len() as u64;
    let capacity = Capacity { requests: pending_renders, subscribers };
    let (handle, mut thread) = worker::spawn(engine, (scene, seen_stars), (objects, clock, views), settings, capacity)?;
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
        (workshop, Arc::clone(&shares), file),
    );
    let keeper = keeps_state.then(|| tokio::spawn(service.clone().keep_camera()));
    let headset_thread = match headset.as_ref().zip(drive) {
        Some((headset, drive)) => Some(headset.spawn(drive).inspect_err(|_| handle.stop())?),
        None => None,
    };
    let windows_thread = match windows.as_ref().zip(window_work) {
        Some((known, (open, of_windows, pressed))) => {
            // It ends when the windows do.
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
        .layer(AnswersFirst(Metrics { service: service.clone() }))
        .layer(AnswersFirst(Page::new()))
        .layer(GrpcWebLayer::new())
        .add_service(SceneServiceServer::new(service.clone()))
        .add_service(CameraServiceServer::new(service.clone()).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(ViewServiceServer::new(service.clone()).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(DiagnosticsServiceServer::new(service).max_decoding_message_size(SMALL_REQUEST_BYTES))
        .add_service(health_service)
        .add_service(reflection_v1)
        .add_service(reflection_v1alpha)
        .serve_with_incoming_shutdown(incoming, async move {
            // A sender that is gone means the same as one that speaks.
            let _ = closed.await;
        });
    tokio::pin!(serving);
    tracing::info!("serving on {address}");
    ready(address.clone());

    // Until told to end, or until something breaks that the daemon cannot do without.
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
        tracing::warn!("{address} stays behind: {error}");
    }
    join(thread, render_ended, deadline).await?;
    outcome
}
