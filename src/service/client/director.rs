//! State of a running director and of its nodes, as readable text.

use std::time::Duration;

use super::{connection::Client, credentials::Credentials};
use crate::service::proto;

/// State of a director.
pub struct FoundDirector {
    /// Its phase.
    pub state: String,
    /// First digits of the hash of its configuration.
    pub configuration: String,
    /// Its nodes.
    pub nodes: Vec<FoundNode>,
}

/// State of a node, as its director sees it.
pub struct FoundNode {
    /// Whether it takes part and has the director's scene.
    pub is_in: bool,
    /// State, version, scene and times in one line.
    pub text: String,
}

/// Requests the state of the director at an address of its service (as for [`Client::connect_as`]).
///
/// # Errors
/// It cannot be reached, does not answer in time, or is not in a cluster; the text states the reason.
pub fn ask_director(address: &str, credentials: &Credentials, patience: Duration) -> Result<FoundDirector, String> {
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|error| error.to_string())?;
    let asked = async {
        let mut client = Client::connect_as(address, credentials).await.map_err(|error| error.to_string())?;
        let mut stats = client.watch_stats(None).await.map_err(|error| error.to_string())?;
        let first = stats.next().await.map_err(|error| error.to_string())?;
        first.and_then(|stats| stats.cluster).ok_or_else(|| "it is not in a cluster".to_owned())
    };
    let stats = runtime.block_on(async {
        tokio::time::timeout(patience, asked).await.map_err(|_| "it does not answer".to_owned())?
    })?;
    let found = |node: &proto::ClusterNodeStats| FoundNode {
        is_in: node.state == "in" && node.scene_hash == stats.scene_hash,
        text: line_of(node),
    };
    let nodes = stats.nodes.iter().map(found).collect();
    Ok(FoundDirector { state: stats.state, configuration: stats.configuration, nodes })
}

fn line_of(node: &proto::ClusterNodeStats) -> String {
    let ready = node.ready.unwrap_or_default();
    let reason = if node.reason.is_empty() { String::new() } else { format!(" ({})", node.reason) };
    format!(
        "node {}: {}{reason}, {}, scene {}, STATE to READY {:.2} / {:.2} / {:.2} ms, left out {}, refused {}",
        node.name,
        node.state,
        node.version,
        node.scene_hash,
        ready.median_ms,
        ready.p99_ms,
        ready.max_ms,
        node.out,
        node.refused
    )
}
