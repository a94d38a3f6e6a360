//! Determines when to plan the next frame while the current one is drawn: late enough to use the camera that it would
//! have without overlap, and early enough that the device does not wait.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

/// Number of past frames that a forecast uses.
const KEPT: usize = 4;
/// Allowance for the time to wake up and to submit commands.
const MARGIN: Duration = Duration::from_micros(500);

/// Durations of the last frames.
#[derive(Debug, Default)]
pub(crate) struct Forecast {
    last: VecDeque<Took>,
}

#[derive(Clone, Copy, Debug)]
struct Took {
    planned: Duration,
    drawn: Duration,
}

/// Forecast for the frame that is being drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Expected {
    /// Time to begin planning the next frame.
    pub(crate) plan_next: Instant,
    /// Expected end of the current frame.
    pub(crate) end: Instant,
}

impl Forecast {
    /// Records how long a frame took to plan and record, and to draw.
    pub(crate) fn note(&mut self, planned: Duration, drawn: Duration) {
        self.last.truncate(KEPT - 1);
        self.last.push_front(Took { planned, drawn });
    }

    /// Returns the expected duration of a frame; zero if no frame is known yet.
    pub(crate) fn frame(&self) -> Duration {
        self.last.iter().map(|took| took.planned + took.drawn).min().unwrap_or_default()
    }

    /// Returns the forecast for a frame that the device began to draw at `began`; `None` if no frame was drawn yet.
    ///
    /// The frame is expected to take as long as the slowest of the last frames, and the next one to be planned as fast
    /// as the fastest: a camera that is sampled too early would be visible, but if the frame ends sooner, only the
    /// planning time is lost. If drawing times vary by more than the planning time, most frames are planned one after
    /// the other.
    pub(crate) fn expected(&self, began: Instant) -> Option<Expected> {
        let planned = self.last.iter().map(|took| took.planned).min()?;
        let drawn = self.last.iter().map(|took| took.drawn).max()?;
        Some(Expected { plan_next: began + drawn.saturating_sub(planned + MARGIN), end: began + drawn })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn planning_is_timed_to_end_with_the_slowest_recent_frame() {
        let mut forecast = Forecast::default();
        let began = Instant::now();
        assert_eq!(forecast.expected(began), None, "no frame was drawn yet");
        for (planned, drawn) in [(1, 900), (3, 40), (5, 30), (4, 50), (200, 35)] {
            forecast.note(ms(planned), ms(drawn));
        }
        // The first frame has left the history. The last frame does not count, because it created pipelines.
        let expected = forecast.expected(began).unwrap();
        assert_eq!(expected, Expected { plan_next: began + ms(50 - 3) - MARGIN, end: began + ms(50) });
    }

    #[test]
    fn planning_starts_at_once_if_it_takes_longer_than_drawing() {
        let mut forecast = Forecast::default();
        forecast.note(ms(8), ms(3));
        let began = Instant::now();
        assert_eq!(forecast.expected(began), Some(Expected { plan_next: began, end: began + ms(3) }));
    }
}
