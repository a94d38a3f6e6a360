//! Options of the daemon, grouped by the component that uses them.

use std::{fmt, net::SocketAddr, path::PathBuf, pin::Pin, sync::Arc, time::Duration};

use tokio::sync::mpsc;

use super::EarlyServer;
use crate::{
    config::{ObserverConfig, UNIX_PREFIX, ViewSpec},
    plan::settings::RenderSettings,
    platform::signals::ReloadSignal,
    scene::{SceneClock, SceneSnapshot, asteroids::FieldSpec, loader::StarSource},
    service::{
        cluster::ClusterOptions,
        displays::{headset::HeadsetOptions, windows::WindowsOptions},
        engine::interface::Engine,
        network::access::AccessSource,
        scene::state::SceneCatalogue,
        time_source::TimeSource,
    },
    view::Rig,
};

/// Maximum time that calls and clients have to finish after the daemon is asked to end.
const DRAIN: Duration = Duration::from_secs(5);
/// Maximum number of concurrent `RenderFrame` calls, from the queue to the last encoded byte; further calls are refused.
const PENDING_RENDERS: usize = 16;
/// Maximum number of concurrent streams; further streams are refused. Each holds a frame, and the render thread checks all of them for every frame.
const SUBSCRIBERS: usize = 256;

/// Signal that ends the daemon.
pub enum Shutdown {
    /// SIGINT or SIGTERM; on Windows Ctrl-C, Ctrl-Break, and the end of the console or session.
    Signals,
    /// Completion of a future.
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

/// Signal that reloads [`NetworkOptions::access`].
#[derive(Debug)]
pub enum Reloads {
    /// SIGHUP; on Windows there is no such signal.
    Signals,
    /// Messages.
    When(mpsc::Receiver<()>),
}

impl Reloads {
    /// Waits for the next signal; `None` if there will be none.
    pub(super) async fn next(&mut self, hangups: &mut ReloadSignal) -> Option<()> {
        match self {
            Self::Signals => hangups.next().await,
            Self::When(messages) => messages.recv().await,
        }
    }
}

/// Address that the daemon listens on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A TCP port.
    Tcp(SocketAddr),
    /// A Unix socket.
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

/// Options of the network: the address, and the clients that may use it.
#[derive(Clone)]
pub struct NetworkOptions {
    /// Address to listen on: `host:port` (port 0 takes a free one) or `unix:PATH`.
    pub listen: String,
    /// Host names, without ports, that clients may use in requests in addition to `localhost` and addresses.
    pub hosts: Vec<String>,
    /// Source of the access rules. `None`: every client has access, but only on the loopback address or a Unix socket.
    pub access: Option<AccessSource>,
}

/// Limits of the load that the daemon accepts, and of the time that it takes to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitOptions {
    /// Maximum time that calls, clients and the renderer have to finish after the daemon is asked to end. The rest is cut off.
    pub drain: Duration,
    /// Maximum number of concurrent `RenderFrame` calls; further calls get RESOURCE_EXHAUSTED.
    pub pending_renders: usize,
    /// Maximum number of concurrent streams; further streams get RESOURCE_EXHAUSTED.
    pub subscribers: usize,
}

impl Default for LimitOptions {
    fn default() -> Self {
        Self { drain: DRAIN, pending_renders: PENDING_RENDERS, subscribers: SUBSCRIBERS }
    }
}

/// The scene at the start, and the definitions that it was made from.
pub struct SceneOptions {
    /// The scene; its camera is the first pose.
    pub snapshot: SceneSnapshot,
    /// Clock of the scene's time. `None`: the time does not run, and stays that of the snapshot's objects.
    pub clock: Option<SceneClock>,
    /// The daemon's time.
    pub time: TimeSource,
    /// Catalogues of the scene's stars.
    pub catalogues: Vec<SceneCatalogue>,
    /// Definitions of the scene's asteroid fields, in their order.
    pub asteroid_fields: Vec<Arc<FieldSpec>>,
    /// Definition of the scene's observer, if it has one.
    pub observer: Option<ObserverConfig>,
    /// Sources from which the stars are computed for times that are years away. If it is empty, the stars have no proper motion.
    pub star_sources: Vec<StarSource>,
}

/// The views at the start, and the settings of their frames.
pub struct ViewOptions {
    /// The views.
    pub rig: Rig,
    /// General settings of frames.
    pub settings: RenderSettings,
    /// Specifications of the views, in the order of the rig. Views beyond the end of the list have the general settings and a
    /// geometry without keys: clients can only replace them as a whole.
    pub specs: Vec<ViewSpec>,
    /// Folder that relative paths in these specifications start from.
    pub folder: PathBuf,
}

/// Options of [`run`](super::run).
pub struct ServeOptions {
    /// The renderer.
    pub engine: Box<dyn Engine>,
    /// Network and access.
    pub network: NetworkOptions,
    /// The server that has listened there since the start; `None`: the daemon binds the address.
    pub early: Option<EarlyServer>,
    /// Limits of load and time.
    pub limits: LimitOptions,
    /// The scene.
    pub scene: SceneOptions,
    /// The views.
    pub views: ViewOptions,
    /// A headset, as an additional view.
    pub headset: Option<HeadsetOptions>,
    /// Windows on monitors of this machine.
    pub windows: Option<WindowsOptions>,
    /// The daemon's part in a cluster; `None`: the daemon is not in a cluster.
    pub cluster: Option<ClusterOptions>,
    /// File in which acknowledged changes are kept; `None`: they are lost when the daemon ends.
    pub state: Option<PathBuf>,
    /// Called once with the address when clients can connect.
    pub ready: Box<dyn FnOnce(Address) + Send>,
    /// Signal on which the daemon reads the access rules again.
    pub reloads: Reloads,
    /// Signal to end.
    pub shutdown: Shutdown,
}

impl ServeOptions {
    /// Options without headset, windows and state file, with the default limits: the daemon ends on signals, after a drain of
    /// at most 5 s, and accepts up to 16 pending calls of `RenderFrame` and 256 streams.
    pub fn new(
        listen: impl Into<String>,
        engine: Box<dyn Engine>,
        scene: SceneSnapshot,
        rig: Rig,
        settings: RenderSettings,
        ready: impl FnOnce(Address) + Send + 'static,
    ) -> Self {
        Self {
            engine,
            network: NetworkOptions { listen: listen.into(), hosts: Vec::new(), access: None },
            early: None,
            limits: LimitOptions::default(),
            scene: SceneOptions {
                snapshot: scene,
                clock: None,
                time: TimeSource::default(),
                catalogues: Vec::new(),
                asteroid_fields: Vec::new(),
                observer: None,
                star_sources: Vec::new(),
            },
            views: ViewOptions { rig, settings, specs: Vec::new(), folder: PathBuf::new() },
            headset: None,
            windows: None,
            cluster: None,
            state: None,
            ready: Box::new(ready),
            reloads: Reloads::Signals,
            shutdown: Shutdown::Signals,
        }
    }
}
