//! Collects the intervals between the frames of a window.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use super::statistics::Intervals;

/// Number of intervals from which medians are computed: ten seconds at 60 Hz.
const WINDOW: usize = 600;

/// Recorder of one window.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorder {
    last: Option<Instant>,
    intervals_ms: VecDeque<f64>,
    longest_ms: f64,
    pub(super) frames: u64,
    pub(super) missed: u64,
    /// Number of the last frame.
    pub(super) frame_number: u64,
}

impl Recorder {
    /// Records a frame that was presented. `period` is the monitor's refresh period, if it is known and frames wait for refreshes.
    pub(super) fn presented(&mut self, now: Instant, frame_number: u64, period: Option<Duration>) {
        self.frames += 1;
        self.frame_number = frame_number;
        let Some(last) = self.last.replace(now) else { return };
        let interval = now.duration_since(last);
        let ms = interval.as_secs_f64() * 1e3;
        if self.intervals_ms.len() == WINDOW {
            self.intervals_ms.pop_front();
        }
        self.intervals_ms.push_back(ms);
        self.longest_ms = self.longest_ms.max(ms);
        if let Some(period) = period.filter(|period| !period.is_zero()) {
            let refreshes = (interval.as_secs_f64() / period.as_secs_f64()).round() as u64;
            self.missed += refreshes.saturating_sub(1);
        }
    }

    /// Records that no new frame is wanted for a while: the pause is neither an interval nor a missed refresh.
    pub(super) fn pause(&mut self) {
        self.last = None;
    }

    pub(super) fn intervals(&self) -> Option<Intervals> {
        let mut sorted: Vec<f64> = self.intervals_ms.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let quantile = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        (!sorted.is_empty()).then(|| Intervals {
            median_ms: quantile(0.5),
            p99_ms: quantile(0.99),
            longest_ms: self.longest_ms,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refreshes_without_new_frame_are_missed_except_in_pauses() {
        let period = Duration::from_secs_f64(1.0 / 60.0);
        let mut recorder = Recorder::default();
        let mut now = Instant::now();
        recorder.presented(now, 1, Some(period));
        for refreshes in [1.02, 0.97, 3.0, 1.0] {
            now += period.mul_f64(refreshes);
            recorder.presented(now, 2, Some(period));
        }
        assert_eq!((recorder.frames, recorder.missed), (5, 2));
        recorder.pause();
        now += Duration::from_secs(9);
        recorder.presented(now, 3, Some(period));
        assert_eq!((recorder.frames, recorder.missed, recorder.frame_number), (6, 2, 3));
        let intervals = recorder.intervals().expect("there are four intervals");
        assert!((intervals.longest_ms - 50.0).abs() < 0.01, "{intervals:?}");
        assert!((intervals.median_ms - 1000.0 / 60.0).abs() < 0.5, "{intervals:?}");
        // If frames do not wait for refreshes, no refresh is missed.
        now += Duration::from_secs(1);
        recorder.presented(now, 4, None);
        assert_eq!(recorder.missed, 2);
    }
}
