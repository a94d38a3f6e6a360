//! Common parts of the threads of a director and of a node: their place in the cluster, the wire, and figures.

use std::{
    sync::{Arc, mpsc::Receiver},
    time::Duration,
};

use steradian_lock::{clock::Now, messages::FrameId};

use super::{
    Party,
    clock::Clock,
    figures::{ClusterFigures, SharedFigures, short},
    wire::{To, Wire},
};

/// Log target of frames: one line per message of a director and per shown frame of a node, with the monotonic time in ns, which is the same in all
/// processes of a machine. `cargo bench --bench cluster` reads them.
pub(super) const FRAMES: &str = "steradian::cluster::frames";
/// Time between two updates of the figures, ns.
const FIGURES_NS: u64 = 200_000_000;

/// State of a process of the cluster, owned by its thread.
pub(super) struct Station {
    pub(super) party: Party,
    pub(super) clock: Clock,
    pub(super) wire: Box<dyn Wire>,
    /// Messages that could not be read.
    pub(super) unreadable: u64,
    /// Messages that could not be sent.
    pub(super) unsent: u64,
    real_time: bool,
    figures: Arc<SharedFigures>,
    figures_ns: u64,
    /// Time at which the process began to take part.
    pub(super) begun_ns: u64,
}

impl Station {
    /// Creates the state. `real_time` states whether the threads of the wire have real-time scheduling.
    pub(super) fn new(party: Party, (wire, real_time): (Box<dyn Wire>, bool), figures: Arc<SharedFigures>) -> Self {
        let mut clock = Clock::new();
        let now = clock.now();
        clock.check(now);
        let begun_ns = now.monotonic_ns;
        Self { party, clock, wire, unreadable: 0, unsent: 0, real_time, figures, figures_ns: 0, begun_ns }
    }

    /// Waits for an event, until `wake_ns` or until figures are due. Returns the time at the end of the wait, and all events.
    pub(super) fn wait<'a, T>(
        &self,
        events: &'a Receiver<T>,
        wake_ns: u64,
    ) -> (Now, impl Iterator<Item = T> + use<'a, T>) {
        let wait_ns = wake_ns.min(self.figures_ns).saturating_sub(self.clock.now().monotonic_ns);
        let first = events.recv_timeout(Duration::from_nanos(wait_ns)).ok();
        (self.clock.now(), first.into_iter().chain(events.try_iter()))
    }

    /// Sends a message; one that cannot be sent is counted.
    pub(super) fn send(&mut self, to: To, bytes: &[u8]) {
        if let Err(error) = self.wire.send(to, bytes) {
            self.unsent += 1;
            tracing::debug!("cluster: {error}");
        }
    }

    /// Returns whether figures are due. If they are, sets the time at which they are due next.
    pub(super) fn is_figures_time(&mut self, now: Now) -> bool {
        let is_due = now.monotonic_ns >= self.figures_ns;
        if is_due {
            self.figures_ns = now.monotonic_ns + FIGURES_NS;
            self.clock.check(now);
        }
        is_due
    }

    /// Returns the figures of the process, without those of its role.
    pub(super) fn figures(&self) -> ClusterFigures {
        ClusterFigures {
            cluster: self.party.cluster.clone(),
            process: self.party.name.clone(),
            version: self.party.identity.version.clone(),
            configuration: short(&self.party.identity.configuration.0),
            clock: self.clock.distrusted().is_none(),
            real_time: self.real_time,
            ..ClusterFigures::default()
        }
    }

    pub(super) fn publish(&self, figures: ClusterFigures) {
        self.figures.set(figures);
    }
}

/// Returns the name of a frame in lines of [`FRAMES`]: the epoch's counter, the director's random number, and the number of the frame.
pub(super) fn frame_name(FrameId { epoch, number }: FrameId) -> String {
    format!("{}.{:016x} {number}", epoch.counter, epoch.run)
}
