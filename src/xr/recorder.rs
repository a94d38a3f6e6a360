//! Collects the figures of a headset from frame to frame.

use std::collections::VecDeque;

use super::statistics::{Distribution, HeadsetStatistics};

/// Frames that the distributions are of.
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
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        (!sorted.is_empty()).then(|| Distribution { median_ms: at(0.5), p95_ms: at(0.95), max_ms: at(1.0) })
    }
}

/// What one frame took.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameTimings {
    /// See [`HeadsetStatistics::pose_age_at_submission`], ms.
    pub(super) pose_age_at_submission_ms: f64,
    /// See [`HeadsetStatistics::pose_age_at_display`], ms.
    pub(super) pose_age_at_display_ms: Option<f64>,
    /// Stages in their order, ms.
    pub(super) stages: Vec<(&'static str, f64)>,
}

/// Collects the figures, over all sessions.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    counts: HeadsetStatistics,
    at_submission: Window,
    at_display: Window,
    stages: Vec<(&'static str, Window)>,
    /// When the last frame of the session was to be shown, ns of the runtime's clock, and whether it was wanted.
    last: Option<(i64, bool)>,
}

impl Recorder {
    /// A session has begun.
    pub(super) fn session(&mut self) {
        self.counts.sessions += 1;
        self.last = None;
    }

    /// The session does not run for a while: what passes meanwhile is not missed.
    pub(super) fn pause(&mut self) {
        self.last = None;
    }

    /// The runtime or its session was lost.
    pub(super) fn loss(&mut self) {
        self.counts.losses += 1;
    }

    /// The room's origin has moved.
    pub(super) fn recentred(&mut self) {
        self.counts.recentred += 1;
    }

    /// The runtime asks for a frame that it is going to show at `display_ns`, `period_ns` being the time between two; returns
    /// the time since the frame before, s, if there was one.
    pub(super) fn frame(&mut self, display_ns: i64, period_ns: i64, wanted: bool) -> Option<f64> {
        self.counts.frames += 1;
        self.counts.not_wanted += u64::from(!wanted);
        self.counts.period_ms = period_ns as f64 * 1e-6;
        let last = self.last.replace((display_ns, wanted));
        let since_ns = last.map(|(last_ns, _)| display_ns - last_ns);
        // A runtime takes its time over frames that nobody sees.
        let shown = wanted && last.is_some_and(|(_, wanted)| wanted);
        if let Some(since_ns) = since_ns.filter(|_| shown && period_ns > 0) {
            let periods = (since_ns as f64 / period_ns as f64).round();
            self.counts.missed += (periods as u64).saturating_sub(1);
        }
        since_ns.map(|ns| ns as f64 * 1e-9)
    }

    /// A frame was wanted and could not be drawn.
    pub(super) fn left_out(&mut self) {
        self.counts.left_out += 1;
    }

    /// A frame was rendered and handed in.
    pub(super) fn rendered(&mut self, timings: &FrameTimings) {
        self.counts.rendered += 1;
        self.at_submission.push(timings.pose_age_at_submission_ms);
        timings.pose_age_at_display_ms.into_iter().for_each(|ms| self.at_display.push(ms));
        timings.stages.iter().for_each(|(name, ms)| self.stage(name, *ms));
    }

    /// A stage whose time is known later than its frame's end.
    pub(super) fn stage(&mut self, name: &'static str, ms: f64) {
        let index = self.stages.iter().position(|(known, _)| *known == name).unwrap_or_else(|| {
            self.stages.push((name, Window::default()));
            self.stages.len() - 1
        });
        self.stages[index].1.push(ms);
    }

    /// The figures so far.
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
    fn refreshes_between_two_frames_are_missed_but_not_those_of_a_pause() {
        let mut recorder = Recorder::default();
        recorder.session();
        let period = 11_111_111;
        assert_eq!(recorder.frame(0, period, false), None);
        recorder.frame(7 * period, period, false);
        recorder.frame(10 * period, period, true);
        assert_eq!(recorder.figures().missed, 0, "nobody has seen them");
        for (display, missed) in [(11, 0), (12, 0), (14, 1), (15, 1), (19, 4)] {
            // The runtime's clock jitters.
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
    fn distributions_are_of_the_last_frames() {
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
