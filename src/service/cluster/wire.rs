//! The network between director and nodes, as a small trait. Tests have their own implementation.

use std::sync::Arc;

use steradian_lock::messages::NodeId;

/// Receiver of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum To {
    /// All directors.
    Directors,
    /// All nodes.
    Nodes,
    /// One node.
    Node(NodeId),
}

/// An event of the network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A message of a node. The wire has authenticated the node if connections are encrypted.
    FromNode(NodeId, Vec<u8>),
    /// A message of a director.
    FromDirector(Vec<u8>),
    /// A node is connected (true), or its connection ended.
    Node(NodeId, bool),
    /// A director is connected (true), or the connection to it ended.
    Director(bool),
    /// The director's scene, which the node has requested.
    Scene(Vec<u8>),
}

/// Receives events on a thread of the network. It must return at once.
pub type Hear = Arc<dyn Fn(Heard) + Send + Sync>;

/// An open network. No method waits for another process.
pub trait Wire: Send {
    /// Sends a message. A message that cannot be sent at once is dropped; the lock repeats what matters.
    ///
    /// # Errors
    ///
    /// The network refuses the message.
    fn send(&mut self, to: To, bytes: &[u8]) -> Result<(), String>;

    /// Director: answers nodes that ask for the scene with these bytes from now on.
    fn offer_scene(&mut self, bytes: Arc<[u8]>);

    /// Node: asks the director for its scene. The answer is [`Heard::Scene`].
    ///
    /// # Errors
    ///
    /// The network refuses the request.
    fn ask_scene(&mut self) -> Result<(), String>;
}

/// Opens the network on the calling thread, whose scheduling its threads inherit.
pub type OpenWire = Box<dyn FnOnce(Hear) -> Result<Box<dyn Wire>, String> + Send>;
