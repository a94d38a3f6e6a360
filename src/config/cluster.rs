//! `[cluster]` and `[[nodes]]`: several machines that show the same frames.

use std::{
    net::{IpAddr, SocketAddr},
    path::{Path, PathBuf},
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ViewSpec, WindowConfig};
use crate::{
    plan::{
        settings::{ExposureSettings, Metering},
        view_settings::ViewSettings,
    },
    ranges::KeyError,
    view::check_name,
};

/// Maximum number of nodes in a cluster.
pub const MOST_NODES: usize = 256;
/// Name of the director in paths of certificates.
pub const DIRECTOR: &str = "director";
/// Part of a path that is replaced by the name of a node, or by [`DIRECTOR`].
const NAME_IN_PATH: &str = "{name}";

/// `[cluster]`. The director and all nodes have the same configuration.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClusterConfig {
    /// Name of the cluster. Clusters on one network must have different names.
    #[serde(default = "cluster_name")]
    pub name: String,
    /// Addresses of directors as `tcp/HOST:PORT`, or `tls/HOST:PORT` with `tls`. A director listens on the first one unless `--endpoint` names another; nodes
    /// dial all of them. `tcp` needs a loopback address.
    pub endpoints: Vec<String>,
    /// Frames per second.
    #[serde(default = "rate_hz")]
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "Hz"))]
    pub rate_hz: f64,
    /// What happens if a node is not ready in time.
    #[serde(default)]
    pub at_deadline: AtDeadline,
    /// A node is left out after it was not ready for this number of consecutive frames. With 1, a node that hangs costs the other nodes one frame,
    /// and a node that is late once is left out for three frames.
    #[serde(default = "misses")]
    #[schemars(range(min = 1, max = 10))]
    pub misses: u8,
    /// Time between the deadline of a frame and its presentation. A lost message is repeated during this time.
    #[serde(default = "lead_ms")]
    #[schemars(range(min = 0.0, max = 1000.0), extend("x-unit" = "ms"))]
    pub lead_ms: f64,
    /// Time for which the director waits for all nodes before it begins with more than half of them.
    #[serde(default = "gather_s")]
    #[schemars(range(min = 0.0, max = 3600.0), extend("x-unit" = "s"))]
    pub gather_s: f64,
    /// Time without a new frame after which the windows and streams of a node become black.
    #[serde(default = "hold_s")]
    #[schemars(range(min = 0.1, max = 3600.0), extend("x-unit" = "s"))]
    pub hold_s: f64,
    /// Folder in which each node keeps the epoch that it has promised, in a file named after the node. The folder must survive a restart of the
    /// machine.
    #[serde(default = "epochs")]
    pub epochs: PathBuf,
    /// Whether the threads of the network, and the one that presents, request real-time scheduling. If the system refuses, this is logged.
    #[serde(default = "yes")]
    pub real_time: bool,
    /// Encrypts and authenticates the connections.
    pub tls: Option<ClusterTls>,
}

/// `[cluster.tls]`. Paths start at the folder of the configuration; `{name}` in them is replaced by the name of the node, or by `director`. Each
/// certificate is valid for servers and clients.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClusterTls {
    /// Certificate of the authority that signs all others, PEM.
    pub ca: PathBuf,
    /// Certificate of the process, PEM.
    pub certificate: PathBuf,
    /// Its private key, PEM.
    pub key: PathBuf,
    /// Common name in the certificate of directors.
    #[serde(default = "director_name")]
    pub director: String,
}

/// Behaviour at the deadline of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AtDeadline {
    /// The frame is skipped on all nodes.
    #[default]
    Together,
    /// The nodes that are ready show the frame.
    Apart,
}

named!(AtDeadline { Together = "together", Apart = "apart" });

/// `[[nodes]]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeConfig {
    /// Unique name, for `--node`: letters, digits, `_` and `-`.
    pub name: String,
    /// Names of the views that it draws.
    pub views: Vec<String>,
    /// Names of the windows that it opens; they must show these views. Absent: all windows of these views.
    pub windows: Option<Vec<String>>,
    /// Common name in its certificate. Absent: the name of the node.
    pub certificate: Option<String>,
    /// Address at which clients can reach the node's daemon, like `server.listen`. Absent: a free port of the loopback address.
    pub listen: Option<String>,
}

fn cluster_name() -> String {
    "steradian".to_owned()
}

fn director_name() -> String {
    DIRECTOR.to_owned()
}

fn rate_hz() -> f64 {
    60.0
}

fn misses() -> u8 {
    3
}

fn lead_ms() -> f64 {
    33.0
}

fn gather_s() -> f64 {
    5.0
}

fn hold_s() -> f64 {
    5.0
}

fn epochs() -> PathBuf {
    PathBuf::from("cluster")
}

fn yes() -> bool {
    true
}

impl ClusterTls {
    /// The files of a process: authority, certificate and key.
    pub fn files(&self, folder: &Path, process: &str) -> [PathBuf; 3] {
        [&self.ca, &self.certificate, &self.key]
            .map(|path| folder.join(path.to_string_lossy().replace(NAME_IN_PATH, process)))
    }
}

impl NodeConfig {
    /// The common name in its certificate.
    pub fn common_name(&self) -> &str {
        self.certificate.as_deref().unwrap_or(&self.name)
    }

    /// The windows that it opens.
    pub fn windows_of<'a>(&'a self, windows: &'a [WindowConfig]) -> impl Iterator<Item = &'a WindowConfig> {
        windows.iter().filter(|window| match &self.windows {
            Some(named) => named.contains(&window.name),
            None => self.views.contains(&window.view),
        })
    }

    fn check(&self, views: &[ViewSpec], windows: &[WindowConfig]) -> Result<(), KeyError> {
        check_name(&self.name).map_err(|error| KeyError::new("name", error.to_string()))?;
        if self.name == DIRECTOR {
            return Err(KeyError::new("name", format!("`{DIRECTOR}` is the name of the director")));
        }
        if self.views.is_empty() {
            return Err(KeyError::new("views", "a node must draw at least one view"));
        }
        for (index, name) in self.views.iter().enumerate() {
            let key = format!("views[{index}]");
            if !views.iter().any(|view| view.name == *name) {
                let names: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
                return Err(KeyError::new(key, format!("no view `{name}`: must be one of {}", names.join(", "))));
            }
            if self.views[..index].contains(name) {
                return Err(KeyError::new(key, format!("`{name}` is in the list twice")));
            }
        }
        for (index, name) in self.windows.iter().flatten().enumerate() {
            let key = format!("windows[{index}]");
            let Some(window) = windows.iter().find(|window| window.name == *name) else {
                return Err(KeyError::new(key, format!("no window `{name}`")));
            };
            if !self.views.contains(&window.view) {
                let problem = format!("`{name}` shows view `{}`, which the node does not draw", window.view);
                return Err(KeyError::new(key, problem));
            }
        }
        Ok(())
    }
}

/// The host and port of an endpoint, and whether it is encrypted.
fn endpoint(text: &str) -> Option<(&str, bool)> {
    let (protocol, place) = text.split_once('/')?;
    let (host, port) = place.rsplit_once(':')?;
    let is_encrypted = match protocol {
        "tcp" => false,
        "tls" => true,
        _ => return None,
    };
    (!host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0)).then_some((place, is_encrypted))
}

fn is_loopback(place: &str) -> bool {
    let of_address = place.parse::<SocketAddr>().map(|address| address.ip()).is_ok_and(|ip: IpAddr| ip.is_loopback());
    of_address || place.rsplit_once(':').is_some_and(|(host, _)| host == "localhost")
}

impl ClusterConfig {
    pub(super) fn check(&self) -> Result<(), KeyError> {
        check_name(&self.name).map_err(|error| KeyError::new("name", error.to_string()))?;
        if self.endpoints.is_empty() {
            return Err(KeyError::new("endpoints", "must have at least one address, such as `tcp/127.0.0.1:7447`"));
        }
        for (index, text) in self.endpoints.iter().enumerate() {
            let key = format!("endpoints[{index}]");
            let Some((place, is_encrypted)) = endpoint(text) else {
                return Err(KeyError::new(key, format!("`{text}` must be tcp/HOST:PORT or tls/HOST:PORT")));
            };
            if is_encrypted != self.tls.is_some() {
                let problem =
                    if is_encrypted { "tls needs [cluster.tls]" } else { "with [cluster.tls] it must be tls" };
                return Err(KeyError::new(key, format!("`{text}`: {problem}")));
            }
            if !is_encrypted && !is_loopback(place) {
                let problem = "only a loopback address may be unencrypted: use tls, with [cluster.tls]";
                return Err(KeyError::new(key, format!("`{text}`: {problem}")));
            }
        }
        Ok(())
    }
}

/// Checks `[[nodes]]` with the rest of the configuration; an error has the index of the node.
pub(super) fn check_nodes(
    nodes: &[NodeConfig],
    views: &[ViewSpec],
    windows: &[WindowConfig],
) -> Result<(), (usize, KeyError)> {
    if nodes.len() > MOST_NODES {
        return Err((MOST_NODES, KeyError::new("", format!("{} nodes: must be at most {MOST_NODES}", nodes.len()))));
    }
    for (index, node) in nodes.iter().enumerate() {
        node.check(views, windows).map_err(|fault| (index, fault))?;
        for (first, other) in nodes[..index].iter().enumerate() {
            if other.name == node.name {
                let problem = format!("nodes[{first}] also has the name `{}`: names must be unique", node.name);
                return Err((index, KeyError::new("name", problem)));
            }
            if other.common_name() == node.common_name() {
                let problem = format!("nodes[{first}] also has the certificate `{}`", node.common_name());
                return Err((index, KeyError::new("certificate", problem)));
            }
        }
    }
    Ok(())
}

/// Checks that the exposure of every view is known before a frame is drawn. The metering modes `mean` and `spot` are refused: they measure light that
/// is drawn on several machines.
pub(super) fn check_exposures(general: &ExposureSettings, views: &[ViewSettings]) -> Result<(), KeyError> {
    for exposure in std::iter::once(general).chain(views.iter().map(|view| &view.exposure)) {
        if let Some(metering) = [Metering::Mean, Metering::Spot].into_iter().find(|one| exposure.uses(*one)) {
            let problem = format!(
                "exposure.metering = \"{}\" is not possible in a cluster: use limiting_magnitude, or a manual exposure",
                metering.name()
            );
            return Err(KeyError::new("", problem));
        }
    }
    Ok(())
}
