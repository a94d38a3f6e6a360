//! Times of events, and the clock that machines share.
//!
//! All times inside a process are read from its monotonic clock. Only times of presentation are compared between machines; they are International
//! Atomic Time (TAI), which the caller passes in if the offset of TAI is set and the clock is disciplined to a millisecond. If a clock is set, its
//! offset from the monotonic clock changes; the clock is then distrusted for [`SETTLE_NS`].

/// If the offset between the two clocks changes by more than this, the clock was set (a step), ns.
pub const STEP_NS: u64 = 1_000_000;
/// Rate by which two clocks of one machine may drift apart: one part in this number (500 ppm, the limit of NTP).
const DRIFT: u64 = 2_000;
/// Time for which a clock is distrusted after it was set, ns.
pub const SETTLE_NS: u64 = 1_000_000_000;

/// Time at which an event happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Now {
    /// Monotonic time of the process, ns.
    pub monotonic_ns: u64,
    /// TAI, ns since 1970; `None`: its offset is not set, or the clock is not disciplined to 1 ms.
    pub tai_ns: Option<i64>,
}

impl Now {
    /// Creates a monotonic time without a TAI.
    pub fn monotonic(monotonic_ns: u64) -> Self {
        Self { monotonic_ns, tai_ns: None }
    }
}

/// Converts between monotonic time and TAI, and detects steps.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// TAI minus monotonic time at the last observation, and its monotonic time.
    seen: Option<(i64, u64)>,
    /// The last offset that was trusted.
    trusted_offset_ns: Option<i64>,
    distrusted_until_ns: u64,
    is_disciplined: bool,
    now_ns: u64,
    /// Number of steps detected.
    pub steps: u64,
}

impl Clock {
    /// Records the time of an event, and detects whether the clock was set.
    pub fn observe(&mut self, now: Now) {
        self.now_ns = self.now_ns.max(now.monotonic_ns);
        self.is_disciplined = now.tai_ns.is_some();
        let Some(tai_ns) = now.tai_ns else { return };
        let offset_ns = tai_ns.saturating_sub_unsigned(now.monotonic_ns);
        if let Some((known_ns, at_ns)) = self.seen {
            let tolerance_ns = STEP_NS + now.monotonic_ns.saturating_sub(at_ns) / DRIFT;
            if offset_ns.abs_diff(known_ns) > tolerance_ns {
                self.steps += 1;
                self.distrusted_until_ns = now.monotonic_ns.saturating_add(SETTLE_NS);
            }
        }
        self.seen = Some((offset_ns, now.monotonic_ns));
        if self.is_trusted() {
            self.trusted_offset_ns = Some(offset_ns);
        }
    }

    /// Whether times of presentation can be met: the clock is disciplined, and was not set within the last [`SETTLE_NS`].
    pub fn is_trusted(&self) -> bool {
        self.is_disciplined && self.now_ns >= self.distrusted_until_ns
    }

    /// TAI of a monotonic time; `None` without a trusted clock.
    pub fn tai_ns(&self, monotonic_ns: u64) -> Option<i64> {
        let offset_ns = self.trusted_offset_ns.filter(|_| self.is_trusted())?;
        Some(offset_ns.saturating_add_unsigned(monotonic_ns))
    }

    /// Monotonic time of a TAI, by the last trusted offset: setting the clock does not move due times. Times before the origin of
    /// the monotonic clock are 0. `None` if the clock was never trusted.
    pub fn monotonic_ns(&self, tai_ns: i64) -> Option<u64> {
        Some(u64::try_from(tai_ns.saturating_sub(self.trusted_offset_ns?)).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    fn at(monotonic_ns: u64, offset_ns: i64) -> Now {
        Now { monotonic_ns, tai_ns: Some(offset_ns.saturating_add_unsigned(monotonic_ns)) }
    }

    #[test]
    fn slewing_is_no_step_and_setting_is_one() {
        let mut clock = Clock::default();
        // 400 ppm for ten seconds.
        for second in 0..10 {
            clock.observe(at(second * SECOND, 5_000_000_000 + 400_000 * second as i64));
        }
        assert_eq!((clock.steps, clock.is_trusted()), (0, true));
        clock.observe(at(10 * SECOND, 5_010_000_000));
        assert_eq!((clock.steps, clock.is_trusted()), (1, false));
        assert_eq!(clock.tai_ns(0), None);
        // Presentations that were due are still due at the same monotonic time.
        assert_eq!(clock.monotonic_ns(15_003_600_000), Some(10 * SECOND));
        clock.observe(at(11 * SECOND, 5_010_000_000));
        assert!(clock.is_trusted());
        assert_eq!(clock.tai_ns(11 * SECOND), Some(16_010_000_000));
    }

    #[test]
    fn a_clock_that_is_not_disciplined_gives_no_time() {
        let mut clock = Clock::default();
        clock.observe(Now::monotonic(5));
        assert_eq!((clock.is_trusted(), clock.tai_ns(5), clock.monotonic_ns(5)), (false, None, None));
        clock.observe(at(6, 100));
        assert_eq!(clock.tai_ns(7), Some(107));
        clock.observe(Now::monotonic(8));
        assert_eq!((clock.is_trusted(), clock.monotonic_ns(107)), (false, Some(7)));
        // Times before the origin.
        assert_eq!(clock.monotonic_ns(-5), Some(0));
    }
}
