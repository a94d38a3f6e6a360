//! Figures of a cluster for `WatchStats`, `/metrics` and the page.

use std::{
    collections::VecDeque,
    sync::{Mutex, MutexGuard, PoisonError},
};

use steradian_lock::director;

/// Number of values from which a distribution is computed.
const WINDOW: usize = 1024;

/// State of the cluster as one process knows it. Times are in ms.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ClusterFigures {
    /// Name of the cluster.
    pub(crate) cluster: String,
    /// `director`, or the name of the node.
    pub(crate) process: String,
    /// Director: `gathering`, `starting`, `running`, `deposed`. Node: `looking`, `refused`, `led`, `black`.
    pub(crate) state: String,
    /// The reason why it is not running; empty if it is.
    pub(crate) reason: String,
    /// Whether all nodes show the same frame at common times: the green light.
    pub(crate) locked: bool,
    /// Counter of the epoch.
    pub(crate) epoch: u64,
    /// Newest frame: committed (director), shown (node).
    pub(crate) frame_number: u64,
    /// Version of the program.
    pub(crate) version: String,
    /// Hash of the configuration, hexadecimal.
    pub(crate) configuration: String,
    /// Hash of the scene, hexadecimal.
    pub(crate) scene_hash: String,
    /// Revision of the scene.
    pub(crate) scene_revision: u64,
    /// Whether the machine's clock is trusted for times of presentation.
    pub(crate) clock: bool,
    /// Whether the threads of the network have real-time scheduling.
    pub(crate) real_time: bool,
    /// Counts by name.
    pub(crate) counts: Vec<(&'static str, u64)>,
    /// Times by name.
    pub(crate) times: Vec<(&'static str, Times)>,
    /// Director: its nodes.
    pub(crate) nodes: Vec<NodeFigures>,
}

/// A node as the director sees it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NodeFigures {
    pub(crate) name: String,
    /// `absent`, `refused`, `out` or `in`.
    pub(crate) state: &'static str,
    /// The reason why it is not in; empty if it is.
    pub(crate) reason: String,
    /// Time from STATE to READY.
    pub(crate) ready: Times,
    /// Time that it needed to draw.
    pub(crate) drawn: Times,
    /// Number of times that it was left out.
    pub(crate) out: u64,
    /// Number of its HELLO messages that were refused.
    pub(crate) refused: u64,
    pub(crate) version: String,
    pub(crate) adapter: String,
    /// Hash of the scene that it draws, hexadecimal.
    pub(crate) scene_hash: String,
    /// Number of the last frame that it has shown.
    pub(crate) frame_number: u64,
    /// Whether its clock is trusted.
    pub(crate) clock: bool,
}

/// Median, 99th percentile and maximum of the last 1024 values, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Times {
    pub(crate) median_ms: f64,
    pub(crate) p99_ms: f64,
    pub(crate) max_ms: f64,
}

/// The last values of a time.
#[derive(Clone, Debug, Default)]
pub(super) struct Window(VecDeque<f64>);

impl Window {
    pub(super) fn note(&mut self, ns: u64) {
        if self.0.len() == WINDOW {
            self.0.pop_front();
        }
        self.0.push_back(ns as f64 * 1e-6);
    }

    pub(super) fn times(&self) -> Times {
        let mut values: Vec<f64> = self.0.iter().copied().collect();
        values.sort_by(f64::total_cmp);
        let Some(last) = values.len().checked_sub(1) else { return Times::default() };
        let share = |share: f64| values[(share * last as f64).round() as usize];
        Times { median_ms: share(0.5), p99_ms: share(0.99), max_ms: values[last] }
    }
}

/// The figures, shared by the cluster's thread and the calls of clients.
#[derive(Debug, Default)]
pub(crate) struct SharedFigures(Mutex<ClusterFigures>);

impl SharedFigures {
    fn lock(&self) -> MutexGuard<'_, ClusterFigures> {
        // Nothing can panic while the lock is held, so poisoned figures are consistent.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn set(&self, figures: ClusterFigures) {
        *self.lock() = figures;
    }

    pub(crate) fn get(&self) -> ClusterFigures {
        self.lock().clone()
    }
}

/// Returns the first eight bytes of a hash as hexadecimal digits.
pub(super) fn short(hash: &[u8; 32]) -> String {
    hash[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the name of a phase of the director.
pub(super) fn phase_name(phase: director::Phase) -> &'static str {
    match phase {
        director::Phase::Gathering => "gathering",
        director::Phase::Starting => "starting",
        director::Phase::Running => "running",
        director::Phase::Deposed => "deposed",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_keeps_the_last_values() {
        let mut window = Window::default();
        assert_eq!(window.times(), Times::default());
        window.note(9_000_000_000);
        (1..=WINDOW as u64).for_each(|ms| window.note(ms * 1_000_000));
        let times = window.times();
        assert!((times.median_ms - 512.0).abs() < 1.5 && (times.p99_ms - 1014.0).abs() < 1.5, "{times:?}");
        assert!((times.max_ms - 1024.0).abs() < 1e-9, "the first value has left the window");
    }
}
