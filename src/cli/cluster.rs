//! `cluster check`: checks a cluster before a show.

use std::{
    net::{TcpStream, ToSocketAddrs},
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use clap::{Args, Subcommand};
use sha2::{Digest, Sha256};

use super::{
    CliError,
    daemon_access::{DaemonAccess, address, uri},
    numbers::within,
    results,
    serve::cluster::{files, version},
};
use crate::{
    config::{ClusterConfig, Config, DIRECTOR, UNIX_PREFIX},
    service::{ask_director, cluster::distrusted_clock},
};

/// Number of connections that are opened to measure the network.
const CONNECTIONS: usize = 5;
/// Interval between two requests to the director.
const LOOK: Duration = Duration::from_millis(200);
/// Time after which an address without an answer counts as unreachable.
const PATIENCE: Duration = Duration::from_secs(5);

fn wait(text: &str) -> Result<Duration, String> {
    within(text, [0.0, 3600.0]).map(Duration::from_secs_f64)
}

/// Arguments of `cluster`.
#[derive(Debug, Args)]
pub struct ClusterArguments {
    #[command(subcommand)]
    command: ClusterCommand,
}

#[derive(Debug, Subcommand)]
enum ClusterCommand {
    /// Check versions, files, certificates, endpoints, and the running director.
    Check {
        /// Configuration file of the cluster.
        #[arg(long, value_name = "FILE")]
        config: PathBuf,
        /// Override a key of the configuration; can be repeated.
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// Address of the director's daemon: HOST:PORT, http://HOST:PORT, https://HOST:PORT or unix:PATH. Default: `server.listen`.
        #[arg(long, value_name = "ADDR", value_parser = address)]
        connect: Option<String>,
        #[command(flatten)]
        access: DaemonAccess,
        /// Wait for the director, and for its nodes to take part, for at most this time, seconds.
        #[arg(long, value_name = "N", default_value = "0", value_parser = wait, allow_negative_numbers = true)]
        wait: Duration,
    },
}

/// Runs the command. Exit code 1: something is not in order.
pub fn run(ClusterArguments { command }: &ClusterArguments) -> Result<(), CliError> {
    let ClusterCommand::Check { config, set, connect, access, wait } = command;
    let config = Config::load(config, set)?;
    let Some(cluster) = &config.cluster else {
        return Err(CliError::Usage(format!("{} has no [cluster]", config.origin)));
    };
    let mut problems: u32 = 0;
    let mut told = |fine: bool, text: String| {
        problems += u32::from(!fine);
        results::line(format!("{} {text}", if fine { "ok   " } else { "WRONG" }))
    };
    // Data that all processes must have in common.
    told(true, format!("program {}", version()?))?;
    let configuration = hexadecimal(&Sha256::digest(config.shared.as_bytes()));
    told(true, format!("configuration {configuration}"))?;
    for (name, hash) in files(&config)? {
        told(true, format!("file {name} {}", hexadecimal(&hash.0)))?;
    }
    for view in &config.views {
        let drawn = config.nodes.iter().filter(|node| node.views.contains(&view.name));
        let names: Vec<&str> = drawn.map(|node| node.name.as_str()).collect();
        let by = if names.is_empty() { "no node".to_owned() } else { names.join(", ") };
        told(true, format!("view {} drawn by {by}", view.name))?;
    }
    for (is_fine, text) in certificates(&config, cluster) {
        told(is_fine, text)?;
    }
    for endpoint in &cluster.endpoints {
        let (is_fine, text) = reached(endpoint);
        told(is_fine, text)?;
    }
    // Without a usable clock, frames are shown when COMMIT arrives.
    told(
        true,
        match distrusted_clock() {
            None => {
                "clock of this machine is usable: frames have presentation times if the clocks of all machines are usable".to_owned()
            }
            Some(reason) => {
                format!("clock of this machine is not used, so frames are shown when COMMIT arrives: {reason}")
            }
        },
    )?;
    // Check the running director. `server.listen` has no scheme, so add it.
    let address = connect.clone().unwrap_or_else(|| {
        let listen = &config.server.listen;
        let is_encrypted = config.server.tls.is_some() && !listen.starts_with(UNIX_PREFIX);
        if is_encrypted { format!("https://{listen}") } else { listen.clone() }
    });
    let credentials = access.credentials(&address)?;
    let begin = Instant::now();
    let asked = loop {
        let asked = ask_director(&uri(&address), &credentials, PATIENCE);
        let is_complete = asked.as_ref().is_ok_and(|found| found.nodes.iter().all(|node| node.is_in));
        if is_complete || begin.elapsed() >= *wait {
            break asked;
        }
        thread::sleep(LOOK);
    };
    match asked {
        Err(problem) => told(false, format!("director at {address}: {problem}"))?,
        Ok(found) => {
            let is_same = found.configuration == configuration;
            told(is_same, format!("director at {address}: {}, configuration {}", found.state, found.configuration))?;
            for node in found.nodes {
                told(node.is_in, node.text)?;
            }
        }
    }
    if problems == 0 { Ok(()) } else { Err(CliError::Cluster(problems)) }
}

/// Hexadecimal digits of the first eight bytes of a hash, as in `WatchStats`.
fn hexadecimal(hash: &[u8]) -> String {
    hash[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Reports which certificates are on this machine.
fn certificates(config: &Config, cluster: &ClusterConfig) -> Vec<(bool, String)> {
    let Some(tls) = &cluster.tls else {
        return vec![(true, "connections are not encrypted: all endpoints are on this machine".to_owned())];
    };
    let names = std::iter::once(DIRECTOR).chain(config.nodes.iter().map(|node| node.name.as_str()));
    let of = |name: &str| {
        let missing: Vec<String> = tls
            .files(&config.folder, name)
            .iter()
            .filter(|file| !file.is_file())
            .map(|file| file.display().to_string())
            .collect();
        match missing.len() {
            0 => (true, format!("certificate of {name}")),
            // Each machine needs only its own certificate.
            2 => (true, format!("certificate of {name}: not on this machine")),
            _ => (false, format!("certificate of {name}: missing {}", missing.join(", "))),
        }
    };
    names.map(of).collect()
}

/// Connects to an endpoint several times, and reports how long this takes.
fn reached(endpoint: &str) -> (bool, String) {
    let place = endpoint.split_once('/').map_or(endpoint, |(_, place)| place);
    let address = match place.to_socket_addrs().map(|mut addresses| addresses.next()) {
        Ok(Some(address)) => address,
        Ok(None) => return (false, format!("endpoint {endpoint}: no address")),
        Err(error) => return (false, format!("endpoint {endpoint}: {error}")),
    };
    let mut times_ms: Vec<f64> = Vec::new();
    for _ in 0..CONNECTIONS {
        let start = Instant::now();
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => times_ms.push(start.elapsed().as_secs_f64() * 1e3),
            Err(error) => return (false, format!("endpoint {endpoint}: no director: {error}")),
        }
    }
    times_ms.sort_by(f64::total_cmp);
    let (median, most) = (times_ms[CONNECTIONS / 2], times_ms[CONNECTIONS - 1]);
    (true, format!("endpoint {endpoint}: connected in {median:.2} ms, at most {most:.2} ms"))
}
