//! Collects the statistics of a headset from frame to frame.

use std::collections::VecDeque;

use super::statistics::{Distribution, HeadsetStatistics};

/// Number of frames from which distributions are computed.
const WINDOW: usize = 300;

/// Times of the last frames, ms.
#[derive(Clone, Debug, Default)]
struct Window(VecDeque<f64>);

impl Window {
    fn push(&mut self, ms: f64) {
        if self.0.len() == WINDOW {
            self.0.pop_front();
        }
        self.0.push_back(ms);
    }

    fn distribution(&self) -> Option<Distribution> {
        let mut sorted: Vec<f64> = self.0.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let quantile = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        (!sorted.is_empty()).then(|| Distribution {
            median_ms: quantile(0.5),
            p95_ms: quantile(0.95),
            max_ms: quantile(1.0),
        })
    }
}

/// Times of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameTimings {
    /// See [`HeadsetStatistics::pose_age_at_submission`], ms.
    pub(super) pose_age_at_submission_ms: f64,
    /// See [`HeadsetStatistics::pose_age_at_display`], ms.
    pub(super) pose_age_at_display_ms: Option<f64>,
    /// Stages in order, ms.
    pub(super) stages: Vec<(&'static str, f64)>,
}

/// Collects the statistics over all sessions.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    counts: HeadsetStatistics,
    at_submission: Window,
    at_display: Window,
    stages: Vec<(&'static str, Window)>,
    /// Display time of the session's last frame, ns of the runtime's clock, and whether the runtime wanted it.
    last: Option<(i64, bool)>,
}

impl Recorder {
    /// Records the start of a session.
    pub(super) fn session(&mut self) {
        self.counts.sessions += 1;
        self.last = None;
    }

    /// Records that the session pauses: refreshes during the pause do not count as missed.
    pub(super) fn pause(&mut self) {
        self.last = None;
    }

    /// Records the loss of the runtime or its session.
    pub(super) fn loss(&mut self) {
        self.counts.losses += 1;
    }

    /// Records that the room's origin has moved.
    pub(super) fn recentred(&mut self) {
        self.counts.recentred += 1;
    }

    /// Records that the runtime requests a frame for display at `display_ns`, with `period_ns` between refreshes;
    /// returns the time since the previous frame, s, if there was one.
    pub(super) fn frame(&mut self, display_ns: i64, period_ns: i64, wanted: bool) -> Option<f64> {
        self.counts.frames += 1;
        self.counts.not_wanted += u64::from(!wanted);
        self.counts.period_ms = period_ns as f64 * 1e-6;
        let last = self.last.replace((display_ns, wanted));
        let since_ns = last.map(|(last_ns, _)| display_ns - last_ns);
        // A runtime may delay invisible frames, so refreshes around them are not counted.
        let is_visible = wanted && last.is_some_and(|(_, wanted)| wanted);
        if let Some(since_ns) = since_ns.filter(|_| is_visible && period_ns > 0) {
            let periods = (since_ns as f64 / period_ns as f64).round();
            self.counts.missed += (periods as u64).saturating_sub(1);
        }
        since_ns.map(|ns| ns as f64 * 1e-9)
    }

    /// Records a wanted frame that could not be drawn.
    pub(super) fn left_out(&mut self) {
        self.counts.left_out += 1;
    }

    /// Records a rendered and submitted frame.
    pub(super) fn rendered(&mut self, timings: &FrameTimings) {
        self.counts.rendered += 1;
        self.at_submission.push(timings.pose_age_at_submission_ms);
        timings.pose_age_at_display_ms.into_iter().for_each(|ms| self.at_display.push(ms));
        timings.stages.iter().for_each(|(name, ms)| self.stage(name, *ms));
    }

    /// Records a stage whose time is known only after the end of its frame.
    pub(super) fn stage(&mut self, name: &'static str, ms: f64) {
        let index = self.stages.iter().position(|(known, _)| *known == name).unwrap_or_else(|| {
            self.stages.push((name, Window::default()));
            self.stages.len() - 1
        });
        self.stages[index].1.push(ms);
    }

    /// Returns the statistics so far.
    pub fn figures(&self) -> HeadsetStatistics {
        HeadsetStatistics {
            pose_age_at_submission: self.at_submission.distribution().unwrap_or_default(),
            pose_age_at_display: self.at_display.distribution(),
            stages: self.stages.iter().filter_map(|(name, window)| Some((*name, window.distribution()?))).collect(),
            ..self.counts.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refreshes_between_frames_are_missed_except_in_pauses() {
        let mut recorder = Recorder::default();
        recorder.session();
        let period = 11_111_111;
        assert_eq!(recorder.frame(0, period, false), None);
        recorder.frame(7 * period, period, false);
        recorder.frame(10 * period, period, true);
        assert_eq!(recorder.figures().missed, 0, "unwanted frames are not missed");
        for (display, missed) in [(11, 0), (12, 0), (14, 1), (15, 1), (19, 4)] {
            // The runtime's clock has jitter.
            recorder.frame(display * period + 400_000, period, true);
            assert_eq!(recorder.figures().missed, missed, "at {display}");
        }
        recorder.pause();
        assert_eq!(recorder.frame(1000 * period, period, true), None);
        let since = recorder.frame(1001 * period, period, true).unwrap();
        assert!((since - 0.011_111_111).abs() < 1e-9);
        let figures = recorder.figures();
        assert_eq!((figures.missed, figures.frames, figures.not_wanted, figures.sessions), (4, 10, 2, 1));
    }

    #[test]
    fn distributions_cover_the_last_frames() {
        let mut recorder = Recorder::default();
        for frame in 0..1000 {
            let ms = f64::from(frame);
            let timings = FrameTimings {
                pose_age_at_submission_ms: ms,
                pose_age_at_display_ms: None,
                stages: vec![("wait", 2.0 * ms), ("draw", 1.0)],
            };
            recorder.rendered(&timings);
        }
        let figures = recorder.figures();
        let age = figures.pose_age_at_submission;
        assert_eq!((age.median_ms, age.p95_ms, age.max_ms), (850.0, 984.0, 999.0));
        assert_eq!(figures.pose_age_at_display, None);
        assert_eq!(figures.stages[0].0, "wait");
        assert_eq!(figures.stages[0].1.max_ms, 1998.0);
        assert_eq!(figures.stages[1], ("draw", Distribution { median_ms: 1.0, p95_ms: 1.0, max_ms: 1.0 }));
        assert_eq!(figures.rendered, 1000);
    }
}
