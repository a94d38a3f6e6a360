//! The thread of a director: drives [`steradian_lock::Director`] over a wire, and the thread that composes cues for it.

use std::{
    collections::HashMap,
    io,
    sync::{
        Arc,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
    time::Duration,
};

use steradian_lock::{
    clock::Now,
    director::{Action, Director, Phase, Place},
    messages::{Cue as LockCue, FrameId, NodeId, OutReason, Refusal, SkipReason, ToDirector, ToNode},
};

use super::{
    Party,
    compose::Composer,
    cue,
    figures::{ClusterFigures, NodeFigures, SharedFigures, Window, phase_name, short},
    messages::{decode_to_director, encode_to_node},
    queue::Queue,
    refusals::{Denied, Refusals, refusals},
    report,
    station::{FRAMES, Station, frame_name},
    wire::{Heard, To, Wire},
};
use crate::{
    platform::clock,
    service::{engine::render_handle::RenderHandle, threads::RunningThread},
};

/// Time for which a refused connection is reported as a problem, ns.
const RECENT_NS: u64 = 10_000_000_000;

/// An event of the director's thread.
pub(super) enum Event {
    Heard(Heard),
    Composed { id: FrameId, cue: Result<Option<(LockCue, u64)>, String>, scene: Option<(Arc<[u8]>, [u8; 32])> },
    Stop,
}

/// Work of the composing thread.
enum Compose {
    Cue { id: FrameId, ahead: Duration },
    Drawn { ns: u64 },
}

/// Information about a node, in addition to its place.
#[derive(Default)]
struct NodeNotes {
    ready: Window,
    drawn: Window,
    out: u64,
    refused: u64,
    version: String,
    adapter: String,
    report: report::Report,
    has_clock: bool,
    told_refusal: Option<Refusal>,
}

struct Conductor {
    station: Station,
    lock: Director,
    compose: SyncSender<Compose>,
    notes: Vec<NodeNotes>,
    /// Times of the last STATE messages, and the longest drawing time for each.
    states: HashMap<u64, (u64, u64)>,
    commit: Window,
    committed: u64,
    scene_hash: [u8; 32],
    scene_revision: u64,
    problem: String,
    phase: Phase,
    told_absent: bool,
    refusals: Refusals,
    /// Time of the last failed handshake, ns.
    handshake_ns: Option<u64>,
}

/// Starts the threads of a director.
pub(super) fn spawn(
    party: Party,
    render: RenderHandle,
    queue: &Arc<Queue<Event>>,
    events: Receiver<Event>,
    figures: Arc<SharedFigures>,
    open: impl FnOnce() -> Result<(Box<dyn Wire>, bool), String> + Send + 'static,
) -> io::Result<RunningThread<Result<(), String>>> {
    let (compose, work) = sync_channel(64);
    let composed = Arc::clone(queue);
    thread::Builder::new().name("cluster-cues".to_owned()).spawn(move || {
        let mut composer = Composer::new(render);
        while let Ok(work) = work.recv() {
            match work {
                Compose::Drawn { ns } => composer.note_drawn(ns),
                Compose::Cue { id, ahead } => {
                    let (cue, scene) = match composer.compose(id.number, ahead) {
                        Ok(None) => (Ok(None), None),
                        Err(problem) => (Err(problem), None),
                        Ok(Some(made)) => {
                            let revision = made.cue.cue.scene;
                            let scene = made.new_scene.map(|bytes| (bytes, made.cue.scene_hash));
                            let bytes = LockCue::new(&cue::encode(&made.cue));
                            (bytes.map(|bytes| Some((bytes, revision))).map_err(|error| error.to_string()), scene)
                        }
                    };
                    composed.push(Event::Composed { id, cue, scene });
                }
            }
        }
    })?;
    RunningThread::spawn("cluster", move || {
        let station = Station::new(party, open()?, figures);
        let party = &station.party;
        let lock = Director::new(party.rules, party.run, party.identity.clone());
        let notes = party.nodes.iter().map(|_| NodeNotes::default()).collect();
        let mut conductor = Conductor {
            station,
            lock,
            compose,
            notes,
            states: HashMap::new(),
            commit: Window::default(),
            committed: 0,
            scene_hash: [0; 32],
            scene_revision: 0,
            problem: String::new(),
            phase: Phase::Gathering,
            told_absent: false,
            refusals: Refusals::default(),
            handshake_ns: None,
        };
        conductor.run(&events);
        Ok(())
    })
}

impl Conductor {
    fn run(&mut self, events: &Receiver<Event>) {
        loop {
            let (now, events) = self.station.wait(events, self.lock.wake_at().unwrap_or(u64::MAX));
            for event in events {
                match event {
                    Event::Stop => return,
                    Event::Heard(heard) => self.hear(now, heard),
                    Event::Composed { id, cue, scene } => self.composed(now, id, cue, scene),
                }
            }
            for action in self.lock.act(now) {
                self.carry_out(now, action);
            }
            self.tell_phase();
            if self.station.is_figures_time(now) {
                self.tell_refusals(now);
                self.publish(now);
                self.tell_absent(now);
            }
        }
    }

    /// Notes the refusals of the network, and logs each new reason.
    fn tell_refusals(&mut self, now: Now) {
        let new = refusals();
        if new.handshakes > self.refusals.handshakes {
            self.handshake_ns = Some(now.monotonic_ns);
            if new.handshake != self.refusals.handshake {
                tracing::error!("cluster: a connection was refused, {} in total: {}", new.handshakes, new.handshake);
            }
        }
        for (node, denied) in &new.denied {
            let known = self.refusals.denied.get(node);
            if known.is_none_or(|known| known.common_name != denied.common_name) {
                tracing::error!(
                    "cluster: refused: a process with the certificate of `{}` says that it is node `{node}`",
                    denied.common_name
                );
            }
        }
        self.refusals = new;
    }

    /// Logs once which nodes did not send HELLO while the director waited for them.
    fn tell_absent(&mut self, now: Now) {
        if self.told_absent || now.monotonic_ns < self.station.begun_ns + self.station.party.rules.gather_ns {
            return;
        }
        self.told_absent = true;
        let is_absent = |index: &usize| {
            let id = NodeId(u16::try_from(*index).unwrap_or(u16::MAX));
            matches!(self.lock.place(id), Some(Place::Absent))
        };
        let absent = (0..self.station.party.nodes.len()).filter(is_absent);
        let names: Vec<&str> = absent.map(|index| self.station.party.nodes[index].name.as_str()).collect();
        if !names.is_empty() {
            tracing::warn!(
                "cluster: no message from {}: not started, not reachable, or not accepted with its certificate",
                names.join(", ")
            );
        }
    }

    fn name(&self, node: NodeId) -> &str {
        self.station.party.nodes.get(usize::from(node.0)).map_or("?", |node| &node.name)
    }

    fn hear(&mut self, now: Now, heard: Heard) {
        match heard {
            Heard::FromNode(node, bytes) => match decode_to_director(&bytes) {
                Ok(message) => {
                    self.note(now, node, &message);
                    self.lock.hear(now, node, message);
                }
                Err(error) => {
                    self.station.unreadable += 1;
                    tracing::debug!("{}: {error}", self.name(node));
                }
            },
            Heard::Node(node, true) => tracing::info!("cluster: node `{}` is connected", self.name(node)),
            Heard::Node(node, false) => {
                tracing::warn!("cluster: the connection of node `{}` ended", self.name(node));
                self.lock.lost(now, node);
            }
            Heard::FromDirector(_) | Heard::Director(_) | Heard::Scene(_) => {}
        }
    }

    /// Records figures that a message contains.
    fn note(&mut self, now: Now, node: NodeId, message: &ToDirector) {
        let name = self.name(node).to_owned();
        let Some(notes) = self.notes.get_mut(usize::from(node.0)) else { return };
        match message {
            ToDirector::Hello(hello) => {
                notes.version.clone_from(&hello.identity.version);
                notes.adapter = format!("{}, {}", hello.identity.adapter, hello.identity.driver);
                let refusal = self.station.party.identity.difference(&hello.identity);
                notes.refused += u64::from(refusal.is_some());
                if refusal != notes.told_refusal {
                    match &refusal {
                        Some(refusal) => tracing::error!("cluster: node `{name}` is refused: {refusal}"),
                        None => tracing::info!("cluster: node `{name}` is no longer refused"),
                    }
                    notes.told_refusal = refusal;
                }
            }
            ToDirector::Ready(ready) => {
                if let Some((sent_ns, slowest_ns)) = self.states.get_mut(&ready.id.number) {
                    notes.ready.note(now.monotonic_ns.saturating_sub(*sent_ns));
                    *slowest_ns = (*slowest_ns).max(ready.drawn_ns);
                }
                notes.drawn.note(ready.drawn_ns);
                let (frame, at) = (ready.id, now.monotonic_ns);
                tracing::trace!(target: FRAMES, "ready {} at {at} {name} {}", frame_name(frame), ready.drawn_ns);
                notes.has_clock = ready.has_clock;
                if let Some(report) = report::decode(&ready.report.0) {
                    notes.report = report;
                }
            }
        }
    }

    fn composed(
        &mut self,
        now: Now,
        id: FrameId,
        cue: Result<Option<(LockCue, u64)>, String>,
        scene: Option<(Arc<[u8]>, [u8; 32])>,
    ) {
        if let Some((bytes, hash)) = scene {
            self.station.wire.offer_scene(bytes);
            self.scene_hash = hash;
        }
        match cue {
            Ok(Some((cue, revision))) => {
                self.scene_revision = revision;
                self.problem.clear();
                self.lock.composed(now, id, cue);
            }
            Ok(None) => {}
            Err(problem) => {
                if self.problem != problem {
                    tracing::error!("cluster: no frame can be requested: {problem}");
                    self.problem = problem;
                }
            }
        }
    }

    fn carry_out(&mut self, now: Now, action: Action) {
        match action {
            Action::Send { to, message } => self.station.send(To::Node(to), &encode_to_node(&message)),
            Action::SendAll(message) => {
                self.station.send(To::Nodes, &encode_to_node(&message));
                self.trace(&message);
                match message {
                    ToNode::State(state) => {
                        self.states.insert(state.id.number, (now.monotonic_ns, 0));
                        if let Some((_, slowest_ns)) = self.states.remove(&state.id.number.wrapping_sub(4)) {
                            // If the queue is full, this figure is lost.
                            let _ = self.compose.try_send(Compose::Drawn { ns: slowest_ns });
                        }
                    }
                    ToNode::Commit(commit) if commit.id.number > self.committed => {
                        self.committed = commit.id.number;
                        if let Some((sent_ns, _)) = self.states.get(&commit.id.number) {
                            self.commit.note(now.monotonic_ns - sent_ns);
                        }
                    }
                    ToNode::Out(out) => {
                        if let Some(notes) = self.notes.get_mut(usize::from(out.node.0)) {
                            notes.out += 1;
                        }
                        tracing::warn!("cluster: node `{}` is left out: {}", self.name(out.node), why(out.why));
                    }
                    _ => {}
                }
            }
            Action::Compose { id, .. } => {
                let ahead = Duration::from_nanos(self.station.party.rules.ahead_ns());
                // The composer is busy with earlier frames: this one is skipped.
                let _ = self.compose.try_send(Compose::Cue { id, ahead });
            }
            Action::Deposed { by } => {
                tracing::error!(
                    "cluster: another director leads (epoch {}); this one no longer sends anything",
                    by.counter
                );
            }
        }
    }

    /// Logs a message to all nodes.
    fn trace(&self, message: &ToNode) {
        if !tracing::enabled!(target: FRAMES, tracing::Level::TRACE) {
            return;
        }
        let (what, frame, rest) = match message {
            ToNode::State(state) => ("state", state.id, String::new()),
            ToNode::Commit(commit) => ("commit", commit.id, format!(" {}", commit.mask.len())),
            ToNode::Skip(skip) => ("skip", skip.id, format!(" {}", skip_name(skip.why))),
            ToNode::Welcome(_) | ToNode::Refused(_) | ToNode::Out(_) => return,
        };
        let at = clock::monotonic_ns();
        tracing::trace!(target: FRAMES, "{what} {} at {at}{rest}", frame_name(frame));
    }

    fn tell_phase(&mut self) {
        let phase = self.lock.phase();
        if std::mem::replace(&mut self.phase, phase) != phase {
            self.committed = 0;
            let taking_part = self.lock.taking_part().len();
            tracing::info!("cluster: {}, {taking_part} of {} nodes", phase_name(phase), self.station.party.nodes.len());
        }
    }

    /// Returns the problem, which is empty if there is none: no frame can be requested, or a connection was refused a short time ago.
    fn reason(&self, now: Now) -> String {
        let is_recent = |at_ns: u64| now.monotonic_ns < at_ns + RECENT_NS;
        if self.problem.is_empty() && self.handshake_ns.is_some_and(is_recent) {
            return format!("a connection was refused: {}", self.refusals.handshake);
        }
        self.problem.clone()
    }

    fn publish(&mut self, now: Now) {
        let counts = self.lock.counts();
        let nodes = self.station.party.nodes.iter().enumerate().map(|(index, node)| {
            let notes = &self.notes[index];
            let denied = self.refusals.denied.get(&node.name);
            let id = NodeId(u16::try_from(index).unwrap_or(u16::MAX));
            let (state, reason) = match self.lock.place(id) {
                Some(Place::In { .. }) => ("in", String::new()),
                Some(Place::Out { why: reason, .. }) => ("out", why(*reason).to_owned()),
                Some(Place::Refused(refusal)) => ("refused", refusal.to_string()),
                Some(Place::Absent) | None => match denied {
                    Some(Denied { common_name, .. }) => (
                        "absent",
                        format!("refused: a process with the certificate of `{common_name}` says that it is this node"),
                    ),
                    None => ("absent", "it has not sent HELLO".to_owned()),
                },
            };
            NodeFigures {
                name: node.name.clone(),
                state,
                reason,
                ready: notes.ready.times(),
                drawn: notes.drawn.times(),
                out: notes.out,
                refused: notes.refused + denied.map_or(0, |denied| denied.count),
                version: notes.version.clone(),
                adapter: notes.adapter.clone(),
                scene_hash: notes.report.scene_hash.as_ref().map(short).unwrap_or_default(),
                frame_number: notes.report.shown,
                clock: notes.has_clock,
            }
        });
        let figures = ClusterFigures {
            state: phase_name(self.lock.phase()).to_owned(),
            reason: self.reason(now),
            locked: self.lock.is_locked(),
            epoch: self.lock.epoch().counter,
            frame_number: self.committed,
            scene_hash: short(&self.scene_hash),
            scene_revision: self.scene_revision,
            counts: vec![
                ("committed", counts.committed),
                ("committed_on_receipt", counts.committed_on_receipt),
                ("skipped_starting", counts.skipped_starting),
                ("skipped_quorum", counts.skipped_quorum),
                ("skipped_deadline", counts.skipped_deadline),
                ("not_composed", counts.not_composed),
                ("ticks_lost", counts.ticks_lost),
                ("ready_late", counts.ready_late),
                ("refused", counts.refused),
                ("refused_handshakes", self.refusals.handshakes),
                ("refused_certificates", self.refusals.denied.values().map(|denied| denied.count).sum()),
                ("out", counts.out),
                ("taken_in", counts.taken_in),
                ("clock_steps", self.lock.clock_steps()),
                ("unreadable", self.station.unreadable),
                ("unsent", self.station.unsent),
            ],
            times: vec![("state_to_commit", self.commit.times())],
            nodes: nodes.collect(),
            ..self.station.figures()
        };
        self.station.publish(figures);
    }
}

/// Describes the reason to leave a node out.
fn why(reason: OutReason) -> &'static str {
    match reason {
        OutReason::Joining => "it joins: it has not been ready often enough yet",
        OutReason::Misses => "it was not ready in time",
        OutReason::Lost => "its connection ended",
        OutReason::Unknown => "it must send HELLO",
    }
}

/// Returns the name of the reason to skip a frame.
fn skip_name(reason: SkipReason) -> &'static str {
    match reason {
        SkipReason::Starting => "starting",
        SkipReason::Quorum => "quorum",
        SkipReason::Deadline => "deadline",
    }
}
