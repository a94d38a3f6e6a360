//! The role of a daemon in a cluster, with its configuration.

use std::{
    env,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
};

use clap::ValueEnum;
use sha2::{Digest, Sha256};
use steradian_lock::{
    messages::{Hash, Identity, NodeId, PROTOCOL},
    rules::{Policy, Rules},
};

use super::ServeArguments;
use crate::{
    cli::CliError,
    config::{AtDeadline, ClusterConfig, Config, DIRECTOR, NodeConfig, WindowConfig},
    gpu::AdapterReport,
    service::cluster::{self, ClusterOptions},
};

/// Default address of a node's daemon.
const NODE_LISTEN: &str = "127.0.0.1:0";

/// Size of the blocks in which a file is read to hash it, bytes.
const HASHED_BYTES: usize = 1 << 20;

/// `--role`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ClusterRole {
    /// Plans and coordinates the frames of all nodes, and accepts changes from clients.
    Director,
    /// Draws the views of a node.
    Node,
}

/// The role of this daemon.
pub(super) struct Part {
    cluster: ClusterConfig,
    /// Number and keys of the node; `None` for the director.
    pub(super) node: Option<(NodeId, NodeConfig)>,
    /// The address on which a director listens, or all addresses to which a node connects.
    endpoints: Vec<String>,
    rules: Rules,
}

fn usage(problem: impl Into<String>) -> CliError {
    CliError::Usage(problem.into())
}

/// Returns the role that the arguments request; `None`: the daemon is not in a cluster.
pub(super) fn part(config: &Config, arguments: &ServeArguments) -> Result<Option<Part>, CliError> {
    let Some(role) = arguments.role else {
        return match (&arguments.node, &arguments.endpoint) {
            (None, None) => Ok(None),
            _ => Err(usage("--node and --endpoint need --role")),
        };
    };
    if !cfg!(feature = "cluster") {
        return Err(usage("--role: this program was built without the feature `cluster`"));
    }
    let Some(cluster) = config.cluster.clone() else {
        return Err(usage(format!("--role: {} has no [cluster]", config.origin)));
    };
    let (node, endpoints) = match role {
        ClusterRole::Director => {
            if arguments.node.is_some() {
                return Err(usage("--node needs --role node"));
            }
            let endpoint = arguments.endpoint.as_ref().unwrap_or(&cluster.endpoints[0]);
            if !cluster.endpoints.contains(endpoint) {
                let all = cluster.endpoints.join(", ");
                return Err(usage(format!("--endpoint {endpoint}: must be one of cluster.endpoints: {all}")));
            }
            (None, vec![endpoint.clone()])
        }
        ClusterRole::Node => {
            if arguments.endpoint.is_some() {
                return Err(usage("--endpoint needs --role director: nodes dial all endpoints"));
            }
            let names = || config.nodes.iter().map(|node| node.name.as_str()).collect::<Vec<_>>().join(", ");
            let name =
                arguments.node.as_ref().ok_or_else(|| usage(format!("--role node needs --node: {}", names())))?;
            let index = config.nodes.iter().position(|node| node.name == *name);
            let index = index.ok_or_else(|| usage(format!("--node {name}: must be one of {}", names())))?;
            let id = NodeId(u16::try_from(index).unwrap_or(u16::MAX));
            (Some((id, config.nodes[index].clone())), cluster.endpoints.clone())
        }
    };
    #[cfg(feature = "cluster")]
    if cluster.tls.is_some() {
        set_threads_of_zenoh()?;
    }
    let rules = rules(&cluster, config.nodes.len()).map_err(|error| usage(format!("cluster: {error}")))?;
    Ok(Some(Part { cluster, node, endpoints, rules }))
}

/// Configures Zenoh's threads for encrypted connections. Zenoh reads this setting from an environment variable, so the program restarts itself with
/// the variable set.
#[cfg(feature = "cluster")]
fn set_threads_of_zenoh() -> Result<(), CliError> {
    let (name, value) = cluster::zenoh::ZENOH_THREADS;
    match env::var_os(name) {
        Some(set) if set == value => Ok(()),
        Some(set) => {
            Err(usage(format!("{name} is `{}`: with [cluster.tls] it must be absent or `{value}`", set.display())))
        }
        None => {
            let error = crate::platform::process::run_again_with(name, value);
            Err(usage(format!("{name} cannot be set: {error}; set it to `{value}`")))
        }
    }
}

/// Returns the rules of the frame lock.
fn rules(cluster: &ClusterConfig, nodes: usize) -> Result<Rules, steradian_lock::rules::RulesError> {
    let nodes = u16::try_from(nodes).unwrap_or(u16::MAX);
    let ns = |seconds: f64| (seconds * 1e9).round() as u64;
    let gather_ns = ns(cluster.gather_s);
    Rules {
        policy: match cluster.at_deadline {
            AtDeadline::Together => Policy::Together,
            AtDeadline::Apart => Policy::Apart,
        },
        misses_until_out: cluster.misses,
        lead_ns: ns(cluster.lead_ms * 1e-3),
        gather_ns,
        start_ns: gather_ns,
        hold_ns: ns(cluster.hold_s),
        ..Rules::at_hertz(nodes, cluster.rate_hz)?
    }
    .checked()
}

/// SHA-256 of a file.
fn hash_of(path: &Path) -> Result<Hash, CliError> {
    let hashed = || -> io::Result<Hash> {
        let (mut file, mut hash) = (File::open(path)?, Sha256::new());
        let mut block = vec![0; HASHED_BYTES];
        loop {
            match file.read(&mut block)? {
                0 => return Ok(Hash(hash.finalize().into())),
                read => hash.update(&block[..read]),
            }
        }
    };
    hashed().map_err(|error| usage(format!("{}: {error}", path.display())))
}

/// Version of the program, with the beginning of the hash of its file: director and nodes must be the same build.
pub(in crate::cli) fn version() -> Result<String, CliError> {
    let program = env::current_exe().map_err(|error| usage(format!("the program's file: {error}")))?;
    let Hash(hash) = hash_of(&program)?;
    let short: String = hash[..6].iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(format!("{} ({short})", env!("CARGO_PKG_VERSION")))
}

/// Files that pictures depend on, with their hashes. Names are relative to the folder of the configuration.
pub(in crate::cli) fn files(config: &Config) -> Result<Vec<(String, Hash)>, CliError> {
    let named = |path: PathBuf| {
        let name = path.strip_prefix(&config.folder).unwrap_or(&path).display().to_string();
        Ok((name, hash_of(&path)?))
    };
    config.named_files().into_iter().map(named).collect()
}

impl Part {
    /// Address of the daemon.
    pub(super) fn listen(&self, config: &Config) -> String {
        match &self.node {
            None => config.server.listen.clone(),
            Some((_, node)) => node.listen.clone().unwrap_or_else(|| NODE_LISTEN.to_owned()),
        }
    }

    /// The windows that this daemon opens: those of the node. A director has no windows.
    pub(super) fn windows(&self, config: &Config) -> Vec<WindowConfig> {
        self.node.iter().flat_map(|(_, node)| node.windows_of(&config.windows)).cloned().collect()
    }

    /// Options for the service. Reads the files of the configuration for their hashes.
    pub(super) fn options(&self, config: &Config, adapter: &AdapterReport) -> Result<ClusterOptions, CliError> {
        let name = self.node.as_ref().map_or(DIRECTOR, |(_, node)| &node.name);
        let run = cluster::new_run().map_err(usage)?;
        let identity = Identity {
            version: version()?,
            protocol: PROTOCOL,
            configuration: Hash(Sha256::digest(config.shared.as_bytes()).into()),
            catalogues: files(config)?,
            adapter: adapter.adapter.clone(),
            driver: adapter.driver.clone(),
            views: self.node.as_ref().map(|(_, node)| node.views.clone()).unwrap_or_default(),
            windows: self.windows(config).into_iter().map(|window| window.name).collect(),
        };
        Ok(ClusterOptions {
            cluster: self.cluster.name.clone(),
            node: self.node.as_ref().map(|(id, _)| *id),
            nodes: config.nodes.clone(),
            rules: self.rules,
            identity,
            run,
            epoch_file: config.folder.join(&self.cluster.epochs).join(format!("{name}.epoch")),
            director: config.server.listen.clone(),
            real_time: self.cluster.real_time,
            open: self.open(config, name, run)?,
        })
    }

    #[cfg(feature = "cluster")]
    fn open(&self, config: &Config, name: &str, run: u64) -> Result<cluster::OpenWire, CliError> {
        use crate::service::cluster::zenoh::{ZenohOptions, ZenohTls};
        let tls = self
            .cluster
            .tls
            .as_ref()
            .map(|tls| ZenohTls { files: tls.files(&config.folder, name), director: tls.director.clone() });
        for file in tls.iter().flat_map(|tls| &tls.files) {
            File::open(file).map_err(|error| usage(format!("cluster.tls: {}: {error}", file.display())))?;
        }
        let nodes = config.nodes.iter().map(|node| (node.name.clone(), node.common_name().to_owned())).collect();
        let node = self.node.as_ref().map(|(id, _)| *id);
        let options = ZenohOptions {
            cluster: self.cluster.name.clone(),
            nodes,
            node,
            endpoints: self.endpoints.clone(),
            run,
            tls,
        };
        Ok(options.open())
    }

    #[cfg(not(feature = "cluster"))]
    fn open(&self, _: &Config, name: &str, run: u64) -> Result<cluster::OpenWire, CliError> {
        // Without this feature, `part` refuses every role, so this is never called.
        Err(usage(format!("{name}, {run}, {}: no network", self.endpoints.join(", "))))
    }
}
