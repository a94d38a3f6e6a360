//! Checks everything that nodes show and directors commit. It knows the true time and shares no code with the state machines.

use std::collections::{BTreeMap, HashMap, HashSet};

use steradian_lock::{Commit, Epoch, FrameId, NodeId, Rules};

use super::setup::MS;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Violation {
    ShownWithoutCommit,
    ShownOutsideMask,
    /// A picture was shown before the GPU had finished, or without any drawing.
    ShownUnfinished,
    /// A node went back to an older frame.
    ShownOutOfOrder,
    /// A picture was shown more than half a period away from its time of presentation.
    ShownAtAnotherTime,
    ReadyBeforeDrawn,
    /// A node voted in a lower epoch than before.
    VotedBack,
    CommitWithoutVotes,
    CommitWithoutQuorum,
    /// Two COMMITs of one frame differ.
    CommitChanged,
    /// Two frames have the same time of presentation.
    SlotShared,
    /// Two directors committed frames at the same time.
    EpochsInterleave,
    /// A node drew a state although it had heard a newer one.
    OldStateDrawn,
}

/// One committed frame.
#[derive(Clone, Debug)]
pub struct Committed {
    pub commit: Commit,
    pub sent_ns: u64,
    /// True time of presentation, or the time of sending if the frame is shown on receipt.
    pub slot_ns: i64,
    /// Nodes and true times at which it was shown.
    pub shows: Vec<(usize, u64)>,
}

#[derive(Debug)]
pub struct Checker {
    rules: Rules,
    tai_origin_ns: i64,
    /// Largest possible sum of clock errors.
    tolerance_ns: i64,
    pub committed: BTreeMap<FrameId, Committed>,
    votes: HashMap<(usize, FrameId), u64>,
    finished: HashSet<(usize, FrameId)>,
    newest_vote: HashMap<usize, FrameId>,
    newest_shown: HashMap<usize, FrameId>,
    newest_state: HashMap<usize, FrameId>,
    /// Whether times of presentation are compared; they are not while a director's clock is wrong.
    pub compares_slots: bool,
    pub found: BTreeMap<Violation, u64>,
}

impl Checker {
    pub fn new(rules: Rules, tai_origin_ns: i64, clock_error_ns: i64) -> Self {
        Self {
            rules,
            tai_origin_ns,
            tolerance_ns: 2 * clock_error_ns + MS as i64 / 10,
            committed: BTreeMap::new(),
            votes: HashMap::new(),
            finished: HashSet::new(),
            newest_vote: HashMap::new(),
            newest_shown: HashMap::new(),
            newest_state: HashMap::new(),
            compares_slots: true,
            found: BTreeMap::new(),
        }
    }

    fn report(&mut self, violation: Violation) {
        *self.found.entry(violation).or_default() += 1;
    }

    pub fn state_heard(&mut self, node: usize, id: FrameId) {
        let newest = self.newest_state.entry(node).or_insert(id);
        *newest = id.max(*newest);
    }

    pub fn draw_begins(&mut self, node: usize, id: FrameId) {
        if self.newest_state.get(&node).is_some_and(|&newest| newest > id) {
            self.report(Violation::OldStateDrawn);
        }
    }

    pub fn draw_ended(&mut self, node: usize, id: FrameId) {
        self.finished.insert((node, id));
    }

    pub fn voted(&mut self, node: usize, id: FrameId, now_ns: u64) {
        if !self.finished.contains(&(node, id)) {
            self.report(Violation::ReadyBeforeDrawn);
        }
        if self.newest_vote.insert(node, id).is_some_and(|newest| newest.epoch > id.epoch) {
            self.report(Violation::VotedBack);
        }
        self.votes.insert((node, id), now_ns);
    }

    pub fn committed(&mut self, commit: Commit, now_ns: u64) {
        if let Some(known) = self.committed.get(&commit.id) {
            if known.commit != commit {
                self.report(Violation::CommitChanged);
            }
            return;
        }
        if commit.mask.nodes().any(|NodeId(node)| !self.votes.contains_key(&(usize::from(node), commit.id))) {
            self.report(Violation::CommitWithoutVotes);
        }
        let voters = commit.mask.nodes().filter(|node| self.votes.contains_key(&(usize::from(node.0), commit.id)));
        if 2 * voters.count() <= usize::from(self.rules.nodes) {
            self.report(Violation::CommitWithoutQuorum);
        }
        let slot_ns = commit.present_at.map_or(now_ns as i64, |tai_ns| tai_ns - self.tai_origin_ns);
        self.committed.insert(commit.id, Committed { commit, sent_ns: now_ns, slot_ns, shows: Vec::new() });
    }

    pub fn shown(&mut self, node: usize, id: FrameId, now_ns: u64) {
        if !self.finished.contains(&(node, id)) {
            self.report(Violation::ShownUnfinished);
        }
        if self.newest_shown.insert(node, id).is_some_and(|newest| newest >= id) {
            self.report(Violation::ShownOutOfOrder);
        }
        let Some(known) = self.committed.get_mut(&id) else {
            self.report(Violation::ShownWithoutCommit);
            return;
        };
        known.shows.push((node, now_ns));
        let (is_meant, slot_ns, has_time) =
            (known.commit.mask.contains(NodeId(node as u16)), known.slot_ns, known.commit.present_at.is_some());
        if !is_meant {
            self.report(Violation::ShownOutsideMask);
        }
        let half_ns = self.rules.period_ns as i64 / 2;
        let is_wrong = if has_time {
            (now_ns as i64 - slot_ns).abs() > half_ns + self.tolerance_ns
        } else {
            let voted_ns = self.votes.get(&(node, id)).copied().unwrap_or(0);
            now_ns as i64 > voted_ns as i64 + 3 * half_ns + self.tolerance_ns
        };
        if is_wrong && self.compares_slots {
            self.report(Violation::ShownAtAnotherTime);
        }
    }

    /// Compares all committed frames with each other, once at the end.
    pub fn finish(&mut self) {
        if !self.compares_slots {
            return;
        }
        let half_ns = self.rules.period_ns as i64 / 2;
        let mut spans: BTreeMap<Epoch, (i64, i64)> = BTreeMap::new();
        let mut shared = 0;
        let mut last: Option<(FrameId, i64)> = None;
        for (id, known) in &self.committed {
            let span = spans.entry(id.epoch).or_insert((known.slot_ns, known.slot_ns));
            *span = (span.0.min(known.slot_ns), span.1.max(known.slot_ns));
            if known.commit.present_at.is_none() {
                continue;
            }
            let is_shared = |(before, slot_ns): (FrameId, i64)| {
                before.epoch == id.epoch && known.slot_ns < slot_ns + half_ns - self.tolerance_ns
            };
            shared += u64::from(last.is_some_and(is_shared));
            last = Some((*id, known.slot_ns));
        }
        let spans: Vec<(i64, i64)> = spans.into_values().collect();
        let interleaved = spans.windows(2).filter(|pair| pair[0].1 + half_ns > pair[1].0).count();
        for _ in 0..shared {
            self.report(Violation::SlotShared);
        }
        for _ in 0..interleaved {
            self.report(Violation::EpochsInterleave);
        }
    }

    /// Number of frames that nodes in the mask did not show.
    pub fn not_shown(&self) -> usize {
        self.committed.values().map(|known| known.commit.mask.len().saturating_sub(known.shows.len())).sum()
    }

    /// Greatest epoch with a committed frame.
    pub fn newest_epoch(&self) -> Option<Epoch> {
        self.committed.last_key_value().map(|(id, _)| id.epoch)
    }
}
