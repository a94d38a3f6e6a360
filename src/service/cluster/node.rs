//! The thread of a node: drives [`steradian_lock::Node`] over a wire, has the render thread draw cues, and shows pictures.

use std::{
    collections::HashMap,
    io,
    sync::{
        Arc,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
};

use steradian_lock::{
    clock::Now,
    messages::{FrameId, Report as LockReport, ToNode},
    node::{Action, Node},
};

use super::{
    Party,
    cue::{self, HashedCue},
    epoch_file,
    figures::{ClusterFigures, SharedFigures, Window, short},
    messages::{decode_to_node, encode_to_director},
    queue::Queue,
    refusals::{Refusals, refusals},
    report::{self, Report},
    scene,
    station::{FRAMES, Station, frame_name},
    wire::{Heard, To, Wire},
};
use crate::{
    platform::clock,
    service::{
        engine::{
            led::{CueError, Pictures},
            render_handle::RenderHandle,
            stage::Stage,
        },
        threads::RunningThread,
    },
};

/// Time without a director after which the log reports it, ns.
const LOOKING_NS: u64 = 5_000_000_000;
/// Time between two requests for the director's scene, ns.
const ASK_NS: u64 = 500_000_000;

/// An event of the node's thread.
pub(super) enum Event {
    Heard(Heard),
    Drawn {
        id: FrameId,
        pictures: Result<Pictures, CueError>,
    },
    /// The windows have prepared a frame, or have lost their device while they prepared it.
    Prepared {
        id: FrameId,
        is_ready: bool,
    },
    /// The director's scene was adopted: its revision and hash.
    Adopted(Result<(u64, [u8; 32]), String>),
    Stop,
}

struct Player {
    station: Station,
    lock: Node,
    render: RenderHandle,
    queue: Arc<Queue<Event>>,
    /// Scenes of the director for the thread that adopts them.
    scenes: SyncSender<Vec<u8>>,
    /// Hands pictures to windows.
    stage: Arc<Stage>,
    /// Pictures that are being prepared or wait for a verdict, with their numbers on the stage.
    pictures: HashMap<FrameId, (Pictures, u64)>,
    /// Pictures that were handed to the stage.
    staged: u64,
    /// Pictures that streams show; after a long time without a frame, black ones replace them.
    last: Option<Pictures>,
    /// Revision and hash of the scene.
    scene: (u64, [u8; 32]),
    adopting: bool,
    asked_ns: Option<u64>,
    drawn: Window,
    shown: u64,
    shown_ns: Option<u64>,
    intervals: Window,
    is_black: bool,
    /// Time at which the node entered its state, and whether the log has reported that it found no director.
    state_ns: u64,
    told_looking: bool,
    state: &'static str,
    problem: String,
    adopted: u64,
    refusals: Refusals,
}

/// Starts the thread of a node.
pub(super) fn spawn(
    party: Party,
    render: RenderHandle,
    queue: &Arc<Queue<Event>>,
    events: Receiver<Event>,
    figures: Arc<SharedFigures>,
    open: impl FnOnce() -> Result<(Box<dyn Wire>, bool), String> + Send + 'static,
) -> io::Result<RunningThread<Result<(), String>>> {
    let (scenes, work) = sync_channel::<Vec<u8>>(1);
    let (adopting, adopted) = (render.clone(), Arc::clone(queue));
    // Do not start this thread from the cluster's thread: it would inherit the scheduling of that thread.
    thread::Builder::new().name("cluster-scene".to_owned()).spawn(move || {
        while let Ok(bytes) = work.recv() {
            adopted.push_surely(Event::Adopted(adopt(&bytes, &adopting)));
        }
    })?;
    let queue = Arc::clone(queue);
    RunningThread::spawn("cluster", move || {
        let promised = epoch_file::read(&party.epoch_file)?;
        let station = Station::new(party, open()?, figures);
        let party = &station.party;
        let id = party.node.ok_or("a node needs a number")?;
        let lock = Node::new(party.rules, id, party.run, promised, party.identity.clone(), station.clock.now());
        let begun = render.scene().map_err(|_| "the daemon is shutting down".to_owned())?;
        let scene = (begun.revision, scene::hash(&begun, render.time()));
        let stage = render.stage().ok_or("the worker of a node is led")?;
        let mut player = Player {
            station,
            lock,
            render,
            queue,
            scenes,
            stage,
            pictures: HashMap::new(),
            staged: 0,
            last: None,
            scene,
            adopting: false,
            asked_ns: None,
            drawn: Window::default(),
            shown: 0,
            shown_ns: None,
            intervals: Window::default(),
            is_black: false,
            state_ns: 0,
            told_looking: false,
            state: "",
            problem: String::new(),
            adopted: 0,
            refusals: Refusals::default(),
        };
        player.run(&events)
    })
}

/// Adopts the director's scene; returns its revision and hash.
fn adopt(bytes: &[u8], render: &RenderHandle) -> Result<(u64, [u8; 32]), String> {
    let scene = scene::applied(bytes, render)?;
    let known = (scene.revision, scene::hash(&scene, render.time()));
    render.adopt_scene(scene).map_err(|failure| failure.to_string())?;
    Ok(known)
}

impl Player {
    fn run(&mut self, events: &Receiver<Event>) -> Result<(), String> {
        loop {
            let (now, events) = self.station.wait(events, self.lock.wake_at());
            for event in events {
                match event {
                    Event::Stop => return Ok(()),
                    Event::Heard(heard) => self.hear(now, heard),
                    Event::Drawn { id, pictures } => self.drawn(now, id, pictures),
                    Event::Prepared { id, is_ready } => self.prepared(now, id, is_ready),
                    Event::Adopted(adopted) => self.adopted(adopted),
                }
            }
            for action in self.lock.act(now) {
                self.carry_out(now, action)?;
            }
            self.tell_state(now);
            if self.station.is_figures_time(now) {
                self.tell_refusals();
                self.publish();
            }
        }
    }

    fn hear(&mut self, now: Now, heard: Heard) {
        match heard {
            Heard::FromDirector(bytes) => match decode_to_node(&bytes) {
                Ok(message) => {
                    if let ToNode::Refused(refusal) = &message {
                        self.report(format!("the director refuses this node: {refusal}"));
                    }
                    self.lock.hear(now, message);
                }
                Err(error) => {
                    self.station.unreadable += 1;
                    tracing::debug!("{error}");
                }
            },
            Heard::Director(true) => {
                tracing::info!("cluster: connected to a director");
                self.lock.connected(now);
            }
            Heard::Director(false) => tracing::warn!("cluster: the connection to a director ended"),
            // A scene that is received while another one is being adopted is dropped; it is requested again later.
            Heard::Scene(bytes) => self.adopting |= self.scenes.try_send(bytes).is_ok(),
            Heard::FromNode(..) | Heard::Node(..) => {}
        }
    }

    /// Logs a problem unless it is the one that was logged last.
    fn report(&mut self, problem: String) {
        if self.problem != problem {
            tracing::error!("cluster: {problem}");
            self.problem = problem;
        }
    }

    fn adopted(&mut self, adopted: Result<(u64, [u8; 32]), String>) {
        self.adopting = false;
        match adopted {
            Ok(scene) => {
                self.scene = scene;
                self.adopted += 1;
                tracing::info!("cluster: adopted revision {} of the director's scene", scene.0);
            }
            Err(error) => self.report(format!("the director's scene cannot be adopted: {error}")),
        }
    }

    fn draw(&mut self, now: Now, id: FrameId, bytes: &[u8]) {
        let HashedCue { cue, scene_hash } = match cue::decode(id.number, bytes) {
            Ok(cue) => cue,
            Err(error) => {
                self.report(format!("a cue cannot be read: {error}"));
                self.lock.failed(now, id);
                return;
            }
        };
        if self.scene != (cue.scene, scene_hash) {
            self.lock.failed(now, id);
            self.ask_scene(now);
            return;
        }
        let queue = Arc::clone(&self.queue);
        let reply = Box::new(move |pictures| queue.push_surely(Event::Drawn { id, pictures }));
        self.render.draw_cue(cue, reply);
    }

    fn ask_scene(&mut self, now: Now) {
        if self.adopting || self.asked_ns.is_some_and(|asked_ns| now.monotonic_ns < asked_ns + ASK_NS) {
            return;
        }
        if self.asked_ns.replace(now.monotonic_ns).is_none() {
            tracing::info!("cluster: the director has another scene, requesting it");
        }
        if let Err(error) = self.station.wire.ask_scene() {
            self.report(format!("cannot request the director's scene: {error}"));
        }
    }

    fn drawn(&mut self, now: Now, id: FrameId, pictures: Result<Pictures, CueError>) {
        match pictures {
            Ok(pictures) => {
                self.problem.clear();
                self.asked_ns = None;
                self.staged += 1;
                let queue = Arc::clone(&self.queue);
                let reply = Box::new(move |is_ready| queue.push_surely(Event::Prepared { id, is_ready }));
                self.pictures.insert(id, (pictures.clone(), self.staged));
                if !self.stage.prepare(self.staged, &pictures, reply) {
                    self.prepared(now, id, true);
                }
            }
            Err(error) => {
                self.lock.failed(now, id);
                match error {
                    CueError::Scene { .. } => self.ask_scene(now),
                    CueError::Replaced => {}
                    error => self.report(format!("a frame cannot be drawn: {error}")),
                }
            }
        }
    }

    /// The device has drawn a frame, and the windows are prepared to present it: the node is ready.
    fn prepared(&mut self, now: Now, id: FrameId, is_ready: bool) {
        let Some((pictures, _)) = self.pictures.get(&id) else { return };
        if !is_ready {
            self.pictures.remove(&id);
            self.report("the device of the windows was lost".to_owned());
            self.lock.failed(now, id);
            return;
        }
        let drawn_ns = u64::try_from(pictures.start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.drawn.note(drawn_ns);
        let report = Report { scene_hash: Some(self.scene.1), shown: self.shown };
        self.lock.drawn(now, id, drawn_ns, LockReport(report::encode(&report).into()));
    }

    fn carry_out(&mut self, now: Now, action: Action) -> Result<(), String> {
        match action {
            Action::Remember(epoch) => epoch_file::write(&self.station.party.epoch_file, epoch)?,
            Action::Send(message) => self.station.send(To::Directors, &encode_to_director(&message)),
            Action::Draw { id, cue, .. } => self.draw(now, id, cue.bytes()),
            Action::Show { id } => {
                if let Some((pictures, staged)) = self.pictures.remove(&id) {
                    self.stage.present(staged);
                    self.render.show(&pictures);
                    self.last = Some(pictures);
                    self.shown = id.number;
                    let at = clock::monotonic_ns();
                    tracing::trace!(target: FRAMES, "shown {} at {at}", frame_name(id));
                    if let Some(last_ns) = self.shown_ns.replace(now.monotonic_ns) {
                        self.intervals.note(now.monotonic_ns - last_ns);
                    }
                    self.is_black = false;
                }
            }
            Action::Discard { id } => {
                if let Some((_, staged)) = self.pictures.remove(&id) {
                    self.stage.discard(staged);
                }
            }
            Action::Black => {
                self.is_black = true;
                self.stage.black();
                if let Some(last) = self.last.take() {
                    self.render.show(&last.blackened());
                }
                tracing::warn!("cluster: no frame to show for {} s", self.station.party.rules.hold_ns as f64 * 1e-9);
            }
        }
        Ok(())
    }

    /// Notes the refusals of the network, and logs each new reason.
    fn tell_refusals(&mut self) {
        let new = refusals();
        if !new.connection.is_empty() && new.connection != self.refusals.connection {
            tracing::warn!("cluster: cannot connect to a director: {}", new.connection);
        }
        self.refusals = new;
    }

    fn state_name(&self) -> &'static str {
        match (self.lock.refused(), self.lock.is_led(self.station.clock.now())) {
            (Some(_), _) => "refused",
            (None, false) => "looking",
            (None, true) if self.is_black => "black",
            (None, true) => "led",
        }
    }

    fn tell_state(&mut self, now: Now) {
        let state = self.state_name();
        if self.state != state {
            (self.state, self.state_ns, self.told_looking) = (state, now.monotonic_ns, false);
            tracing::info!("cluster: node `{}` is {state}", self.station.party.name);
        }
        let is_long = now.monotonic_ns >= self.state_ns + LOOKING_NS;
        if state == "looking" && is_long && !std::mem::replace(&mut self.told_looking, true) {
            tracing::warn!(
                "cluster: no director answers: it does not run, still waits for other nodes, or does not accept this node's certificate"
            );
        }
    }

    fn publish(&mut self) {
        let counts = self.lock.counts();
        let reason = match self.lock.refused() {
            Some(refusal) => refusal.to_string(),
            None if self.problem.is_empty() && self.state == "looking" => self.refusals.connection.clone(),
            None => self.problem.clone(),
        };
        self.station.publish(ClusterFigures {
            state: self.state.to_owned(),
            reason,
            locked: self.lock.led_by().is_some()
                && self.lock.shown().is_some()
                && self.station.clock.distrusted().is_none(),
            epoch: self.lock.led_by().map_or(0, |epoch| epoch.counter),
            frame_number: self.shown,
            scene_hash: short(&self.scene.1),
            scene_revision: self.scene.0,
            counts: vec![
                ("shown", counts.shown),
                ("commit_late", counts.commit_late),
                ("show_late", counts.show_late),
                ("commit_without_picture", counts.commit_without_picture),
                ("left_out", counts.left_out),
                ("skipped", counts.skipped),
                ("without_verdict", counts.without_verdict),
                ("too_slow", counts.too_slow),
                ("failed", counts.failed),
                ("states_replaced", counts.states_replaced),
                ("lower_epoch", counts.lower_epoch),
                ("black", counts.black),
                ("adopted", self.adopted),
                ("refused_connections", self.refusals.connections),
                ("clock_steps", self.lock.clock_steps()),
                ("unreadable", self.station.unreadable),
                ("unsent", self.station.unsent),
            ],
            times: vec![("drawn", self.drawn.times()), ("interval", self.intervals.times())],
            ..self.station.figures()
        });
    }
}
