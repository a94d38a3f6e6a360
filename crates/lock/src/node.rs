//! A node: draws the newest state, votes, and shows a picture only after a COMMIT that names the node.
//!
//! | state | entered when | behaviour |
//! |---|---|---|
//! | looking | created; no message for `silence_ns`; the director does not know it | says HELLO every `hello_ns`; keeps showing the last picture |
//! | refused | REFUSED | the same, every ten `hello_ns` |
//! | led | WELCOME with an epoch that is not below the promised one | draws, votes, shows |
//! | black | no new picture for `hold_ns`, in any of these states | shows black or a logo until the next picture |
//!
//! | fate of a picture | next |
//! |---|---|
//! | drawing | drawing ends: READY, *waiting*; if a newer STATE or SKIP arrived before: discarded without READY |
//! | waiting | COMMIT with this node in the mask: *due*; any other verdict, a newer picture shown, or its time has passed: discarded |
//! | due | its time of presentation: shown; more than half a period later: discarded and counted |
//!
//! A message of a lower epoch than the promised one is counted and otherwise ignored. The node answers with HELLO, which shows the old director that
//! it is deposed.

use crate::{
    clock::{Clock, Now},
    messages::{
        Commit, Cue, Epoch, FrameId, Hello, Identity, NodeId, OutReason, Ready, Refusal, Report, Skip, State,
        ToDirector, ToNode, Welcome,
    },
    rules::Rules,
};

/// A refused node asks again after this many times `hello_ns`.
const REFUSED_FACTOR: u64 = 10;

/// Actions for the caller, to be carried out in this order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Write this epoch to disk before any later action is carried out, and pass it to [`Node::new`] at the next start.
    Remember(Epoch),
    /// Send to all directors.
    Send(ToDirector),
    /// Draw this frame; call [`Node::drawn`] after the GPU has finished.
    Draw {
        /// The frame.
        id: FrameId,
        /// Time at which it is shown, TAI, ns, if it is committed.
        present_at: Option<i64>,
        /// Inputs for drawing.
        cue: Cue,
    },
    /// Show the picture of this frame now.
    Show {
        /// The frame.
        id: FrameId,
    },
    /// The picture of this frame is not shown: keep its texture and draw the next frame into it.
    Discard {
        /// The frame.
        id: FrameId,
    },
    /// Show black or the logo.
    Black,
}

/// Counters since the start of the node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Pictures shown.
    pub shown: u64,
    /// COMMITs that arrived more than half a period after the time of presentation.
    pub commit_late: u64,
    /// Pictures that were not shown within half a period because the process was not running.
    pub show_late: u64,
    /// COMMITs with this node in the mask for which it had no picture.
    pub commit_without_picture: u64,
    /// Pictures of frames that were committed without this node.
    pub left_out: u64,
    /// Finished pictures of frames that were skipped for all nodes.
    pub skipped: u64,
    /// Pictures that got no verdict because COMMIT or SKIP was lost, and pictures that were replaced by a newer one.
    pub without_verdict: u64,
    /// Frames that were not finished before the next STATE.
    pub too_slow: u64,
    /// Frames that could not be drawn.
    pub failed: u64,
    /// STATEs that were replaced by a newer one before they were drawn.
    pub states_replaced: u64,
    /// Messages of a lower epoch.
    pub lower_epoch: u64,
    /// Times that the node went black.
    pub black: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Waiting,
    Due { at_ns: u64 },
}

#[derive(Clone, Copy, Debug)]
struct Picture {
    id: FrameId,
    ready_ns: u64,
    fate: Fate,
}

#[derive(Clone, Copy, Debug)]
struct Drawing {
    id: FrameId,
    present_at: Option<i64>,
    is_wanted: bool,
}

/// State machine of a node. See the top of the module.
#[derive(Clone, Debug)]
pub struct Node {
    rules: Rules,
    id: NodeId,
    run: u64,
    identity: Identity,
    clock: Clock,
    promised: Epoch,
    /// The epoch in which this node is led: the promised epoch, once its WELCOME has arrived.
    led_by: Option<Epoch>,
    refused: Option<Refusal>,
    /// The newest frame whose STATE was received.
    newest: Option<FrameId>,
    /// The newest STATE, until it is drawn.
    next: Option<State>,
    drawing: Option<Drawing>,
    /// Finished pictures, oldest first.
    pictures: Vec<Picture>,
    shown: Option<FrameId>,
    last_commit: Option<FrameId>,
    last_ready: Option<Ready>,
    /// Monotonic times, ns: of the last picture shown, of the last message, and of the next HELLO.
    shown_ns: u64,
    heard_ns: u64,
    hello_ns: u64,
    wants_hello: bool,
    is_black: bool,
    actions: Vec<Action>,
    counts: Counts,
}

impl Node {
    /// Creates a node that looks for a director. `run` is a random number of this process. `promised` is the epoch of the last [`Action::Remember`]
    /// of an earlier process, or [`Epoch::NONE`].
    pub fn new(rules: Rules, id: NodeId, run: u64, promised: Epoch, identity: Identity, now: Now) -> Self {
        let mut clock = Clock::default();
        clock.observe(now);
        Self {
            rules,
            id,
            run,
            identity,
            clock,
            promised,
            led_by: None,
            refused: None,
            newest: None,
            next: None,
            drawing: None,
            pictures: Vec::new(),
            shown: None,
            last_commit: None,
            last_ready: None,
            shown_ns: now.monotonic_ns,
            heard_ns: now.monotonic_ns,
            hello_ns: now.monotonic_ns,
            wants_hello: true,
            is_black: false,
            actions: Vec::new(),
            counts: Counts::default(),
        }
    }

    /// Counters since the start of the node.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The epoch in which this node votes; `None`: it looks for a director.
    pub fn led_by(&self) -> Option<Epoch> {
        self.led_by
    }

    /// Whether a director leads this node and has sent a message within `silence_ns`.
    pub fn is_led(&self, now: Now) -> bool {
        self.led_by.is_some() && now.monotonic_ns < self.heard_ns + self.rules.silence_ns
    }

    /// The reason of the last REFUSED; cleared by a WELCOME.
    pub fn refused(&self) -> Option<&Refusal> {
        self.refused.as_ref()
    }

    /// The frame on the screen; `None`: none yet, or black.
    pub fn shown(&self) -> Option<FrameId> {
        self.shown.filter(|_| !self.is_black)
    }

    /// Number of times that this machine's clock was set.
    pub fn clock_steps(&self) -> u64 {
        self.clock.steps
    }

    /// Reports that a connection to a director was opened.
    pub fn connected(&mut self, now: Now) {
        self.clock.observe(now);
        self.wants_hello = true;
        self.hello_ns = now.monotonic_ns;
    }

    /// Processes a message. Drain the whole queue before [`Self::act`]: only the newest state counts.
    pub fn hear(&mut self, now: Now, message: ToNode) {
        self.clock.observe(now);
        let epoch = match &message {
            ToNode::Welcome(welcome) => return self.hear_welcome(now, *welcome),
            ToNode::Refused(refusal) => {
                self.refused = Some(refusal.clone());
                self.led_by = None;
                return;
            }
            ToNode::State(state) => state.id.epoch,
            ToNode::Commit(commit) => commit.id.epoch,
            ToNode::Skip(skip) => skip.id.epoch,
            ToNode::Out(out) => out.epoch,
        };
        if self.led_by != Some(epoch) {
            self.counts.lower_epoch += u64::from(epoch < self.promised);
            self.wants_hello = true;
            return;
        }
        self.heard_ns = now.monotonic_ns;
        match message {
            ToNode::State(state) => self.hear_state(now, state),
            ToNode::Commit(commit) => self.hear_commit(now, commit),
            ToNode::Skip(skip) => self.hear_skip(skip),
            ToNode::Out(out) => self.wants_hello |= out.node == self.id && out.why == OutReason::Unknown,
            ToNode::Welcome(_) | ToNode::Refused(_) => {}
        }
    }

    fn hear_welcome(&mut self, now: Now, welcome: Welcome) {
        let Welcome { epoch, run, newest } = welcome;
        if run != self.run {
            return;
        }
        if epoch < self.promised {
            self.counts.lower_epoch += 1;
            self.wants_hello = true;
            return;
        }
        self.heard_ns = now.monotonic_ns;
        self.refused = None;
        if epoch > self.promised {
            self.promised = epoch;
            self.actions.push(Action::Remember(epoch));
        }
        if self.led_by != Some(epoch) {
            self.led_by = Some(epoch);
            self.newest = self.newest.max(Some(FrameId { epoch, number: newest }));
            // Requests of another director are void.
            self.next = None;
            self.abandon_drawing();
            self.discard(|picture| picture.id.epoch != epoch);
        }
    }

    fn abandon_drawing(&mut self) {
        if let Some(drawing) = &mut self.drawing {
            drawing.is_wanted = false;
        }
    }

    /// Discards pictures and returns their number.
    fn discard(&mut self, is_useless: impl Fn(&Picture) -> bool) -> u64 {
        let before = self.pictures.len();
        let actions = &mut self.actions;
        self.pictures.retain(|picture| {
            let useless = is_useless(picture);
            if useless {
                actions.push(Action::Discard { id: picture.id });
            }
            !useless
        });
        (before - self.pictures.len()) as u64
    }

    fn hear_state(&mut self, now: Now, state: State) {
        if let Some(commit) = state.commit.filter(|commit| commit.id.epoch == state.id.epoch) {
            self.hear_commit(now, commit);
        }
        if self.newest.is_some_and(|newest| newest >= state.id) {
            // The director asks again: STATE or READY was lost.
            let waits = |picture: &Picture| picture.id == state.id && picture.fate == Fate::Waiting;
            let ready = self.last_ready.as_ref().filter(|ready| ready.id == state.id);
            if let Some(ready) = ready.filter(|_| self.pictures.iter().any(waits)) {
                self.actions.push(Action::Send(ToDirector::Ready(ready.clone())));
            }
            return;
        }
        self.newest = Some(state.id);
        // The director has closed the frame that is being drawn.
        self.abandon_drawing();
        self.counts.states_replaced += u64::from(self.next.replace(state).is_some());
    }

    fn hear_commit(&mut self, now: Now, commit: Commit) {
        let is_repeated = self.last_commit.is_some_and(|last| last >= commit.id);
        self.last_commit = self.last_commit.max(Some(commit.id));
        let is_meant = commit.mask.contains(self.id);
        let Some(index) = self.pictures.iter().position(|picture| picture.id == commit.id) else {
            self.counts.commit_without_picture += u64::from(is_meant && !is_repeated);
            return;
        };
        let picture = self.pictures[index];
        if picture.fate != Fate::Waiting {
            return;
        }
        if !is_meant {
            self.counts.left_out += self.discard(|picture| picture.id == commit.id);
            return;
        }
        let due_ns = commit.present_at.and_then(|tai_ns| self.clock.monotonic_ns(tai_ns));
        let limit_ns = match due_ns {
            Some(due_ns) => due_ns + self.rules.period_ns / 2,
            None => picture.ready_ns + self.rules.period_ns,
        };
        if now.monotonic_ns > limit_ns {
            self.counts.commit_late += self.discard(|picture| picture.id == commit.id);
            return;
        }
        self.pictures[index].fate = Fate::Due { at_ns: due_ns.unwrap_or(now.monotonic_ns) };
    }

    fn hear_skip(&mut self, skip: Skip) {
        if self.drawing.is_some_and(|drawing| drawing.id == skip.id) {
            self.abandon_drawing();
        }
        self.next.take_if(|state| state.id == skip.id);
        self.counts.skipped += self.discard(|picture| picture.id == skip.id && picture.fate == Fate::Waiting);
    }

    /// Reports that a frame is drawn. Call it only after the GPU has finished. `drawn_ns` is the duration of drawing.
    pub fn drawn(&mut self, now: Now, id: FrameId, drawn_ns: u64, report: Report) {
        self.clock.observe(now);
        let Some(drawing) = self.drawing.take_if(|drawing| drawing.id == id) else { return };
        if !drawing.is_wanted || self.led_by != Some(id.epoch) {
            self.counts.too_slow += 1;
            self.actions.push(Action::Discard { id });
            return;
        }
        let has_clock = drawing.present_at.is_some_and(|tai_ns| self.can_meet(now, tai_ns));
        self.pictures.push(Picture { id, ready_ns: now.monotonic_ns, fate: Fate::Waiting });
        let ready = Ready { id, drawn_ns, has_clock, report };
        self.last_ready = Some(ready.clone());
        self.actions.push(Action::Send(ToDirector::Ready(ready)));
    }

    /// The frame cannot be drawn: no READY is sent, and the next STATE is drawn.
    pub fn failed(&mut self, now: Now, id: FrameId) {
        self.clock.observe(now);
        if self.drawing.take_if(|drawing| drawing.id == id).is_some() {
            self.counts.failed += 1;
        }
    }

    /// Whether this machine's clock is trusted and agrees with the director's, that is, the time of presentation is neither in the past nor far
    /// ahead.
    fn can_meet(&self, now: Now, tai_ns: i64) -> bool {
        let farthest_ns = now.monotonic_ns + self.rules.ahead_ns() + self.rules.period_ns;
        let due_ns = self.clock.monotonic_ns(tai_ns).filter(|_| self.clock.is_trusted());
        due_ns.is_some_and(|due_ns| (now.monotonic_ns..=farthest_ns).contains(&due_ns))
    }

    /// Runs the due steps and returns the actions for the caller. Call it after every other method, and at [`Self::wake_at`].
    pub fn act(&mut self, now: Now) -> Vec<Action> {
        self.clock.observe(now);
        self.show_due(now);
        self.expire(now);
        self.draw_next();
        self.say_hello(now);
        if !self.is_black && now.monotonic_ns >= self.shown_ns + self.rules.hold_ns {
            self.is_black = true;
            self.counts.black += 1;
            self.actions.push(Action::Black);
        }
        std::mem::take(&mut self.actions)
    }

    /// Monotonic time at which [`Self::act`] must next be called, ns.
    pub fn wake_at(&self) -> u64 {
        let pictures = self.pictures.iter().map(|picture| match picture.fate {
            Fate::Waiting => picture.ready_ns + self.waiting_limit_ns(),
            Fate::Due { at_ns } => at_ns,
        });
        let next = pictures.min().unwrap_or(u64::MAX).min(self.hello_due_ns());
        if self.is_black { next } else { next.min(self.shown_ns + self.rules.hold_ns) }
    }

    /// Shows the newest picture that is due, and discards all older ones.
    fn show_due(&mut self, now: Now) {
        let is_due = |picture: &&Picture| matches!(picture.fate, Fate::Due { at_ns } if at_ns <= now.monotonic_ns);
        let Some(picture) = self.pictures.iter().rfind(is_due).copied() else { return };
        let Fate::Due { at_ns } = picture.fate else { return };
        if now.monotonic_ns > at_ns + self.rules.period_ns / 2 {
            self.counts.show_late += self.discard(|other| other.id <= picture.id);
            return;
        }
        self.pictures.retain(|other| other.id != picture.id);
        self.counts.without_verdict += self.discard(|other| other.id < picture.id);
        self.counts.shown += 1;
        self.shown = Some(picture.id);
        self.shown_ns = now.monotonic_ns;
        self.is_black = false;
        self.actions.push(Action::Show { id: picture.id });
    }

    /// Time after READY for which a node keeps a picture that waits for its COMMIT.
    fn waiting_limit_ns(&self) -> u64 {
        self.rules.ahead_ns() + self.rules.period_ns
    }

    fn expire(&mut self, now: Now) {
        let limit_ns = self.waiting_limit_ns();
        self.counts.without_verdict +=
            self.discard(|picture| picture.fate == Fate::Waiting && now.monotonic_ns >= picture.ready_ns + limit_ns);
    }

    fn draw_next(&mut self) {
        if self.drawing.is_some() || self.pictures.len() >= self.rules.pictures() {
            return;
        }
        let Some(state) = self.next.take() else { return };
        let State { id, present_at, cue, .. } = state;
        self.drawing = Some(Drawing { id, present_at, is_wanted: true });
        self.actions.push(Action::Draw { id, present_at, cue });
    }

    /// Monotonic time of the next HELLO; `u64::MAX`: none.
    fn hello_due_ns(&self) -> u64 {
        if self.wants_hello || self.led_by.is_none() {
            self.hello_ns
        } else {
            self.hello_ns.max(self.heard_ns + self.rules.silence_ns)
        }
    }

    fn say_hello(&mut self, now: Now) {
        if now.monotonic_ns < self.hello_due_ns() {
            return;
        }
        self.wants_hello = false;
        let factor = if self.refused.is_some() { REFUSED_FACTOR } else { 1 };
        self.hello_ns = now.monotonic_ns + self.rules.hello_ns * factor;
        let hello = Hello { run: self.run, promised: self.promised, identity: self.identity.clone() };
        self.actions.push(Action::Send(ToDirector::Hello(hello)));
    }
}
