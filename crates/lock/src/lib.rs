//! The frame lock: several machines show the same frame at the same time, or keep showing the last one.
//!
//! [`Director`] and [`Node`] are state machines without I/O and without a clock. The caller passes in messages and the time, and carries out the
//! [`director::Action`]s and [`node::Action`]s that `act` returns. So the same code runs over a network, in tests and in a model of 200 nodes.
//!
//! Both are driven in the same way: drain the queue of received messages into `hear`, report finished work (`composed`, `drawn`), then call `act`
//! once, and again at `wake_at` at the latest. A process that was suspended drains its queue first, so it acts on the newest state only.
//!
//! Each tick of the director begins one frame:
//!
//! 1. The director's caller composes a [`Cue`]; the director sends it to all nodes as [`State`], with the time of presentation.
//! 2. A node draws the newest STATE and reports READY when drawing has ended.
//! 3. The director decides once: COMMIT with a mask of nodes, or SKIP.
//! 4. A node that is in the mask shows the picture at the time of presentation. Without COMMIT it keeps showing the last one.
//!
//! Why no two directors can both commit: see [`director`]. Times are in nanoseconds: monotonic times count from any origin of the process, times of
//! presentation are in International Atomic Time (TAI), which all machines share.
//!
//! ```
//! use steradian_lock::{Cue, Director, Epoch, Identity, Node, NodeId, Now, Rules, director, messages::ToNode, node};
//!
//! let rules = Rules::at_hertz(1, 60.0)?;
//! let mut director = Director::new(rules, 7, Identity::default());
//! let mut node = Node::new(rules, NodeId(0), 8, Epoch::NONE, Identity::default(), Now::monotonic(0));
//!
//! // The node introduces itself; the director has heard all nodes, grants an epoch and asks for the first cue.
//! let node::Action::Send(hello) = node.act(Now::monotonic(0)).remove(0) else { panic!() };
//! director.hear(Now::monotonic(0), NodeId(0), hello);
//! let actions = director.act(Now::monotonic(0));
//! assert!(matches!(&actions[0], director::Action::Send { message: ToNode::Welcome(_), .. }));
//! let director::Action::Compose { id, .. } = actions[1] else { panic!() };
//! director.composed(Now::monotonic(0), id, Cue::new(&[])?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod clock;
pub mod director;
pub mod messages;
pub mod node;
pub mod rules;

pub use clock::Now;
pub use director::Director;
pub use messages::{Commit, Cue, Epoch, FrameId, Identity, Mask, NodeId, State};
pub use node::Node;
pub use rules::{Policy, Rules};
