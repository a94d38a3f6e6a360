//! The director: gathers the nodes, paces the frames, and decides for each frame whether it is shown, and by which nodes.
//!
//! | phase | entered when | behaviour |
//! |---|---|---|
//! | gathering | created | notes each HELLO; sends nothing but REFUSED |
//! | starting | all nodes have said HELLO, or more than half after `gather_ns` | has an epoch, sends WELCOME; sends STATE at every tick, skips every frame |
//! | running | all known nodes take part, or more than half after `start_ns` | STATE at every tick, then COMMIT or SKIP |
//! | deposed | a message has a higher epoch | nothing; the caller ends it |
//!
//! | place of a node | left when |
//! |---|---|
//! | absent | HELLO: to *out*, or to *refused* if its version or files differ |
//! | out | READY for three frames in a row: to *in*, from the next frame on |
//! | in | no READY for `misses_until_out` frames in a row: to *out* |
//! | any | connection lost: to *absent* |
//!
//! # Why two directors cannot both commit
//!
//! Claim: if frame f of epoch d and frame g of a later epoch e are both committed, f is presented at least two periods before g, whatever else the
//! directors do, whichever messages are lost, delayed, repeated or reordered, and whichever processes hang or restart. So the times of presentation
//! put all frames in one order, and no two directors advance at the same time.
//!
//! 1. A node votes (READY) only in the epoch that it has promised, and it promises only higher epochs than that one. It remembers the promise on disk
//!    before it votes.
//! 2. A COMMIT needs votes of more than half of the configured nodes, so some node n voted for both, for f before g.
//! 3. The director of e counts n only when it is *in*, after READY for three earlier frames of e. Let r be the first of them. STATE(f) was sent
//!    before n's vote for f, thus before n's vote for r, which counts only within a period of the tick of r: tick(f) < tick(r) + period.
//! 4. tick(g) ≥ tick(r) + 3 periods, so tick(f) < tick(g) - 2 periods.
//! 5. `present_at` is the tick plus a constant, which is equal for both because directors refuse nodes with another configuration. ∎
//!
//! Without a trusted clock, a node shows f on receipt, at most one period after its vote. The vote was counted within a period of the tick. Therefore
//! f is shown before tick(f) + 2 periods < tick(g), and g is committed after tick(g). The clocks of both directors differ by at most twice the error
//! of a disciplined clock, which the two periods cover.
//!
//! Before a director sends any message of its epoch, it raises the epoch above those of more than half of the nodes. So a director that does not have
//! more than half of the nodes never disturbs another one. Which process starts a director, and when, is decided outside of this crate.

use std::collections::VecDeque;

use crate::{
    clock::{Clock, Now},
    messages::{
        Commit, Cue, Epoch, FrameId, Hello, Identity, Mask, NodeId, Out, OutReason, Ready, Refusal, Skip, SkipReason,
        State, ToDirector, ToNode, Welcome,
    },
    rules::{Policy, READY_UNTIL_IN, Rules},
};

/// Number of times that a COMMIT is sent again within its lead.
const COPIES: u64 = 2;
/// Interval of the copies of a COMMIT without a time of presentation, ns. Nodes show it on receipt, so a copy repairs a loss only if it arrives soon.
/// On TCP, a copy reveals the loss of the first one. A node does not show a frame whose copy arrives more than a period after its READY.
const COPY_ON_RECEIPT_NS: u64 = 1_000_000;
/// Number of times that a STATE is sent again before its deadline, to nodes whose READY has not arrived. A node that is READY answers again, so a
/// copy repairs the loss of a STATE or of a READY. On TCP, the acknowledgement of the second copy reveals the loss of the first one long before its
/// time-out.
const STATE_COPIES: u64 = 2;

/// Actions for the caller, to be carried out in this order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send to one node.
    Send {
        /// The receiver. A refused receiver need not be a configured node.
        to: NodeId,
        /// Any message except COMMIT and SKIP.
        message: ToNode,
    },
    /// Send to all nodes.
    SendAll(ToNode),
    /// Compose the cue of a frame and pass it to [`Director::composed`].
    Compose {
        /// The frame.
        id: FrameId,
        /// Time at which it will be shown, TAI, ns.
        present_at: Option<i64>,
        /// Monotonic time of the deadline, ns; a cue that is ready later is not sent.
        until_ns: u64,
    },
    /// Another director has a higher epoch. This one no longer sends anything.
    Deposed {
        /// The higher epoch.
        by: Epoch,
    },
}

/// Phase of a director: see the first table at the top of the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waits for the HELLO of the nodes, without an epoch.
    Gathering,
    /// Skips every frame until the nodes are READY.
    Starting,
    /// Commits frames.
    Running,
    /// Has met a higher epoch, and ends.
    Deposed,
}

/// Place of a node: see the second table at the top of the module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// Has not said HELLO, or has lost its connection.
    Absent,
    /// Has other files or another version.
    Refused(Refusal),
    /// Receives every STATE, but takes no part in COMMITs.
    Out {
        /// The reason.
        why: OutReason,
        /// Number of consecutive frames with READY.
        ready: u8,
    },
    /// Takes part in COMMITs.
    In {
        /// Number of consecutive frames without READY.
        misses: u8,
    },
}

/// Counters since the start of the director.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that were committed.
    pub committed: u64,
    /// Commits without a time of presentation, because a clock is not trusted.
    pub committed_on_receipt: u64,
    /// Frames that were skipped for the reason [`SkipReason::Starting`].
    pub skipped_starting: u64,
    /// Frames that were skipped for the reason [`SkipReason::Quorum`].
    pub skipped_quorum: u64,
    /// Frames that were skipped for the reason [`SkipReason::Deadline`].
    pub skipped_deadline: u64,
    /// Frames without a cue at the deadline.
    pub not_composed: u64,
    /// Ticks at which nothing happened, because the director's process was late by a period or more.
    pub ticks_lost: u64,
    /// READY messages for a frame that is no longer open, or of a lower epoch.
    pub ready_late: u64,
    /// HELLO messages that were answered with REFUSED.
    pub refused: u64,
    /// Number of times that a node was left out.
    pub out: u64,
    /// Number of times that a node began to take part.
    pub taken_in: u64,
}

#[derive(Clone, Debug)]
struct Member {
    run: u64,
    promised: Epoch,
    place: Place,
}

/// The frame of the current period.
#[derive(Clone, Debug)]
struct Open {
    id: FrameId,
    tick_ns: u64,
    present_at: Option<i64>,
    /// `None`: not composed yet.
    state: Option<State>,
    state_copies: u64,
    has_verdict: bool,
    ready: Mask,
    /// Those of the nodes in `ready` that have no trusted clock.
    without_clock: Mask,
}

/// State machine of a director. See the top of the module.
#[derive(Clone, Debug)]
pub struct Director {
    rules: Rules,
    run: u64,
    identity: Identity,
    clock: Clock,
    epoch: Epoch,
    phase: Phase,
    /// Time at which the phase began, ns.
    since_ns: Option<u64>,
    members: Vec<Member>,
    open: Option<Open>,
    last_commit: Option<Commit>,
    /// Times at which a COMMIT is sent again.
    copies: VecDeque<(u64, Commit)>,
    actions: Vec<Action>,
    counts: Counts,
}

impl Director {
    /// Creates a director that gathers its nodes. `run` is a random number of this process; `identity` is the identity that its nodes must share.
    pub fn new(rules: Rules, run: u64, identity: Identity) -> Self {
        let absent = Member { run: 0, promised: Epoch::NONE, place: Place::Absent };
        Self {
            rules,
            run,
            identity,
            clock: Clock::default(),
            epoch: Epoch::NONE,
            phase: Phase::Gathering,
            since_ns: None,
            members: vec![absent; usize::from(rules.nodes)],
            open: None,
            last_commit: None,
            copies: VecDeque::new(),
            actions: Vec::new(),
            counts: Counts::default(),
        }
    }

    /// [`Epoch::NONE`] while gathering.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The director's current phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Place of a node; `None` if the configuration has no such node.
    pub fn place(&self, node: NodeId) -> Option<&Place> {
        self.members.get(usize::from(node.0)).map(|member| &member.place)
    }

    /// Counters since the start of the director.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Number of times that this machine's clock was set.
    pub fn clock_steps(&self) -> u64 {
        self.clock.steps
    }

    /// The nodes that take part.
    pub fn taking_part(&self) -> Mask {
        self.ids().filter(|&node| matches!(self.place(node), Some(Place::In { .. }))).collect()
    }

    /// Whether all configured nodes show frames at common times: the state that operators see as a green light.
    pub fn is_locked(&self) -> bool {
        let all = self.taking_part().len() == self.members.len();
        all && self.phase == Phase::Running && self.last_commit.is_some_and(|commit| commit.present_at.is_some())
    }

    fn ids(&self) -> impl Iterator<Item = NodeId> + use<> {
        (0..self.rules.nodes).map(NodeId)
    }

    /// Processes a message. `from` is the node that the network layer has authenticated.
    pub fn hear(&mut self, now: Now, from: NodeId, message: ToDirector) {
        self.clock.observe(now);
        if self.phase == Phase::Deposed {
            return;
        }
        match message {
            ToDirector::Hello(hello) => self.hear_hello(from, hello),
            ToDirector::Ready(ready) => self.hear_ready(now, from, &ready),
        }
    }

    fn send(&mut self, to: NodeId, message: ToNode) {
        self.actions.push(Action::Send { to, message });
    }

    fn hear_hello(&mut self, from: NodeId, hello: Hello) {
        let refusal = self.identity.difference(&hello.identity);
        let is_gathering = self.phase == Phase::Gathering;
        let Some(member) = self.members.get_mut(usize::from(from.0)) else {
            self.counts.refused += 1;
            self.send(from, ToNode::Refused(Refusal::UnknownNode(from)));
            return;
        };
        if let Some(refusal) = refusal {
            member.place = Place::Refused(refusal.clone());
            self.counts.refused += 1;
            self.send(from, ToNode::Refused(refusal));
            return;
        }
        member.promised = member.promised.max(hello.promised);
        if !is_gathering && hello.promised > self.epoch {
            self.depose(hello.promised);
            return;
        }
        // A repeated HELLO of the same process changes nothing.
        let is_known = member.run == hello.run && matches!(member.place, Place::Out { .. } | Place::In { .. });
        member.run = hello.run;
        if !is_known {
            member.place = Place::Out { why: OutReason::Joining, ready: 0 };
        }
        if !is_gathering {
            self.welcome(from);
        }
    }

    fn welcome(&mut self, node: NodeId) {
        let run = self.members[usize::from(node.0)].run;
        let newest = self.open.as_ref().map_or(0, |open| open.id.number);
        self.send(node, ToNode::Welcome(Welcome { epoch: self.epoch, run, newest }));
    }

    fn hear_ready(&mut self, now: Now, from: NodeId, ready: &Ready) {
        if self.phase == Phase::Gathering {
            return;
        }
        if ready.id.epoch > self.epoch {
            self.depose(ready.id.epoch);
            return;
        }
        match self.place(from) {
            None | Some(Place::Refused(_)) => return,
            Some(Place::Absent) => {
                let out = Out { epoch: self.epoch, node: from, why: OutReason::Unknown };
                self.send(from, ToNode::Out(out));
                return;
            }
            Some(Place::Out { .. } | Place::In { .. }) => {}
        }
        let Rules { period_ns, deadline_ns, .. } = self.rules;
        match &mut self.open {
            // A READY that is read after the deadline counts only if the verdict has not been given. Otherwise a node that is always a little late
            // would never be left out.
            Some(open)
                if open.id == ready.id
                    && open.state.is_some()
                    && now.monotonic_ns <= open.tick_ns + if open.has_verdict { deadline_ns } else { period_ns } =>
            {
                open.ready.insert(from);
                if !ready.has_clock {
                    open.without_clock.insert(from);
                }
            }
            _ => self.counts.ready_late += 1,
        }
    }

    /// Reports that the connection of a node has ended.
    pub fn lost(&mut self, now: Now, node: NodeId) {
        self.clock.observe(now);
        let Some(member) = self.members.get_mut(usize::from(node.0)) else { return };
        let was_in = matches!(member.place, Place::In { .. });
        member.place = Place::Absent;
        if was_in && self.phase != Phase::Deposed {
            self.leave_out(node, OutReason::Lost);
        }
    }

    /// Leaves a node out: counts it and notifies all nodes.
    fn leave_out(&mut self, node: NodeId, why: OutReason) {
        self.counts.out += 1;
        self.actions.push(Action::SendAll(ToNode::Out(Out { epoch: self.epoch, node, why })));
    }

    fn depose(&mut self, by: Epoch) {
        self.phase = Phase::Deposed;
        self.open = None;
        self.copies.clear();
        self.actions = vec![Action::Deposed { by }];
    }

    /// Receives the cue that [`Action::Compose`] requested. The cue is ignored if it belongs to another frame or comes after the deadline.
    pub fn composed(&mut self, now: Now, id: FrameId, cue: Cue) {
        self.clock.observe(now);
        let commit = self.last_commit;
        let Some(open) = self.open.as_mut().filter(|open| open.id == id && open.state.is_none()) else { return };
        if now.monotonic_ns > open.tick_ns + self.rules.deadline_ns {
            return;
        }
        let state = State { id, present_at: open.present_at, commit, cue };
        open.state = Some(state.clone());
        self.actions.push(Action::SendAll(ToNode::State(state)));
    }

    /// Runs the due steps and returns the actions for the caller. Call it after [`Self::hear`], [`Self::lost`] and [`Self::composed`], and at
    /// [`Self::wake_at`].
    pub fn act(&mut self, now: Now) -> Vec<Action> {
        self.clock.observe(now);
        let since_ns = *self.since_ns.get_or_insert(now.monotonic_ns);
        match self.phase {
            Phase::Gathering => self.try_start(now, since_ns),
            Phase::Starting | Phase::Running => {
                self.judge(now);
                self.repeat_commits(now);
                self.repeat_state(now);
                if let Some(open) = self.open.take_if(|open| now.monotonic_ns >= open.tick_ns + self.rules.period_ns) {
                    self.close(now, &open);
                    self.open_next(now, &open);
                }
            }
            Phase::Deposed => {}
        }
        std::mem::take(&mut self.actions)
    }

    /// Monotonic time at which [`Self::act`] must next be called, ns; `None`: call it only after a message.
    pub fn wake_at(&self) -> Option<u64> {
        match self.phase {
            Phase::Gathering => self.since_ns.map(|since_ns| since_ns + self.rules.gather_ns),
            Phase::Deposed => None,
            Phase::Starting | Phase::Running => {
                let open = self.open.as_ref()?;
                let after_tick_ns = if open.has_verdict { self.rules.period_ns } else { self.rules.deadline_ns };
                let copies = self.copies.front().map(|(at_ns, _)| *at_ns).into_iter().chain(self.copy_due_ns(open));
                Some(copies.fold(open.tick_ns + after_tick_ns, u64::min))
            }
        }
    }

    /// Takes an epoch if enough nodes have said HELLO.
    fn try_start(&mut self, now: Now, since_ns: u64) {
        let known: Vec<NodeId> =
            self.ids().filter(|&node| matches!(self.place(node), Some(Place::Out { .. }))).collect();
        let is_late = now.monotonic_ns >= since_ns + self.rules.gather_ns;
        if known.len() < self.members.len() && !(is_late && self.rules.is_quorum(known.len())) {
            return;
        }
        let counter = self.members.iter().map(|member| member.promised.counter).max().unwrap_or(0) + 1;
        self.epoch = Epoch { counter, run: self.run };
        self.phase = Phase::Starting;
        self.since_ns = Some(now.monotonic_ns);
        for node in known {
            self.welcome(node);
        }
        self.open_frame(1, now.monotonic_ns);
    }

    fn open_frame(&mut self, number: u64, tick_ns: u64) {
        let id = FrameId { epoch: self.epoch, number };
        let present_at = self.clock.tai_ns(tick_ns + self.rules.ahead_ns());
        self.open = Some(Open {
            id,
            tick_ns,
            present_at,
            state: None,
            state_copies: 0,
            has_verdict: false,
            ready: Mask::default(),
            without_clock: Mask::default(),
        });
        self.actions.push(Action::Compose { id, present_at, until_ns: tick_ns + self.rules.deadline_ns });
    }

    /// Gives the verdict of the open frame: at once if all nodes that take part are READY, else at the deadline.
    fn judge(&mut self, now: Now) {
        let Some(open) = self.open.as_ref().filter(|open| !open.has_verdict) else { return };
        let taking_part = self.taking_part();
        let (id, is_due) = (open.id, now.monotonic_ns >= open.tick_ns + self.rules.deadline_ns);
        let is_over = now.monotonic_ns > open.tick_ns + self.rules.period_ns;
        let mask = taking_part.intersection(&open.ready);
        let all_ready = mask.len() == taking_part.len() && self.rules.is_quorum(mask.len());
        let is_starting = self.phase == Phase::Starting;
        if !is_due && (is_starting || !all_ready) {
            return;
        }
        let has_clock = mask.intersection(&open.without_clock).is_empty();
        let (has_state, present_at) = (open.state.is_some(), open.present_at.filter(|_| has_clock));
        if let Some(open) = &mut self.open {
            open.has_verdict = true;
        }
        if !has_state {
            self.counts.not_composed += 1;
            return;
        }
        let why = if is_starting {
            SkipReason::Starting
        } else if !self.rules.is_quorum(mask.len()) {
            SkipReason::Quorum
        } else if is_over || !(all_ready || self.rules.policy == Policy::Apart) {
            SkipReason::Deadline
        } else {
            self.commit(now, Commit { id, present_at, mask });
            return;
        };
        match why {
            SkipReason::Starting => self.counts.skipped_starting += 1,
            SkipReason::Quorum => self.counts.skipped_quorum += 1,
            SkipReason::Deadline => self.counts.skipped_deadline += 1,
        }
        self.actions.push(Action::SendAll(ToNode::Skip(Skip { id, why })));
    }

    fn commit(&mut self, now: Now, commit: Commit) {
        self.counts.committed += 1;
        self.last_commit = Some(commit);
        self.actions.push(Action::SendAll(ToNode::Commit(commit)));
        let interval_ns = if commit.present_at.is_some() {
            self.rules.lead_ns / (COPIES + 1)
        } else {
            self.counts.committed_on_receipt += 1;
            COPY_ON_RECEIPT_NS
        };
        let copies = (1..=COPIES).map(|copy| (now.monotonic_ns + interval_ns * copy, commit));
        self.copies.extend(copies);
        self.copies.make_contiguous().sort_by_key(|(at_ns, _)| *at_ns);
    }

    fn repeat_commits(&mut self, now: Now) {
        while let Some((_, commit)) = self.copies.pop_front_if(|(at_ns, _)| *at_ns <= now.monotonic_ns) {
            self.actions.push(Action::SendAll(ToNode::Commit(commit)));
        }
    }

    /// Time at which the next copy of a STATE is due.
    fn copy_due_ns(&self, open: &Open) -> Option<u64> {
        let has_copy = open.state.is_some() && !open.has_verdict && open.state_copies < STATE_COPIES;
        has_copy.then(|| open.tick_ns + self.rules.deadline_ns * (open.state_copies + 1) / (STATE_COPIES + 1))
    }

    fn repeat_state(&mut self, now: Now) {
        let Some(open) = &self.open else { return };
        if self.copy_due_ns(open).is_none_or(|due_ns| now.monotonic_ns < due_ns) {
            return;
        }
        let Some(state) = open.state.clone() else { return };
        let is_late = |node: &NodeId| {
            let takes_part = matches!(self.place(*node), Some(Place::In { .. } | Place::Out { .. }));
            takes_part && !open.ready.contains(*node)
        };
        let late: Vec<NodeId> = self.ids().filter(is_late).collect();
        for node in late {
            self.send(node, ToNode::State(state.clone()));
        }
        if let Some(open) = &mut self.open {
            open.state_copies += 1;
        }
    }

    /// Counts for each node whether it was READY for the frame that ends, and decides which nodes take part.
    fn close(&mut self, now: Now, open: &Open) {
        if open.state.is_none() {
            return;
        }
        for node in self.ids() {
            let member = &mut self.members[usize::from(node.0)];
            let is_ready = open.ready.contains(node);
            match &mut member.place {
                Place::In { misses } if is_ready => *misses = 0,
                Place::In { misses } => {
                    *misses += 1;
                    if *misses >= self.rules.misses_until_out {
                        member.place = Place::Out { why: OutReason::Misses, ready: 0 };
                        self.leave_out(node, OutReason::Misses);
                    }
                }
                Place::Out { ready, .. } if is_ready => {
                    *ready += 1;
                    if *ready >= READY_UNTIL_IN {
                        member.place = Place::In { misses: 0 };
                        self.counts.taken_in += 1;
                    }
                }
                Place::Out { ready, .. } => *ready = 0,
                Place::Absent | Place::Refused(_) => {}
            }
        }
        if self.phase == Phase::Starting {
            let waits = self.members.iter().any(|member| matches!(member.place, Place::Out { .. }));
            let is_late = self.since_ns.is_some_and(|since_ns| now.monotonic_ns >= since_ns + self.rules.start_ns);
            if self.rules.is_quorum(self.taking_part().len()) && (is_late || !waits) {
                self.phase = Phase::Running;
            }
        }
    }

    /// Opens the next frame at the latest tick that has begun. Missed ticks are not made up for.
    fn open_next(&mut self, now: Now, last: &Open) {
        let period_ns = self.rules.period_ns;
        let periods = (now.monotonic_ns - last.tick_ns) / period_ns;
        self.counts.ticks_lost += periods - 1;
        self.open_frame(last.id.number + 1, last.tick_ns + periods * period_ns);
    }
}
