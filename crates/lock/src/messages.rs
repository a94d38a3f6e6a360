//! Messages between director and nodes. A director listens, nodes connect to it, and a message to all nodes reaches every node.
//!
//! Data that the lock does not interpret are typed blocks of bytes: a [`Cue`] holds the inputs for drawing (revision and hash of the scene, time,
//! camera, exposure, quality, overlays), a [`Report`] the results (sums per group, statistics).

use std::{error::Error, fmt, sync::Arc};

/// Largest number of nodes.
pub const MAX_NODES: u16 = 256;
/// Version of these messages. Director and nodes must have the same version.
pub const PROTOCOL: u32 = 1;

/// Index of a node in the configuration. The network layer authenticates it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u16);

/// One term of one director. Later epochs are greater. Two directors never have the same epoch, because `run` is drawn at random at the start of each
/// process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Epoch {
    /// Greater than the numbers of all epochs that more than half of the nodes had promised before.
    pub counter: u64,
    /// Random number of the director's process.
    pub run: u64,
}

impl Epoch {
    /// No epoch: smaller than every epoch of a director.
    pub const NONE: Self = Self { counter: 0, run: 0 };
}

/// A frame of an epoch. Newer frames are greater, even if their epochs differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId {
    /// The reign.
    pub epoch: Epoch,
    /// 1 for the first frame of the epoch.
    pub number: u64,
}

/// A set of nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Mask([u64; MAX_NODES as usize / 64]);

impl Mask {
    fn place(node: NodeId) -> (usize, u64) {
        (usize::from(node.0 / 64), 1 << (node.0 % 64))
    }

    /// Adds a node. Nodes with a number of [`MAX_NODES`] or more are ignored.
    pub fn insert(&mut self, node: NodeId) {
        let (word, bit) = Self::place(node);
        if let Some(word) = self.0.get_mut(word) {
            *word |= bit;
        }
    }

    /// Whether a node is in the set.
    pub fn contains(&self, node: NodeId) -> bool {
        let (word, bit) = Self::place(node);
        self.0.get(word).is_some_and(|word| word & bit != 0)
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether no node is in the set.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The nodes that are in both sets.
    pub fn intersection(&self, other: &Self) -> Self {
        let mut both = *self;
        both.0.iter_mut().zip(other.0).for_each(|(word, other)| *word &= other);
        both
    }

    /// The nodes in ascending order.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> + use<> {
        let words = (0..MAX_NODES).step_by(64).zip(self.0).filter(|(_, word)| *word != 0);
        let bits = |word: u64| (0..64).filter(move |bit| word & (1 << bit) != 0);
        words.flat_map(move |(first, word)| bits(word).map(move |bit| NodeId(first + bit)))
    }
}

impl FromIterator<NodeId> for Mask {
    fn from_iter<I: IntoIterator<Item = NodeId>>(nodes: I) -> Self {
        let mut mask = Self::default();
        nodes.into_iter().for_each(|node| mask.insert(node));
        mask
    }
}

/// SHA-256 of a file or a configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hash(pub [u8; 32]);

/// Versions and files of a process. Version, protocol, configuration and catalogues must equal those of the director; the other fields inform the
/// operator.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Version of Steradian.
    pub version: String,
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// Hash of the configuration that all processes share.
    pub configuration: Hash,
    /// Names and hashes of the catalogues, in the order of the configuration.
    pub catalogues: Vec<(String, Hash)>,
    /// Name of the graphics adapter.
    pub adapter: String,
    /// Name and version of its driver.
    pub driver: String,
    /// Names of the views that the node draws.
    pub views: Vec<String>,
    /// Names of the windows that it shows.
    pub windows: Vec<String>,
}

impl Identity {
    /// Returns the first difference because of which a node must not draw together with its director; `None`: the node may join.
    pub fn difference(&self, node: &Self) -> Option<Refusal> {
        if self.protocol != node.protocol {
            return Some(Refusal::Protocol { director: self.protocol, node: node.protocol });
        }
        if self.version != node.version {
            return Some(Refusal::Version { director: self.version.clone(), node: node.version.clone() });
        }
        if self.configuration != node.configuration {
            return Some(Refusal::Configuration);
        }
        let missing = self.catalogues.iter().find(|catalogue| !node.catalogues.contains(catalogue));
        let surplus = || node.catalogues.iter().find(|catalogue| !self.catalogues.contains(catalogue));
        missing.or_else(surplus).map(|(name, _)| Refusal::Catalogue(name.clone()))
    }
}

/// Why a director refuses a node. Its text is for the operator.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the values of both sides")]
pub enum Refusal {
    /// It has another version of the messages.
    Protocol { director: u32, node: u32 },
    /// It has another version of Steradian.
    Version { director: String, node: String },
    /// Another configuration.
    Configuration,
    /// The catalogue of this name is missing on one side, or differs.
    Catalogue(String),
    /// The configuration has no such node.
    UnknownNode(NodeId),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Protocol { director, node } => {
                write!(f, "the node has version {node} of the protocol, the director {director}")
            }
            Self::Version { director, node } => write!(f, "the node is Steradian {node}, the director {director}"),
            Self::Configuration => write!(f, "the node has another configuration"),
            Self::Catalogue(name) => write!(f, "the catalogue {name} is missing on one side, or differs"),
            Self::UnknownNode(node) => write!(f, "the configuration has no node {}", node.0),
        }
    }
}

/// Inputs for drawing a frame, as bytes that the lock does not read. Equal on all nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cue(Arc<[u8]>);

impl Cue {
    /// With a cue of this size, a STATE has at most 4 kB.
    pub const MAX_BYTES: usize = 4096 - 128;

    /// # Errors
    ///
    /// There are more than [`Cue::MAX_BYTES`] bytes.
    pub fn new(bytes: &[u8]) -> Result<Self, CueTooLong> {
        if bytes.len() > Self::MAX_BYTES { Err(CueTooLong(bytes.len())) } else { Ok(Self(bytes.into())) }
    }

    /// The bytes that were passed to [`Cue::new`].
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// The cue has this many bytes and does not fit into a STATE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CueTooLong(pub usize);

impl fmt::Display for CueTooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a cue of {} bytes: at most {} fit", self.0, Cue::MAX_BYTES)
    }
}

impl Error for CueTooLong {}

/// Results of drawing a frame on a node, as bytes that the lock does not read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report(pub Arc<[u8]>);

/// A node introduces itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Random number of the node's process: a different number means that the node was restarted.
    pub run: u64,
    /// The greatest epoch in which this node has promised to vote.
    pub promised: Epoch,
    /// Versions and files of the node.
    pub identity: Identity,
}

/// The answer to [`Hello`]: the node may vote in this epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Welcome {
    /// The epoch of the director.
    pub epoch: Epoch,
    /// `run` of the HELLO. A node ignores an answer to an earlier process.
    pub run: u64,
    /// Newest frame of the epoch so far. The node takes part only in later ones, so messages from before its start have no effect.
    pub newest: u64,
}

/// Everything that a node needs for the newest frame. The newest STATE alone is enough.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// The frame.
    pub id: FrameId,
    /// Time at which the frame is shown, TAI, ns; `None`: the director has no trusted clock.
    pub present_at: Option<i64>,
    /// The last COMMIT, repeated in case it was lost.
    pub commit: Option<Commit>,
    /// Inputs for drawing.
    pub cue: Cue,
}

/// A node has drawn a frame, and the device has finished. This is its vote for the frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ready {
    /// The frame.
    pub id: FrameId,
    /// Duration of drawing, ns.
    pub drawn_ns: u64,
    /// Whether the node can meet `present_at`.
    pub has_clock: bool,
    /// Results of drawing.
    pub report: Report,
}

/// The nodes in the mask show the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commit {
    /// The frame.
    pub id: FrameId,
    /// `present_at` of the STATE; `None`: the frame is shown on receipt, because a clock is not trusted.
    pub present_at: Option<i64>,
    /// The nodes that show it: those that take part and are READY.
    pub mask: Mask,
}

/// No node shows the frame; its picture may be overwritten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skip {
    /// The frame.
    pub id: FrameId,
    /// The reason.
    pub why: SkipReason,
}

/// Why a frame is not shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkipReason {
    /// The director has just started, and not all nodes take part yet.
    Starting,
    /// At most half of the configured nodes are READY.
    Quorum,
    /// At least one node was not READY at the deadline, and the policy is `together`.
    Deadline,
}

/// A node no longer takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Out {
    /// The epoch of the director.
    pub epoch: Epoch,
    /// The node that is left out. The message goes to all nodes.
    pub node: NodeId,
    /// The reason.
    pub why: OutReason,
}

/// Why a node does not take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutReason {
    /// It has said HELLO, but was not yet READY for enough consecutive frames.
    Joining,
    /// It was not READY [`crate::rules::Rules::misses_until_out`] times in a row.
    Misses,
    /// Its connection ended.
    Lost,
    /// The director does not know it and waits for its HELLO.
    Unknown,
}

/// A message from a director.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages have documentation")]
pub enum ToNode {
    Welcome(Welcome),
    Refused(Refusal),
    State(State),
    Commit(Commit),
    Skip(Skip),
    Out(Out),
}

/// A message from a node. All directors receive it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages have documentation")]
pub enum ToDirector {
    Hello(Hello),
    Ready(Ready),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_hold_every_node_and_no_other() {
        let all: Mask = (0..MAX_NODES).map(NodeId).collect();
        assert_eq!(all.len(), usize::from(MAX_NODES));
        let some: Mask = [0, 63, 64, 255, 256, u16::MAX].map(NodeId).into_iter().collect();
        assert_eq!(some.nodes().map(|node| node.0).collect::<Vec<_>>(), [0, 63, 64, 255]);
        assert!(!some.contains(NodeId(256)) && Mask::default().is_empty());
        assert_eq!(
            some.intersection(&[64, 65].map(NodeId).into_iter().collect()).nodes().collect::<Vec<_>>(),
            [NodeId(64)]
        );
    }

    #[test]
    fn every_difference_that_matters_is_refused() {
        let hash = Hash([7; 32]);
        let director =
            Identity { version: "1.0".to_owned(), catalogues: vec![("a".to_owned(), hash)], ..Identity::default() };
        assert_eq!(director.difference(&Identity { adapter: "other".to_owned(), ..director.clone() }), None);
        let differing = [
            Identity { version: "1.1".to_owned(), ..director.clone() },
            Identity { protocol: 9, ..director.clone() },
            Identity { configuration: hash, ..director.clone() },
            Identity { catalogues: Vec::new(), ..director.clone() },
            Identity { catalogues: vec![("a".to_owned(), Hash::default())], ..director.clone() },
            Identity { catalogues: vec![("a".to_owned(), hash), ("b".to_owned(), hash)], ..director.clone() },
        ];
        for node in differing {
            assert!(!director.difference(&node).unwrap().to_string().is_empty(), "{node:?}");
        }
    }

    #[test]
    fn a_cue_that_does_not_fit_is_refused() {
        assert!(Cue::new(&[0; Cue::MAX_BYTES]).is_ok());
        assert!(Cue::new(&[0; Cue::MAX_BYTES + 1]).unwrap_err().to_string().contains("3969"));
    }

    #[test]
    fn newer_frames_are_greater_over_epochs() {
        let id = |counter, run, number| FrameId { epoch: Epoch { counter, run }, number };
        let order = [id(1, 9, 5), id(1, 9, 6), id(1, 10, 1), id(2, 0, 1)];
        assert!(order.is_sorted() && Epoch::NONE < order[0].epoch);
    }
}
