//! When to plan the next frame while one is being drawn: so late that it shows the camera that it would have shown had it waited, and
//! no later, so that the device can go on with it at once.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

/// Frames that a forecast looks back on.
const KEPT: usize = 4;
/// What waking up and handing commands over may take beside.
const MARGIN: Duration = Duration::from_micros(500);

/// How long the last frames took.
#[derive(Debug, Default)]
pub(super) struct Forecast {
    last: VecDeque<Took>,
}

#[derive(Clone, Copy, Debug)]
struct Took {
    planned: Duration,
    drawn: Duration,
}

/// What is to be expected of the frame that is being drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Expected {
    /// When planning the next one should begin.
    pub(super) plan_next: Instant,
    /// When this one is drawn.
    pub(super) end: Instant,
}

impl Forecast {
    /// A frame took that long to plan and record, and the device that long to draw it.
    pub(super) fn note(&mut self, planned: Duration, drawn: Duration) {
        self.last.truncate(KEPT - 1);
        self.last.push_front(Took { planned, drawn });
    }

    /// How long a frame takes, from its begin to its end; zero while that is not known.
    pub(super) fn frame(&self) -> Duration {
        self.last.iter().map(|took| took.planned + took.drawn).min().unwrap_or_default()
    }

    /// Of a frame that the device has been at since `began`. `None`: no frame has been drawn yet.
    ///
    /// It is expected to take as long as the slowest of the last frames, and the next one to be planned as fast as the fastest: a camera
    /// that is taken too early would be seen, while no more is lost than the time of planning if this frame ends sooner. So where frames
    /// differ by more than planning takes, most are planned one after the other.
    pub(super) fn of(&self, began: Instant) -> Option<Expected> {
        let planned = self.last.iter().map(|took| took.planned).min()?;
        let drawn = self.last.iter().map(|took| took.drawn).max()?;
        Some(Expected { plan_next: began + drawn.saturating_sub(planned + MARGIN), end: began + drawn })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn planning_ends_when_the_slowest_of_the_last_frames_would() {
        let mut forecast = Forecast::default();
        let began = Instant::now();
        assert_eq!(forecast.of(began), None, "nothing is known yet");
        for (planned, drawn) in [(1, 900), (3, 40), (5, 30), (4, 50), (200, 35)] {
            forecast.note(ms(planned), ms(drawn));
        }
        // The first one is forgotten, and the last one, in which pipelines were made, does not count.
        let expected = forecast.of(began).unwrap();
        assert_eq!(expected, Expected { plan_next: began + ms(50 - 3) - MARGIN, end: began + ms(50) });
    }

    #[test]
    fn what_takes_longer_to_plan_than_to_draw_is_planned_at_once() {
        let mut forecast = Forecast::default();
        forecast.note(ms(8), ms(3));
        let began = Instant::now();
        assert_eq!(forecast.of(began), Some(Expected { plan_next: began, end: began + ms(3) }));
    }
}
