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
    /// Sends a message. A message that cannot be sent at once is dropped; the lock repeats the messages that matter.
    ///
    /// # Errors
    ///
    /// The network refuses the message.
    fn send(&mut self, to: To, bytes: &[u8]) -> Result<(), String>;

    /// For a director: from now on, answers nodes that request the scene with these bytes.
    fn offer_scene(&mut self, bytes: Arc<[u8]>);

    /// For a node: requests the director's scene. The answer is [`Heard::Scene`].
    ///
    /// # Errors
    ///
    /// The network refuses the request.
    fn ask_scene(&mut self) -> Result<(), String>;
}

/// Function that opens the network. The network's threads inherit the scheduling of the calling thread.
pub type OpenWire = Box<dyn FnOnce(Hear) -> Result<Box<dyn Wire>, String> + Send>;
