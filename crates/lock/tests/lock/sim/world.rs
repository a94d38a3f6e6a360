//! The simulated cluster: processes, connections, clocks, and the queue of events.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashMap, HashSet, VecDeque},
};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use steradian_lock::{
    Cue, Director, Epoch, FrameId, Identity, Mask, Node, NodeId, Now, director,
    messages::{Hello, Ready, Report, ToDirector, ToNode},
    node,
};

use network::{Connection, Message, Route};

use super::{
    checker::Checker,
    setup::{Fault, MS, Mutation, Setup},
};

mod faults;
mod network;

/// TAI at the start of the simulation, ns.
const TAI_ORIGIN_NS: i64 = 1_800_000_000_000_000_000;
/// Number of directors of a cluster; the second one starts only by [`Fault::StartDirector`].
const DIRECTORS: usize = 2;

#[derive(Clone, Debug)]
enum Event {
    Delivered {
        route: Route,
        message: Message,
    },
    WakeNode {
        node: usize,
        life: u64,
    },
    WakeDirector {
        director: usize,
        life: u64,
    },
    Drawn {
        node: usize,
        life: u64,
        face: usize,
        id: FrameId,
        drawn_ns: u64,
        is_real: bool,
    },
    StartNode(usize),
    StartDirector(usize),
    /// A message on a connection with [`OnLoss::Again`] arrives, or its time-out expires.
    Arrived {
        connection: Route,
        life: u64,
        number: u64,
        sent_ns: u64,
    },
    TimedOut {
        connection: Route,
        life: u64,
        number: u64,
        attempt: u32,
    },
    /// The other side notices that the connection between a node and a director was lost or restored.
    Lost {
        director: usize,
        node: usize,
    },
    Connected {
        node: usize,
    },
    Fault(Fault),
}

#[derive(Debug)]
struct Scheduled {
    at_ns: u64,
    order: u64,
    event: Event,
}

impl PartialEq for Scheduled {
    fn eq(&self, other: &Self) -> bool {
        (self.at_ns, self.order) == (other.at_ns, other.order)
    }
}
impl Eq for Scheduled {}
impl PartialOrd for Scheduled {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Scheduled {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at_ns, self.order).cmp(&(other.at_ns, other.order))
    }
}

/// Clock and state of a process.
#[derive(Clone, Debug)]
struct Process {
    /// Changes when the process ends or starts.
    life: u64,
    hung_until_ns: u64,
    boot_ns: u64,
    tai_error_ns: i64,
    is_disciplined: bool,
    wakes_at_ns: u64,
}

impl Process {
    fn now(&self, now_ns: u64) -> Now {
        let monotonic_ns = now_ns - self.boot_ns;
        let tai_ns = TAI_ORIGIN_NS.saturating_add_unsigned(now_ns) + self.tai_error_ns;
        Now { monotonic_ns, tai_ns: self.is_disciplined.then_some(tai_ns) }
    }
}

#[derive(Debug)]
pub struct NodeProcess {
    process: Process,
    /// One state machine, or one for each director with [`Mutation::TwoPromises`]. Empty if the process has ended.
    faces: Vec<Node>,
    inbox: VecDeque<(usize, ToNode)>,
    finished: VecDeque<(usize, FrameId, u64)>,
    /// The promised epoch on disk.
    disk: Epoch,
    /// The process started again at this time and has not shown anything yet.
    restarted_ns: Option<u64>,
    pub shows: Vec<u64>,
    pub black: u64,
    pub was_harmed: bool,
    /// Sums of the counters of all processes, ended or running.
    pub counts: node::Counts,
}

#[derive(Debug)]
pub struct DirectorProcess {
    process: Process,
    machine: Option<Director>,
    inbox: VecDeque<(NodeId, ToDirector)>,
    pub deposed_by: Option<Epoch>,
    pub commits: u64,
}

/// A running simulation.
#[derive(Debug)]
pub struct World {
    setup: Setup,
    random: ChaCha8Rng,
    events: BinaryHeap<Reverse<Scheduled>>,
    order: u64,
    now_ns: u64,
    pub nodes: Vec<NodeProcess>,
    pub directors: Vec<DirectorProcess>,
    cut: HashSet<(usize, usize)>,
    /// Arrival time of the last message of a connection.
    arrives_ns: HashMap<Route, u64>,
    connections: HashMap<Route, Connection>,
    pub checker: Checker,
    state_sent_ns: HashMap<FrameId, u64>,
    /// Time from STATE to the COMMIT of all nodes, ns.
    pub all_ready_ns: Vec<u64>,
    /// Time from the start of a killed process to its first picture, ns.
    pub recoveries_ns: Vec<u64>,
}

impl World {
    pub fn new(setup: Setup) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(setup.seed);
        let error_ns = setup.clock_error_ns;
        let mut process = || Process {
            life: 0,
            hung_until_ns: 0,
            boot_ns: 0,
            tai_error_ns: random.random_range(-error_ns..=error_ns),
            is_disciplined: true,
            wakes_at_ns: u64::MAX,
        };
        let nodes = (0..setup.rules.nodes).map(|_| NodeProcess {
            process: process(),
            faces: Vec::new(),
            inbox: VecDeque::new(),
            finished: VecDeque::new(),
            disk: Epoch::NONE,
            restarted_ns: None,
            shows: Vec::new(),
            black: 0,
            was_harmed: false,
            counts: node::Counts::default(),
        });
        let nodes: Vec<NodeProcess> = nodes.collect();
        let directors = (0..DIRECTORS).map(|_| DirectorProcess {
            process: process(),
            machine: None,
            inbox: VecDeque::new(),
            deposed_by: None,
            commits: 0,
        });
        let directors = directors.collect();
        let checker = Checker::new(setup.rules, TAI_ORIGIN_NS, error_ns);
        let mut world = Self {
            setup,
            random,
            events: BinaryHeap::new(),
            order: 0,
            now_ns: 0,
            nodes,
            directors,
            cut: HashSet::new(),
            arrives_ns: HashMap::new(),
            connections: HashMap::new(),
            checker,
            state_sent_ns: HashMap::new(),
            all_ready_ns: Vec::new(),
            recoveries_ns: Vec::new(),
        };
        for node in 0..world.nodes.len() {
            let at_ns = world.random.random_range(0..200 * MS);
            world.push(at_ns, Event::StartNode(node));
        }
        world.push(0, Event::StartDirector(0));
        world
    }

    fn push(&mut self, at_ns: u64, event: Event) {
        self.order += 1;
        self.events.push(Reverse(Scheduled { at_ns: at_ns.max(self.now_ns), order: self.order, event }));
    }

    pub fn at(&mut self, at_ns: u64, fault: Fault) {
        self.push(at_ns, Event::Fault(fault));
    }

    /// Runs all events until a time.
    pub fn run_until(&mut self, end_ns: u64) {
        while self.events.peek().is_some_and(|Reverse(next)| next.at_ns <= end_ns) {
            let Some(Reverse(Scheduled { at_ns, event, .. })) = self.events.pop() else { break };
            self.now_ns = at_ns;
            self.handle(event);
        }
        self.now_ns = end_ns;
    }

    /// Runs to the end and compares all frames.
    pub fn finish(&mut self, end_ns: u64) {
        self.run_until(end_ns);
        self.checker.finish();
    }

    pub fn director(&self, index: usize) -> Option<&Director> {
        self.directors[index].machine.as_ref()
    }

    pub fn node(&self, index: usize) -> Option<&Node> {
        self.nodes[index].faces.first()
    }

    fn handle(&mut self, event: Event) {
        match event {
            Event::Delivered { route, message } => self.deliver(route, message),
            Event::Arrived { connection, life, number, sent_ns } => self.arrived(connection, life, number, sent_ns),
            Event::TimedOut { connection, life, number, attempt } => {
                self.timed_out(connection, life, number, attempt);
            }
            Event::WakeNode { node, life } => {
                let process = &mut self.nodes[node].process;
                if process.life == life && process.wakes_at_ns <= self.now_ns {
                    process.wakes_at_ns = u64::MAX;
                    Self::stall(process, &self.setup, &mut self.random, self.now_ns);
                    self.run_node(node);
                }
            }
            Event::WakeDirector { director, life } => {
                let process = &mut self.directors[director].process;
                if process.life == life && process.wakes_at_ns <= self.now_ns {
                    process.wakes_at_ns = u64::MAX;
                    Self::stall(process, &self.setup, &mut self.random, self.now_ns);
                    self.run_director(director);
                }
            }
            Event::Drawn { node, life, face, id, drawn_ns, is_real } => {
                if self.nodes[node].process.life != life {
                    return;
                }
                if is_real {
                    self.checker.draw_ended(node, id);
                }
                if is_real != (self.setup.mutation == Some(Mutation::ReadyTooEarly)) {
                    self.nodes[node].finished.push_back((face, id, drawn_ns));
                    self.run_node(node);
                }
            }
            Event::StartNode(node) => self.start_node(node),
            Event::StartDirector(director) => self.start_director(director),
            Event::Lost { director, node } => {
                let now = self.directors[director].process.now(self.now_ns);
                if let Some(machine) = &mut self.directors[director].machine {
                    machine.lost(now, NodeId(node as u16));
                    self.run_director(director);
                }
            }
            Event::Connected { node } => {
                let now = self.nodes[node].process.now(self.now_ns);
                self.nodes[node].faces.iter_mut().for_each(|face| face.connected(now));
                self.run_node(node);
            }
            Event::Fault(fault) => self.fault(fault),
        }
    }

    fn end_node(&mut self, node: usize) {
        self.reset_connections(|route| route.1 == node);
        let process = &mut self.nodes[node];
        process.faces.clear();
        process.inbox.clear();
        process.finished.clear();
        process.process.life += 1;
    }

    fn start_node(&mut self, node: usize) {
        let is_restart = self.nodes[node].process.life > 0;
        self.end_node(node);
        let run = self.random.random();
        let now_ns = self.now_ns;
        let faces = if self.setup.mutation == Some(Mutation::TwoPromises) { DIRECTORS } else { 1 };
        let process = &mut self.nodes[node];
        process.process.boot_ns = now_ns;
        process.process.hung_until_ns = 0;
        process.process.wakes_at_ns = u64::MAX;
        process.restarted_ns = is_restart.then_some(now_ns);
        let now = process.process.now(now_ns);
        let new = || Node::new(self.setup.rules, NodeId(node as u16), run, process.disk, Identity::default(), now);
        process.faces = (0..faces).map(|_| new()).collect();
        self.run_node(node);
    }

    fn start_director(&mut self, director: usize) {
        let run = self.random.random();
        self.reset_connections(|route| route.0 == director);
        let process = &mut self.directors[director];
        process.process.life += 1;
        process.process.boot_ns = self.now_ns;
        process.process.hung_until_ns = 0;
        process.process.wakes_at_ns = u64::MAX;
        process.inbox.clear();
        process.machine = Some(Director::new(self.setup.rules, run, Identity::default()));
        for node in 0..self.nodes.len() {
            let at_ns = self.now_ns + self.random.random_range(0..100 * MS);
            self.push(at_ns, Event::Connected { node });
        }
        self.run_director(director);
    }

    /// On a busy processor a process that is woken waits for its turn.
    fn stall(process: &mut Process, setup: &Setup, random: &mut ChaCha8Rng, now_ns: u64) {
        let Some(stall) = setup.stall.as_ref().filter(|_| process.hung_until_ns < now_ns) else { return };
        let stall_ns = stall.draw_ns(random);
        if stall_ns > 1_000 {
            process.hung_until_ns = now_ns + stall_ns;
        }
    }

    fn wake_node_at(&mut self, node: usize, at_ns: u64) {
        let process = &mut self.nodes[node].process;
        if at_ns < process.wakes_at_ns {
            process.wakes_at_ns = at_ns;
            let event = Event::WakeNode { node, life: process.life };
            self.push(at_ns, event);
        }
    }

    fn wake_director_at(&mut self, director: usize, at_ns: u64) {
        let process = &mut self.directors[director].process;
        if at_ns < process.wakes_at_ns {
            process.wakes_at_ns = at_ns;
            let event = Event::WakeDirector { director, life: process.life };
            self.push(at_ns, event);
        }
    }

    /// Lets a node drain its queue, act and carry out its actions.
    fn run_node(&mut self, node: usize) {
        let now_ns = self.now_ns;
        let (mutation, process) = (self.setup.mutation, &mut self.nodes[node]);
        if process.faces.is_empty() {
            return;
        }
        if process.process.hung_until_ns > now_ns {
            let until_ns = process.process.hung_until_ns;
            self.wake_node_at(node, until_ns);
            return;
        }
        let now = process.process.now(now_ns);
        let mut done = Vec::new();
        while let Some((face, id, drawn_ns)) = process.finished.pop_front() {
            process.faces[face].drawn(now, id, drawn_ns, Report::default());
        }
        while let Some((director, mut message)) = process.inbox.pop_front() {
            let face = if mutation == Some(Mutation::TwoPromises) { director } else { 0 };
            if let (ToNode::Commit(commit), Some(Mutation::MaskIgnored)) = (&mut message, mutation) {
                commit.mask = (0..self.setup.rules.nodes).map(NodeId).collect::<Mask>();
            }
            if let ToNode::State(state) = &message
                && process.faces[face].led_by() == Some(state.id.epoch)
                && mutation != Some(Mutation::TwoPromises)
            {
                self.checker.state_heard(node, state.id);
            }
            process.faces[face].hear(now, message);
            if mutation == Some(Mutation::Backlog) {
                // The checker learns of every message that has arrived before the node draws.
                for (_, waiting) in &process.inbox {
                    if let ToNode::State(state) = waiting {
                        self.checker.state_heard(node, state.id);
                    }
                }
                done.extend(process.faces[face].act(now).into_iter().map(|action| (face, action)));
            }
        }
        for (face, machine) in process.faces.iter_mut().enumerate() {
            done.extend(machine.act(now).into_iter().map(|action| (face, action)));
        }
        process.counts = process.faces[0].counts();
        for (face, action) in done {
            self.carry_out_node(node, face, action);
        }
        let process = &self.nodes[node];
        let wake = process.faces.iter().map(Node::wake_at).min().unwrap_or(u64::MAX);
        if wake != u64::MAX {
            let delay_ns = self.setup.timer.draw_ns(&mut self.random);
            let at_ns = (wake + self.nodes[node].process.boot_ns).max(now_ns + 1) + delay_ns;
            self.wake_node_at(node, at_ns);
        }
    }

    fn carry_out_node(&mut self, node: usize, face: usize, action: node::Action) {
        let now_ns = self.now_ns;
        match action {
            node::Action::Remember(epoch) => self.nodes[node].disk = epoch,
            node::Action::Send(message) => {
                if let ToDirector::Ready(ready) = &message {
                    self.checker.voted(node, ready.id, now_ns);
                    if self.setup.mutation == Some(Mutation::CommitIgnored) {
                        self.show(node, ready.id);
                    }
                }
                for director in 0..DIRECTORS {
                    if self.setup.mutation != Some(Mutation::TwoPromises) || director == face {
                        self.send_to_director(director, node, message.clone());
                    }
                }
            }
            node::Action::Draw { id, .. } => {
                self.checker.draw_begins(node, id);
                let drawn_ns = self.setup.draw.draw_ns(&mut self.random);
                let life = self.nodes[node].process.life;
                let event = |is_real| Event::Drawn { node, life, face, id, drawn_ns, is_real };
                if self.setup.mutation == Some(Mutation::ReadyTooEarly) {
                    self.push(now_ns, event(false));
                }
                self.push(now_ns + drawn_ns, event(true));
            }
            node::Action::Show { id } => {
                if !matches!(self.setup.mutation, Some(Mutation::CommitIgnored | Mutation::NothingShown)) {
                    self.show(node, id);
                }
            }
            node::Action::Discard { .. } => {}
            node::Action::Black => self.nodes[node].black += 1,
        }
    }

    fn show(&mut self, node: usize, id: FrameId) {
        let now_ns = self.now_ns;
        self.checker.shown(node, id, now_ns);
        self.nodes[node].shows.push(now_ns);
        if let Some(restarted_ns) = self.nodes[node].restarted_ns.take() {
            self.recoveries_ns.push(now_ns - restarted_ns);
        }
    }

    fn run_director(&mut self, director: usize) {
        let now_ns = self.now_ns;
        let process = &mut self.directors[director];
        if process.process.hung_until_ns > now_ns {
            let until_ns = process.process.hung_until_ns;
            self.wake_director_at(director, until_ns);
            return;
        }
        let now = process.process.now(now_ns);
        let Some(machine) = &mut process.machine else { return };
        while let Some((from, message)) = process.inbox.pop_front() {
            machine.hear(now, from, message);
        }
        if self.setup.mutation == Some(Mutation::NoQuorum) && machine.epoch() == Epoch::NONE {
            for node in (0..self.nodes.len()).filter(|&node| self.cut.contains(&(director, node))) {
                let hello = Hello { run: 1, promised: Epoch::NONE, identity: Identity::default() };
                machine.hear(now, NodeId(node as u16), ToDirector::Hello(hello));
            }
        }
        // Cues are composed immediately, so one more round processes them.
        let mut copies = 0;
        for _ in 0..2 {
            let Some(machine) = &mut self.directors[director].machine else { return };
            for action in machine.act(now) {
                self.carry_out_director(director, now, action, &mut copies);
            }
        }
        let wake = self.directors[director].machine.as_ref().and_then(Director::wake_at);
        if let Some(wake) = wake {
            let delay_ns = self.setup.timer.draw_ns(&mut self.random);
            let at_ns = (wake + self.directors[director].process.boot_ns).max(now_ns + 1) + delay_ns;
            self.wake_director_at(director, at_ns);
        }
    }

    /// `copies` counts the messages of this turn: they leave one after the other.
    fn carry_out_director(&mut self, director: usize, now: Now, action: director::Action, copies: &mut u64) {
        let now_ns = self.now_ns;
        let copies_ns = *copies * self.setup.network.per_node_ns;
        match action {
            director::Action::Send { to, message } => {
                self.send_to_node(director, usize::from(to.0), copies_ns, &message);
                *copies += 1;
            }
            director::Action::SendAll(message) => {
                if let ToNode::Commit(commit) = &message {
                    if !self.checker.committed.contains_key(&commit.id) {
                        self.directors[director].commits += 1;
                        let sent_ns = self.state_sent_ns.get(&commit.id).copied();
                        if let Some(sent_ns) = sent_ns.filter(|_| commit.mask.len() == self.nodes.len()) {
                            self.all_ready_ns.push(now_ns - sent_ns);
                        }
                    }
                    self.checker.committed(*commit, now_ns);
                }
                if let ToNode::State(state) = &message {
                    self.state_sent_ns.insert(state.id, now_ns);
                    self.forge_votes(director, now, state.id);
                }
                for node in 0..self.nodes.len() {
                    let after_ns = copies_ns + node as u64 * self.setup.network.per_node_ns;
                    self.send_to_node(director, node, after_ns, &message);
                }
                *copies += self.nodes.len() as u64;
            }
            director::Action::Compose { id, .. } => {
                let Some(machine) = &mut self.directors[director].machine else { return };
                if let Ok(cue) = Cue::new(&id.number.to_le_bytes()) {
                    machine.composed(now, id, cue);
                }
            }
            director::Action::Deposed { by } => self.directors[director].deposed_by = Some(by),
        }
    }

    /// With [`Mutation::NoQuorum`], votes in place of all nodes that the director does not reach.
    fn forge_votes(&mut self, director: usize, now: Now, id: FrameId) {
        if self.setup.mutation != Some(Mutation::NoQuorum) {
            return;
        }
        let Some(machine) = &mut self.directors[director].machine else { return };
        for node in (0..self.nodes.len()).filter(|&node| self.cut.contains(&(director, node))) {
            let ready = Ready { id, drawn_ns: 0, has_clock: true, report: Report::default() };
            machine.hear(now, NodeId(node as u16), ToDirector::Ready(ready));
        }
    }

    fn deliver(&mut self, (director, node, _): Route, message: Message) {
        match message {
            Message::ToNode(message) if !self.nodes[node].faces.is_empty() => {
                self.nodes[node].inbox.push_back((director, message));
                Self::stall(&mut self.nodes[node].process, &self.setup, &mut self.random, self.now_ns);
                self.run_node(node);
            }
            Message::ToDirector(message) if self.directors[director].machine.is_some() => {
                self.directors[director].inbox.push_back((NodeId(node as u16), message));
                Self::stall(&mut self.directors[director].process, &self.setup, &mut self.random, self.now_ns);
                self.run_director(director);
            }
            Message::ToNode(_) | Message::ToDirector(_) => {}
        }
    }
}
