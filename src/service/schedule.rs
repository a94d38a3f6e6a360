//! When a subscriber is due for its next frame.
//!
//! A new subscriber is due at once. Later ones are due when the camera or the scene differs from its last frame, while the
//! exposure is still adapting, and as a heartbeat; none of these sooner than its own interval after its last frame.

use std::time::{Duration, Instant};

/// An unchanged picture is sent again after this time, so that a client can tell a quiet scene from a dead daemon.
pub(super) const HEARTBEAT: Duration = Duration::from_secs(1);
/// Frames that differ by their exposure alone are not made faster than this.
pub(super) const ADAPTATION_INTERVAL: Duration = Duration::from_nanos(16_666_667);

/// Revisions of the scene and of the camera: frames with the same revisions show the same light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Revisions {
    /// Revision of the scene.
    pub(super) scene: u64,
    /// Revision of the camera.
    pub(super) camera: u64,
    /// Step of the scene's clock.
    pub(super) step: u64,
}

/// One subscriber's pace.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Shortest time between the starts of two of its frames.
    interval: Duration,
    /// What its last frame showed, and when that frame was started.
    last: Option<(Revisions, Instant)>,
}

impl Pace {
    /// A subscriber that has seen nothing yet.
    pub(super) fn new(interval: Duration) -> Self {
        Self { interval, last: None }
    }

    /// Somebody who has seen the frame that shows `shown` and was started at `start`, and wants the next one.
    pub(super) fn after(shown: Revisions, start: Instant) -> Self {
        Self { interval: Duration::ZERO, last: Some((shown, start)) }
    }

    /// A frame that shows `shown` was started for it at `start`.
    pub(super) fn served(&mut self, shown: Revisions, start: Instant) {
        self.last = Some((shown, start));
    }

    /// The frame that was started last does not come: another one is due at once.
    pub(super) fn again(&mut self) {
        self.last = None;
    }

    /// When the next frame is due if `newest` is what a frame would show now; `now` or earlier: it is due.
    pub(super) fn due_at(&self, newest: Revisions, exposure_converged: bool, now: Instant) -> Instant {
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
    fn due_when_new_when_changed_while_adapting_and_as_a_heartbeat_but_never_too_soon() {
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
