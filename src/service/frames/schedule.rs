//! Determines when a subscriber's next frame is due.
//!
//! The first frame is due at once. Later frames are due when the camera or the scene differs from the last frame, while
//! the exposure adapts, and as a heartbeat, but not sooner than the subscriber's interval after its last frame.

use std::time::{Duration, Instant};

/// An unchanged image is sent again after this time, so that a client can distinguish a static scene from a dead daemon.
pub(crate) const HEARTBEAT: Duration = Duration::from_secs(1);
/// Minimum interval of frames that differ only in exposure.
pub(crate) const ADAPTATION_INTERVAL: Duration = Duration::from_nanos(16_666_667);

/// Revisions of scene and camera: frames with equal revisions show the same light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Revisions {
    /// Revision of the scene.
    pub(crate) scene: u64,
    /// Revision of the camera.
    pub(crate) camera: u64,
    /// Step of the scene's clock.
    pub(crate) step: u64,
}

/// Timing of one subscriber.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Minimum time between the starts of two of its frames.
    interval: Duration,
    /// Revisions of its last frame, and the start time of that frame.
    last: Option<(Revisions, Instant)>,
}

impl Pace {
    /// Creates the timing of a subscriber without a frame.
    pub(crate) fn new(interval: Duration) -> Self {
        Self { interval, last: None }
    }

    /// Creates the timing of a subscriber that has the frame with revisions `shown` that started at `start`.
    pub(crate) fn after(shown: Revisions, start: Instant) -> Self {
        Self { interval: Duration::ZERO, last: Some((shown, start)) }
    }

    /// Records that a frame with revisions `shown` started at `start`.
    pub(crate) fn served(&mut self, shown: Revisions, start: Instant) {
        self.last = Some((shown, start));
    }

    /// Records that the last started frame failed: the next one is due at once.
    pub(crate) fn again(&mut self) {
        self.last = None;
    }

    /// Whether the minimum time since the last frame has passed. For frames that come at an independent rate, seven eighths of that time are
    /// sufficient.
    pub(crate) fn interval_is_over(&self, now: Instant) -> bool {
        self.last.is_none_or(|(_, start)| now + self.interval / 8 >= start + self.interval)
    }

    /// Returns the time at which the next frame is due if a frame would now show `newest`. A frame is due already if that time is not after `now`.
    pub(crate) fn due_at(&self, newest: Revisions, exposure_converged: bool, now: Instant) -> Instant {
        let Some((shown, start)) = self.last else { return now };
        let wait = if shown != newest {
            self.interval
        } else if !exposure_converged {
            self.interval.max(ADAPTATION_INTERVAL)
        } else {
            self.interval.max(HEARTBEAT)
        };
        start + wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_due_on_changes_adaptation_and_heartbeat_within_the_rate_limit() {
        let now = Instant::now();
        let old = Revisions { scene: 1, camera: 1, step: 1 };
        let moved = Revisions { camera: 2, ..old };
        let edited = Revisions { scene: 2, ..old };
        let later = Revisions { step: 2, ..old };
        let mut fast = Pace::new(Duration::ZERO);
        assert_eq!(fast.due_at(old, true, now), now, "the first frame");
        fast.served(old, now);
        assert_eq!(fast.due_at(moved, true, now), now, "every frame");
        assert_eq!(fast.due_at(edited, true, now), now);
        assert_eq!(fast.due_at(later, true, now), now);
        assert_eq!(fast.due_at(old, false, now), now + ADAPTATION_INTERVAL);
        assert_eq!(fast.due_at(old, true, now), now + HEARTBEAT);
        for interval in [Duration::from_millis(100), Duration::from_secs(20)] {
            let mut slow = Pace::new(interval);
            slow.served(old, now);
            assert_eq!(slow.due_at(moved, true, now), now + interval);
            assert_eq!(slow.due_at(old, false, now), now + interval);
            assert_eq!(slow.due_at(old, true, now), now + interval.max(HEARTBEAT));
        }
    }
}
