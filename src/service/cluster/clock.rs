//! The clocks that a process uses for the lock: the machine's monotonic clock, and International Atomic Time (TAI) if it can be trusted.
//!
//! TAI is passed to the lock only if its offset from UTC is set and a time service bounds the error of the clock by [`LARGEST_ERROR_US`]. Otherwise
//! frames are shown when COMMIT arrives, and `WatchStats` and the page report that the cluster is not locked.

use std::io;

use steradian_lock::clock::Now;

use crate::platform::{ClockState, clock};

/// Largest error with which a clock is trusted, us. The kernel's bound grows by 500 us per second between two corrections of the time service.
const LARGEST_ERROR_US: i64 = 1_000;
/// Interval between checks of the clock, ns.
const CHECK_NS: u64 = 1_000_000_000;
/// Maximum time between the readings of the two clocks, ns. If it is exceeded, both are read again.
const TOGETHER_NS: u64 = 100_000;
/// Maximum number of attempts to read both clocks within [`TOGETHER_NS`].
const READINGS: u32 = 4;

/// Returns the reason not to trust a clock; `None` if it is trusted.
fn distrust(state: &io::Result<ClockState>) -> Option<String> {
    let state = match state {
        Ok(state) => state,
        Err(error) => return Some(error.to_string()),
    };
    if !state.is_synchronised {
        Some("no time service steers it".to_owned())
    } else if state.tai_offset_s == 0 {
        Some("its offset of TAI from UTC is not set".to_owned())
    } else if state.largest_error_us > LARGEST_ERROR_US {
        Some(format!("its error may be {} us: must be at most {LARGEST_ERROR_US} us", state.largest_error_us))
    } else {
        None
    }
}

/// Returns the reason why the clock of this machine cannot be used for times of presentation; `None` if it can be used.
pub fn distrusted_clock() -> Option<String> {
    distrust(&clock::clock_state())
}

/// The clocks of the machine.
#[derive(Debug)]
pub(super) struct Clock {
    checked_ns: Option<u64>,
    /// The reason not to use TAI; `None`: it is used.
    distrusted: Option<String>,
    /// Whether TAI is used, as stated by the last log line; `None` if nothing has been logged yet.
    told: Option<bool>,
}

impl Clock {
    pub(super) fn new() -> Self {
        let distrusted = Some("it has not been checked yet".to_owned());
        Self { checked_ns: None, distrusted, told: None }
    }

    /// Returns the present time.
    pub(super) fn now(&self) -> Now {
        let monotonic_ns = clock::monotonic_ns();
        if self.distrusted.is_some() {
            return Now::monotonic(monotonic_ns);
        }
        // If the thread is interrupted between the two readings, they do not belong together: read the clocks again.
        let mut before_ns = monotonic_ns;
        for _ in 0..READINGS {
            let tai_ns = clock::tai_ns().ok();
            let after_ns = clock::monotonic_ns();
            if after_ns.saturating_sub(before_ns) < TOGETHER_NS {
                return Now { monotonic_ns: before_ns, tai_ns };
            }
            before_ns = after_ns;
        }
        Now::monotonic(before_ns)
    }

    /// Checks once a second whether TAI can be used; the log states a change.
    pub(super) fn check(&mut self, now: Now) {
        if self.checked_ns.is_some_and(|checked_ns| now.monotonic_ns < checked_ns + CHECK_NS) {
            return;
        }
        self.checked_ns = Some(now.monotonic_ns);
        self.distrusted = distrusted_clock();
        if self.told.replace(self.distrusted.is_none()) == Some(self.distrusted.is_none()) {
            return;
        }
        match &self.distrusted {
            Some(reason) => tracing::warn!(
                "cluster: the clock of this machine is not used, so frames are shown when COMMIT arrives: {reason}"
            ),
            None => tracing::info!("cluster: the clock of this machine is used for times of presentation"),
        }
    }

    /// Returns the reason not to use TAI; `None` if it is used.
    pub(super) fn distrusted(&self) -> Option<&str> {
        self.distrusted.as_deref()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    const GOOD: ClockState = ClockState { tai_offset_s: 37, is_synchronised: true, largest_error_us: 1_000 };

    #[test]
    fn only_a_disciplined_clock_with_an_offset_is_trusted() {
        assert_eq!(distrust(&Ok(GOOD)), None);
        let wrong = [
            ClockState { tai_offset_s: 0, ..GOOD },
            ClockState { is_synchronised: false, ..GOOD },
            ClockState { largest_error_us: 1_001, ..GOOD },
        ];
        let reasons = wrong.map(|state| distrust(&Ok(state)).unwrap());
        assert!(reasons[2].contains("may be 1001 us"), "{reasons:?}");
        assert!(reasons[0] != reasons[1] && reasons[1] != reasons[2]);
        assert!(distrust(&Err(io::ErrorKind::Unsupported.into())).is_some());
    }

    #[test]
    fn the_time_of_a_distrusted_clock_is_not_passed_on() {
        let mut clock = Clock::new();
        assert_eq!(clock.now().tai_ns, None, "not before the first check");
        let first = clock.now();
        clock.check(first);
        let is_trusted = distrust(&clock::clock_state()).is_none();
        assert_eq!((clock.now().tai_ns.is_some(), clock.distrusted().is_none()), (is_trusted, is_trusted));
        clock.distrusted = None;
        let (now, tai_ns) = (clock.now(), clock::tai_ns());
        assert_eq!(now.tai_ns.is_some(), tai_ns.is_ok());
        assert!(now.monotonic_ns >= first.monotonic_ns);
        if let (Some(before), Ok(after)) = (now.tai_ns, tai_ns) {
            assert!(after >= before);
        }
    }
}
