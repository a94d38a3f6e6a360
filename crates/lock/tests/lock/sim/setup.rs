//! Parts of a simulated cluster, and the faults that are injected into it.

use steradian_lock::Rules;

use super::delays::Quantiles;

pub const MS: u64 = 1_000_000;
pub const SECOND: u64 = 1_000 * MS;

/// Treatment of a lost message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnLoss {
    /// It never arrives.
    Gone,
    /// As in TCP, it is sent again when a later one has arrived, or after this time, which doubles at each attempt. All later messages of the
    /// connection wait for it. Such connections keep the order and deliver nothing twice.
    Again { timeout_ns: u64 },
}

#[derive(Clone, Debug)]
pub struct Network {
    pub delay: Quantiles,
    /// Time between the copies of one message to two nodes: the director sends them one after the other.
    pub per_node_ns: u64,
    pub loss: f64,
    pub on_loss: OnLoss,
    pub duplicates: f64,
    /// Whether messages of a connection keep their order.
    pub in_order: bool,
    /// Share of the messages sent during a cut that still arrive after the connection is restored.
    pub kept_by_cut: f64,
}

/// A deliberate mistake that the checker must find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mutation {
    /// Nodes show a picture as soon as it is drawn.
    CommitIgnored,
    /// Nodes never show anything.
    NothingShown,
    /// Nodes report READY when drawing begins.
    ReadyTooEarly,
    /// Nodes show frames even if the COMMIT does not name them.
    MaskIgnored,
    /// Nodes act after each message instead of draining their queue.
    Backlog,
    /// Nodes vote for two directors at once.
    TwoPromises,
    /// Directors count votes for all nodes that they do not reach.
    NoQuorum,
}

#[derive(Clone, Debug)]
pub struct Setup {
    pub rules: Rules,
    pub seed: u64,
    pub network: Network,
    /// Duration of drawing.
    pub draw: Quantiles,
    /// Delay after which a timer wakes a process.
    pub timer: Quantiles,
    /// Time for which a woken process waits for a processor.
    pub stall: Option<Quantiles>,
    /// Largest error of a disciplined clock, ns.
    pub clock_error_ns: i64,
    /// Time after which the other side notices that a process has ended, and that a connection is cut.
    pub noticed_ns: u64,
    pub lease_ns: u64,
    pub mutation: Option<Mutation>,
}

/// Faults and repairs, injected at a given time.
#[derive(Clone, Debug)]
pub enum Fault {
    /// The process ends and starts again after this time.
    KillNode(usize, u64),
    HangNode(usize, u64),
    /// Without a time the director does not start again.
    KillDirector(usize, Option<u64>),
    HangDirector(usize, u64),
    StartDirector(usize),
    /// Cuts the connections between a director and nodes.
    Cut(usize, Vec<usize>),
    Heal(usize, Vec<usize>),
    StepNodeClock(usize, i64),
    StepDirectorClock(usize, i64),
    /// Whether the clock of a node is disciplined.
    Discipline(usize, bool),
}
