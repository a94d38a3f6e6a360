//! Several daemons in frame lock. One is the director, the others are nodes; `docs/cluster.md` describes the design.
//!
//! | module | content |
//! |---|---|
//! | `wire` | the network as a trait; `zenoh` is the one in use (feature `cluster`) |
//! | `messages`, `cue`, `report`, `scene` | content of messages, as protobuf |
//! | `director`, `compose` | the director's threads: the lock, and cues |
//! | `node`, `epoch_file` | the node's thread, and the epoch that it has promised |
//! | `station` | state and methods that both threads share |
//! | `figures` | figures for clients |
//! | `refusals` | refusals that the network reports only in its log |
//!
//! The thread of a director or node owns the state machine of the lock and the wire. Callbacks of the network, the render thread and the composer
//! push events into its queue; nothing else is shared, and nothing waits on the path of a frame.

mod clock;
mod compose;
mod cue;
mod director;
mod epoch_file;
pub(crate) mod figures;
mod messages;
mod node;
mod queue;
mod refusals;
mod report;
mod scene;
mod station;
mod wire;
#[cfg(feature = "cluster")]
pub mod zenoh;

use std::{
    io,
    path::PathBuf,
    sync::{Arc, mpsc::Receiver},
};

use steradian_lock::{
    messages::{Identity, NodeId},
    rules::Rules,
};

pub use self::clock::distrusted_clock;
pub use self::messages::{Unreadable, decode_to_director, decode_to_node, encode_to_director, encode_to_node};
#[cfg(feature = "cluster")]
pub use self::refusals::watch as watch_refusals;
pub use self::wire::{Hear, Heard, OpenWire, To, Wire};
use self::{figures::SharedFigures, queue::Queue};
use super::{engine::render_handle::RenderHandle, threads::RunningThread};
use crate::{config::NodeConfig, platform::process};

/// Options of a daemon that is part of a cluster.
pub struct ClusterOptions {
    /// Name of the cluster.
    pub cluster: String,
    /// The number of this node; `None`: the director.
    pub node: Option<NodeId>,
    /// All nodes.
    pub nodes: Vec<NodeConfig>,
    /// Rules of the lock.
    pub rules: Rules,
    /// Versions and files of this process.
    pub identity: Identity,
    /// Random number of this process.
    pub run: u64,
    /// File in which a node keeps the epoch that it has promised.
    pub epoch_file: PathBuf,
    /// Address at which clients reach the director.
    pub director: String,
    /// Whether to request real-time scheduling of the network's threads and of the presenting thread.
    pub real_time: bool,
    /// Opens the network.
    pub open: OpenWire,
}

/// Options that the threads need.
struct Party {
    cluster: String,
    name: String,
    node: Option<NodeId>,
    nodes: Vec<NodeConfig>,
    rules: Rules,
    identity: Identity,
    run: u64,
    epoch_file: PathBuf,
}

/// The part of a running daemon that belongs to its cluster.
pub(crate) struct Cluster {
    figures: Arc<SharedFigures>,
    /// The reason why a node refuses changes; `None` for the director.
    pub(crate) refusal: Option<Arc<str>>,
    stop: Box<dyn Fn() + Send + Sync>,
}

/// The cluster's thread, whose error is the reason why the daemon must end.
pub(crate) type ClusterThread = RunningThread<Result<(), String>>;

impl Cluster {
    /// Starts the thread of a director or a node. From now on, a node draws frames only on request of the director.
    ///
    /// # Errors
    ///
    /// The system refuses a thread.
    pub(crate) fn spawn(options: ClusterOptions, render: &RenderHandle) -> io::Result<(Arc<Self>, ClusterThread)> {
        let ClusterOptions { cluster, node, nodes, rules, identity, run, epoch_file, director, real_time, open } =
            options;
        let own = node.and_then(|node| nodes.get(usize::from(node.0)).cloned());
        let name = own.as_ref().map_or_else(|| crate::config::DIRECTOR.to_owned(), |own| own.name.clone());
        let party = Party { cluster, name, node, nodes, rules, identity, run, epoch_file };
        let figures = Arc::new(SharedFigures::default());
        let refusal = own.as_ref().map(|own| {
            let text = format!(
                "this daemon is node `{}` of the cluster `{}`: send changes to the director, at {director}",
                own.name, party.cluster
            );
            text.into()
        });
        let opened = move |hear: Hear| -> Result<(Box<dyn Wire>, bool), String> {
            let is_real_time = real_time
                && process::real_time_thread()
                    .inspect_err(|error| {
                        tracing::warn!("cluster: no real-time scheduling of the network's threads: {error}");
                    })
                    .is_ok();
            Ok((open(hear)?, is_real_time))
        };
        let (thread, stop): (ClusterThread, Box<dyn Fn() + Send + Sync>) = match own {
            None => {
                let (queue, events, hear) = queue_of(director::Event::Heard);
                let open = move || opened(hear);
                let thread = director::spawn(party, render.clone(), &queue, events, Arc::clone(&figures), open)?;
                (thread, Box::new(move || queue.push_surely(director::Event::Stop)))
            }
            Some(own) => {
                render.be_led(own.views, real_time);
                let (queue, events, hear) = queue_of(node::Event::Heard);
                let open = move || opened(hear);
                let thread = node::spawn(party, render.clone(), &queue, events, Arc::clone(&figures), open)?;
                (thread, Box::new(move || queue.push_surely(node::Event::Stop)))
            }
        };
        Ok((Arc::new(Self { figures, refusal, stop }), thread))
    }

    /// Ends the thread.
    pub(crate) fn stop(&self) {
        (self.stop)();
    }

    /// Returns the current figures.
    pub(crate) fn figures(&self) -> figures::ClusterFigures {
        self.figures.get()
    }
}

/// Creates the queue of a thread. Returns it with the receiver of its events, and the callback of the wire that adds received messages.
fn queue_of<E: Send + 'static>(event: fn(Heard) -> E) -> (Arc<Queue<E>>, Receiver<E>, Hear) {
    let (queue, events) = Queue::new();
    let queue = Arc::new(queue);
    let heard = Arc::clone(&queue);
    (queue, events, Arc::new(move |what| heard.push(event(what))))
}

/// Returns a random number for a process.
///
/// # Errors
///
/// The system has none.
pub fn new_run() -> Result<u64, String> {
    let mut bytes = [0; 8];
    let random = rustls::crypto::ring::default_provider().secure_random;
    random.fill(&mut bytes).map_err(|_| "the system has no random numbers".to_owned())?;
    Ok(u64::from_le_bytes(bytes))
}
