//! The times of a process for the lock.

use std::time::Instant;

use steradian_lock::clock::Now;

/// Monotonic time since the start of the process's part in the cluster. Clocks of machines are not read: frames are shown when COMMIT arrives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    start: Instant,
}

impl Clock {
    pub(super) fn new() -> Self {
        Self { start: Instant::now() }
    }

    /// Returns the present time.
    pub(super) fn now(&self) -> Now {
        Now::monotonic(u64::try_from(self.start.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }
}
