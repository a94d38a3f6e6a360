//! Figures of a measured cluster.

use std::collections::{BTreeMap, HashMap};

use crate::{
    events::{Events, FrameName, Shown, Verdict},
    processes::Life,
};

/// A frame is mixed if two nodes showed it at times that differ by at least this, ns.
const MIXED_NS: u64 = 5_000_000;
/// Time that a resumed process needs to show frames again, ns. A gap that begins before this is attributed to the stop of the process.
const AFTER_STOP_NS: u64 = 500_000_000;

/// Distribution of times, printed as median, 99 % quantile and maximum.
pub struct Spread {
    values: Vec<f64>,
}

impl Spread {
    /// Converts times from ns to ms.
    pub fn of_ns(values: impl IntoIterator<Item = u64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().map(|ns| ns as f64 * 1e-6).collect();
        values.sort_by(f64::total_cmp);
        Self { values }
    }

    fn share(&self, share: f64) -> Option<f64> {
        let last = self.values.len().checked_sub(1)?;
        self.values.get((share * last as f64).round() as usize).copied()
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.share(0.5), self.share(0.99), self.share(1.0)) {
            (Some(median), Some(p99), Some(most)) => write!(f, "{median:.1} / {p99:.1} / {most:.1}"),
            _ => write!(f, "none"),
        }
    }
}

/// Prints a row of a table.
pub fn row(name: &str, value: impl std::fmt::Display) {
    println!("| {name} | {value} |");
}

/// Gap between two successive frames that one process showed.
#[derive(Clone, Debug)]
pub struct Gap {
    pub node: String,
    pub from_ns: u64,
    pub until_ns: u64,
    /// Whether the process itself was stopped during the gap.
    pub is_own: bool,
}

impl Gap {
    pub fn ns(&self) -> u64 {
        self.until_ns - self.from_ns
    }
}

/// Returns the frames that each process has shown.
fn by_life(events: &Events) -> BTreeMap<usize, Vec<&Shown>> {
    let mut lives: BTreeMap<usize, Vec<&Shown>> = BTreeMap::new();
    for shown in &events.shown {
        lives.entry(shown.life).or_default().push(shown);
    }
    lives
}

/// Returns all gaps of all nodes.
pub fn gaps(events: &Events, lives: &[Life]) -> Vec<Gap> {
    let mut gaps = Vec::new();
    for (life, shown) in by_life(events) {
        for pair in shown.windows(2) {
            let (from_ns, until_ns) = (pair[0].at_ns, pair[1].at_ns);
            let is_stopped = |(stopped_ns, resumed_ns): &(u64, u64)| {
                from_ns < resumed_ns.saturating_add(AFTER_STOP_NS) && until_ns > *stopped_ns
            };
            let is_own = lives[life].stops.iter().any(is_stopped);
            gaps.push(Gap { node: pair[0].node.clone(), from_ns, until_ns, is_own });
        }
    }
    gaps
}

/// Returns the longest gap within a time after a fault, among the nodes that the fault did not hit.
pub fn longest_after(gaps: &[Gap], fault_ns: u64, within_ns: u64) -> Option<u64> {
    let meets = |gap: &&Gap| !gap.is_own && gap.until_ns > fault_ns && gap.from_ns < fault_ns + within_ns;
    gaps.iter().filter(meets).map(Gap::ns).max()
}

/// Prints the figures that are common to all runs. A frame that is shown later than `backlog_ns` after its COMMIT belongs to a backlog.
pub fn print(events: &Events, lives: &[Life], nodes: usize, backlog_ns: u64) {
    let mut skipped: BTreeMap<&str, usize> = BTreeMap::new();
    let mut without_verdict = 0_usize;
    for frame in events.frames.values() {
        match &frame.verdict {
            Some((Verdict::Skip(why), _)) => *skipped.entry(why).or_default() += 1,
            Some((Verdict::Commit(_), _)) => {}
            None => without_verdict += 1,
        }
    }
    let committed = events.committed();
    let skips: Vec<String> = skipped.iter().map(|(why, count)| format!("{count} {why}")).collect();
    row("requested frames", events.frames.len());
    row("committed", committed.len());
    row("skipped", if skips.is_empty() { "0".to_owned() } else { skips.join(", ") });
    row("without a verdict in the log (director killed)", without_verdict);

    // Times of the frame.
    let all_ready = committed.iter().filter_map(|(_, frame, ..)| {
        let last_ns = frame.ready.iter().map(|(_, at_ns, _)| *at_ns).max()?;
        (frame.ready.len() == nodes).then(|| last_ns.saturating_sub(frame.state_ns.unwrap_or(last_ns)))
    });
    row("STATE to READY of all nodes, ms", Spread::of_ns(all_ready));
    let to_commit = committed.iter().filter_map(|(_, frame, _, at_ns)| Some(at_ns.saturating_sub(frame.state_ns?)));
    row("STATE to COMMIT, ms", Spread::of_ns(to_commit));
    let drawn = committed.iter().flat_map(|(_, frame, ..)| frame.ready.iter().map(|(.., drawn_ns)| *drawn_ns));
    row("drawing, ms", Spread::of_ns(drawn));

    // Differences between nodes.
    let mut shown_at: HashMap<FrameName, Vec<u64>> = HashMap::new();
    for shown in &events.shown {
        shown_at.entry(shown.frame).or_default().push(shown.at_ns);
    }
    let skew = |times: &Vec<u64>| {
        let (first, last) = (times.iter().min()?, times.iter().max()?);
        (times.len() > 1).then(|| last - first)
    };
    let skews: Vec<u64> = shown_at.values().filter_map(skew).collect();
    let mixed = skews.iter().filter(|ns| **ns >= MIXED_NS).count();
    row("skew of a frame between nodes, ms", Spread::of_ns(skews.iter().copied()));
    row("frames with a skew of 5 ms or more", format!("{mixed} of {}", skews.len()));
    let meant: usize = committed.iter().map(|(_, _, nodes, _)| *nodes).sum();
    let of_committed: usize = committed.iter().map(|(name, ..)| shown_at.get(name).map_or(0, Vec::len)).sum();
    row("committed pictures that were shown", format!("{of_committed} of {meant}"));

    // Counts that must be 0.
    let verdicts: HashMap<FrameName, u64> = committed.iter().map(|(name, _, _, at_ns)| (*name, *at_ns)).collect();
    let without_commit = shown_at.keys().filter(|name| !verdicts.contains_key(name)).count();
    row("frames shown without COMMIT in the log", without_commit);
    let behind: Vec<u64> = events
        .shown
        .iter()
        .filter_map(|shown| Some(shown.at_ns.saturating_sub(*verdicts.get(&shown.frame)?)))
        .collect();
    let backlog = behind.iter().filter(|ns| **ns > backlog_ns).count();
    row("COMMIT to shown, ms", Spread::of_ns(behind));
    row(&format!("shown more than {:.1} ms after COMMIT (backlog)", backlog_ns as f64 * 1e-6), backlog);
    let backwards: usize = by_life(events)
        .values()
        .map(|shown| shown.windows(2).filter(|pair| pair[1].frame <= pair[0].frame).count())
        .sum();
    row("shown in the wrong order", backwards);
    row("frames shown after one of a later epoch", alternations(&events.shown));

    let gaps = gaps(events, lives);
    let mut longest: BTreeMap<&str, u64> = BTreeMap::new();
    for gap in gaps.iter().filter(|gap| !gap.is_own) {
        let most = longest.entry(&gap.node).or_default();
        *most = (*most).max(gap.ns());
    }
    let longest: Vec<String> = longest.iter().map(|(node, ns)| format!("{node} {:.1}", *ns as f64 * 1e-6)).collect();
    row("intervals between shown frames, ms", Spread::of_ns(gaps.iter().filter(|gap| !gap.is_own).map(Gap::ns)));
    row("longest gap of each node, ms", longest.join(", "));
}

/// Counts the frames that a node showed after another node had shown a frame of a higher epoch.
pub fn alternations(shown: &[Shown]) -> usize {
    let mut sorted: Vec<&Shown> = shown.iter().collect();
    sorted.sort_by_key(|shown| shown.at_ns);
    let mut highest = (0, 0);
    let mut count = 0;
    for shown in sorted {
        count += usize::from(shown.frame.epoch < highest);
        highest = highest.max(shown.frame.epoch);
    }
    count
}

/// Returns the number of frames that each epoch has committed and shown.
pub fn epochs(events: &Events) -> Vec<((u64, u64), usize, usize)> {
    let mut epochs: BTreeMap<(u64, u64), (usize, usize)> = BTreeMap::new();
    events.committed().iter().for_each(|(name, ..)| epochs.entry(name.epoch).or_default().0 += 1);
    events.shown.iter().for_each(|shown| epochs.entry(shown.frame.epoch).or_default().1 += 1);
    epochs.into_iter().map(|(epoch, (committed, shown))| (epoch, committed, shown)).collect()
}
