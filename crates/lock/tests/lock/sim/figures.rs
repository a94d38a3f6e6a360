//! Figures of one simulated cluster: frame rate, drops, skew, gaps, recovery.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use steradian_lock::Rules;

use super::{
    delays::{Quantiles, quantile},
    setup::{Fault, MS, Network, OnLoss, SECOND, Setup},
    world::World,
};

/// Time by which each additional node delays the moment at which all are READY, ns. Measured on two cores with six node processes: (2.0 - 0.46) ms /
/// 24.
pub const MEASURED_PER_NODE_NS: u64 = 64_000;
/// Time until the other side notices that a process was killed, and time until the process starts again, ns.
const NOTICED_NS: u64 = 17 * MS;
const RESTART_NS: u64 = 500 * MS;
/// Time for which a killed director is absent, ns.
const DIRECTOR_ABSENT_NS: u64 = 200 * MS;

/// Load of the processors, with measured times until all of six nodes are READY, ms: median, 99 %, maximum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// Measured: 0.46, 0.70, 1.9.
    Idle,
    /// One busy core of two. Measured: 99 %. The maximum is assumed to be twice that.
    One,
    /// Two busy cores. Measured: 99 % and maximum.
    Two,
    /// Two busy cores, and the network's threads under SCHED_RR. Measured: 99 %.
    RealTime,
}

impl Load {
    pub fn all_ready_ms(self) -> [f64; 3] {
        match self {
            Self::Idle => [0.46, 0.70, 1.9],
            Self::One => [0.46, 9.4, 18.8],
            Self::Two => [0.46, 28.0, 218.0],
            Self::RealTime => [0.46, 0.9, 1.9],
        }
    }
}

/// A cluster with measured delays.
#[derive(Clone, Copy, Debug)]
pub struct Cluster {
    pub rules: Rules,
    pub seed: u64,
    pub load: Load,
    pub per_node_ns: u64,
    /// Probability that one message is lost, and time after which TCP sends it again.
    pub loss: f64,
    pub timeout_ns: u64,
    /// Mean duration of drawing, ms; it varies by a fifth.
    pub draw_ms: f64,
    pub clock_error_ns: i64,
    pub seconds: u64,
    pub kills: u64,
}

impl Cluster {
    fn setup(&self) -> Setup {
        // The measured times include the copies of a message to six nodes.
        let of_copies_ms = 6.0 * MEASURED_PER_NODE_NS as f64 / 1e6;
        let idle = Load::Idle.all_ready_ms();
        let delay = Quantiles::of_all_ready_ms(idle.map(|ms| ms - of_copies_ms));
        let stall = (self.load != Load::Idle).then(|| Quantiles::of_stalls_ms(self.load.all_ready_ms(), idle));
        Setup {
            rules: self.rules,
            seed: self.seed,
            network: Network {
                delay: delay.clone(),
                per_node_ns: self.per_node_ns,
                loss: self.loss,
                on_loss: OnLoss::Again { timeout_ns: self.timeout_ns },
                duplicates: 0.0,
                in_order: true,
                kept_by_cut: 0.0,
            },
            draw: Quantiles::uniform_ms(self.draw_ms * 0.8, self.draw_ms * 1.2),
            timer: delay,
            stall,
            clock_error_ns: self.clock_error_ns,
            noticed_ns: NOTICED_NS,
            lease_ns: SECOND,
            mutation: None,
        }
    }

    /// Simulates the cluster twice: nodes are killed in the first run, the director in the second one.
    pub fn figures(&self) -> Figures {
        let end_ns = self.seconds * SECOND;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut world = World::new(self.setup());
        // Nodes of the first third are killed; gaps are measured on the others.
        let killed = (world.nodes.len() / 3).max(1);
        for kill in 0..self.kills {
            let slot_ns = end_ns.saturating_sub(3 * SECOND) / self.kills;
            let at_ns = SECOND + kill * slot_ns + random.random_range(0..slot_ns.max(1));
            world.at(at_ns, Fault::KillNode(random.random_range(0..killed), RESTART_NS));
        }
        world.finish(end_ns);
        let mut second = World::new(self.setup());
        for kill in 0..self.kills.min(5) {
            let at_ns = 2 * SECOND + kill * 2 * SECOND + random.random_range(0..SECOND);
            second.at(at_ns, Fault::KillDirector(0, Some(DIRECTOR_ABSENT_NS)));
        }
        second.finish(2 * SECOND + self.kills.min(5) * 2 * SECOND);
        Figures::new(&mut world, &second, self.rules.period_ns, end_ns)
    }
}

/// Figures of the nodes that are never killed. Times are in ns.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    pub nodes: usize,
    /// Pictures per second of a node, from the first one on.
    pub frames_per_s: f64,
    /// Share of the frames of the director that a node did not show.
    pub dropped: f64,
    /// The part of this share that was skipped for all nodes.
    pub skipped: f64,
    /// Difference between the first and the last node that shows a frame: median, 99 %, maximum.
    pub skew_ns: [u64; 3],
    /// Time from STATE to COMMIT if all nodes were READY, including drawing: median, 99 %, maximum.
    pub all_ready_ns: [u64; 3],
    pub longest_gap_ns: u64,
    /// Time from the restart of a killed node to its first picture: median and maximum.
    pub recovery_ns: [u64; 2],
    /// Longest gap when the director is killed and starts again.
    pub director_gap_ns: u64,
    /// Number of times that a node was left out without being killed.
    pub left_out: u64,
    /// Number of violations that the checker has found.
    pub violations: u64,
}

fn longest_gap_ns(world: &World) -> u64 {
    let unharmed = world.nodes.iter().filter(|node| !node.was_harmed);
    unharmed.flat_map(|node| node.shows.windows(2).map(|pair| pair[1] - pair[0])).max().unwrap_or(0)
}

impl Figures {
    fn new(world: &mut World, second: &World, period_ns: u64, end_ns: u64) -> Self {
        let unharmed: Vec<_> = world.nodes.iter().filter(|node| !node.was_harmed).collect();
        let first_ns = unharmed.iter().filter_map(|node| node.shows.first()).min().copied().unwrap_or(end_ns);
        let expected = (end_ns - first_ns) as f64 / period_ns as f64;
        let shown: usize = unharmed.iter().map(|node| node.shows.len()).sum();
        let per_node = shown as f64 / unharmed.len().max(1) as f64;
        let mut skews: Vec<u64> = Vec::new();
        for known in world.checker.committed.values() {
            let times = known.shows.iter().map(|&(_, at_ns)| at_ns);
            skews.extend(times.clone().max().zip(times.min()).map(|(last, first)| last - first));
        }
        let committed = world.checker.committed.values().filter(|known| known.slot_ns >= first_ns as i64).count();
        let kills = world.nodes.iter().filter(|node| node.was_harmed).count();
        let counts = world.director(0).map(steradian_lock::Director::counts).unwrap_or_default();
        let three = |values: &mut Vec<u64>| [quantile(values, 0.5), quantile(values, 0.99), quantile(values, 1.0)];
        Self {
            nodes: world.nodes.len(),
            frames_per_s: per_node * 1e9 / (end_ns - first_ns).max(1) as f64,
            dropped: (1.0 - per_node / expected).max(0.0),
            skipped: (1.0 - committed as f64 / expected).max(0.0),
            skew_ns: three(&mut skews),
            all_ready_ns: three(&mut world.all_ready_ns),
            longest_gap_ns: longest_gap_ns(world),
            recovery_ns: [quantile(&mut world.recoveries_ns, 0.5), quantile(&mut world.recoveries_ns, 1.0)],
            director_gap_ns: longest_gap_ns(second),
            left_out: counts.out.saturating_sub(kills as u64),
            violations: world.checker.found.values().chain(second.checker.found.values()).sum(),
        }
    }
}
