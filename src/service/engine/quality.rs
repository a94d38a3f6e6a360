//! Reduces the quality of display images step by step if frames take longer than `accuracy.frame_ms`.
//!
//! [`Quality`] is a state machine without a clock: its inputs are frame times, its output is a level, and equal input gives equal output. A level is
//! judged by the smoothed times of its frames, without the first ones, which recompute maps. The level falls when these times are too long. It rises
//! when the level above is expected, for a while, to be in time. The expectation is based on the ratio of the times of both levels when the level
//! above was left. If the level above turns out too slow again, the next attempt needs twice as many frames. HDR images keep their quality, and their
//! times do not count.

use crate::plan::settings::RenderSettings;

/// Frames at the start of a level that do not count: up to six may render the map of faint stars.
const SETTLING: u32 = 10;
/// Minimum number of frames to judge a level by.
const JUDGED: u32 = 12;
/// Weight of the newest frame in the smoothed time.
const NEWEST: f64 = 0.125;
/// The level rises only if the level above is expected to stay within this share of the allowed time.
const RETURN_WITHIN: f64 = 0.8;
/// Number of consecutive frames with time to spare before the level rises: initially, and at most.
const PATIENCE: [u32; 2] = [60, 960];

/// The levels in order: the minimum error budget of display images, in display codes; 0: as configured. Larger budgets put more stars into the map of
/// faint stars, and draw the veil of single sources only up to smaller distances. Glare is not turned off, because that saves nothing: the map
/// depends on it.
const LEVELS: [f64; 5] = [0.0, 1.0, 2.0, 4.0, 8.0];

/// Returns the settings of display images at a level; 0 is the configuration.
pub(crate) fn settings_at(level: u32, settings: &RenderSettings) -> RenderSettings {
    let mut reduced = settings.clone();
    let least = LEVELS[(level as usize).min(LEVELS.len() - 1)];
    reduced.accuracy.display_codes = settings.accuracy.display_codes.max(least);
    reduced
}

/// Describes the reductions of a level; the list is empty if the level changes nothing.
pub(crate) fn given_up(level: u32, settings: &RenderSettings) -> Vec<String> {
    let (codes, before) = (settings_at(level, settings).accuracy.display_codes, settings.accuracy.display_codes);
    (codes != before).then(|| format!("display_codes {codes} instead of {before}")).into_iter().collect()
}

/// Chooses the quality level of the daemon's frames.
#[derive(Clone, Debug)]
pub(crate) struct Quality {
    frame_ms: f64,
    level: u32,
    /// Smoothed time of frames at this level.
    smoothed_ms: Option<f64>,
    /// Number of frames at this level.
    frames: u32,
    /// Number of consecutive frames with time to spare.
    spare: u32,
    /// Required number of such frames.
    patience: u32,
    /// Ratio of the frame times of the level above and this one, for each level below the first; `None` if unknown.
    costlier: [Option<f64>; LEVELS.len()],
    /// Smoothed time of the level above when it was left.
    left_at_ms: Option<f64>,
}

impl Quality {
    /// Starts with the allowed frame time, ms.
    pub(crate) fn new(frame_ms: f64) -> Self {
        Self {
            frame_ms,
            level: 0,
            smoothed_ms: None,
            frames: 0,
            spare: 0,
            patience: PATIENCE[0],
            costlier: [None; LEVELS.len()],
            left_at_ms: None,
        }
    }

    /// Returns the level of the next frames.
    pub(crate) fn level(&self) -> u32 {
        self.level
    }

    /// Returns the allowed frame time, ms.
    pub(crate) fn frame_ms(&self) -> f64 {
        self.frame_ms
    }

    /// Returns the smoothed frame time of this level, ms; `None` if unknown.
    pub(crate) fn smoothed_ms(&self) -> Option<f64> {
        self.smoothed_ms
    }

    /// Records the time of a frame at a level, ms. Frames that began at another level are ignored.
    pub(crate) fn note(&mut self, level: u32, took_ms: f64) {
        if level != self.level || !took_ms.is_finite() {
            return;
        }
        self.frames += 1;
        if self.frames <= SETTLING {
            return;
        }
        // Limit the weight of a single slow frame, such as one that waits for a disk.
        let took_ms = took_ms.min(2.0 * self.frame_ms);
        let smoothed_ms = self.smoothed_ms.map_or(took_ms, |before| before + NEWEST * (took_ms - before));
        self.smoothed_ms = Some(smoothed_ms);
        if self.frames < SETTLING + JUDGED {
            return;
        }
        if let Some(left_at_ms) = self.left_at_ms.take() {
            self.costlier[self.level as usize] = Some(left_at_ms / smoothed_ms.max(1e-3));
        }
        if smoothed_ms > self.frame_ms {
            if (self.level as usize) + 1 < LEVELS.len() {
                // The return to this level failed.
                if self.returned() {
                    self.patience = (2 * self.patience).min(PATIENCE[1]);
                }
                self.left_at_ms = Some(smoothed_ms);
                self.go_to(self.level + 1);
            }
            return;
        }
        if self.level == 0 {
            return;
        }
        let above_ms = smoothed_ms * self.costlier[self.level as usize].unwrap_or(1.0).max(1.0);
        self.spare = if above_ms <= RETURN_WITHIN * self.frame_ms { self.spare + 1 } else { 0 };
        if self.spare >= self.patience {
            self.go_to(self.level - 1);
        }
    }

    /// Whether the level was reached from the level below.
    fn returned(&self) -> bool {
        self.costlier[self.level as usize + 1].is_some()
    }

    fn go_to(&mut self, level: u32) {
        self.level = level;
        (self.smoothed_ms, self.frames, self.spare) = (None, 0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the levels of frames whose time depends only on the level and the frame's number.
    fn levels(quality: &mut Quality, frames: u32, took_ms: impl Fn(u32, u32) -> f64) -> Vec<u32> {
        let level = |frame: u32| {
            let level = quality.level();
            quality.note(level, took_ms(level, frame));
            level
        };
        (0..frames).map(level).collect()
    }

    fn changes(levels: &[u32]) -> usize {
        levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    #[test]
    fn the_level_falls_step_by_step_and_only_as_far_as_needed() {
        let mut quality = Quality::new(20.0);
        let found = levels(&mut quality, 400, |level, _| [40.0, 30.0, 18.0, 12.0, 8.0][level as usize]);
        assert_eq!(found.first(), Some(&0));
        assert_eq!(found.last(), Some(&2));
        assert!(found.is_sorted(), "{found:?}");
        let mut hopeless = Quality::new(1.0);
        let found = levels(&mut hopeless, 1000, |_, _| 50.0);
        assert_eq!((found.last(), changes(&found)), (Some(&4), 4));
        assert!(found.is_sorted());
    }

    #[test]
    fn frames_in_time_and_single_slow_frames_keep_the_level() {
        let mut quality = Quality::new(20.0);
        let found = levels(&mut quality, 1000, |_, frame| if frame % 100 == 50 { 60.0 } else { 15.0 });
        assert_eq!(changes(&found), 0, "{found:?}");
        // The frames that recompute maps do not change the level either.
        let mut starting = Quality::new(20.0);
        assert_eq!(changes(&levels(&mut starting, 500, |_, frame| if frame < 8 { 300.0 } else { 15.0 })), 0);
    }

    #[test]
    fn a_steady_load_between_two_levels_does_not_oscillate() {
        let mut quality = Quality::new(20.0);
        // The level above takes too long, and the level below takes a quarter of that time. If the ratio were unknown, the level would therefore rise
        // again.
        let found = levels(&mut quality, 5000, |level, _| if level == 0 { 21.0 } else { 5.0 });
        assert_eq!((changes(&found), found.last()), (1, Some(&1)));
    }

    #[test]
    fn the_level_rises_when_there_is_time_again() {
        let mut quality = Quality::new(20.0);
        let cost = |level: u32| [40.0, 36.0, 30.0, 15.0, 10.0][level as usize];
        levels(&mut quality, 300, |level, _| cost(level));
        assert_eq!(quality.level(), 3);
        // The scene takes a third of the earlier time.
        let found = levels(&mut quality, 600, |level, _| cost(level) / 3.0);
        assert_eq!(found.last(), Some(&0));
        assert!(found.iter().rev().is_sorted(), "{found:?}");
        assert!(
            found.iter().filter(|level| **level == 3).count() >= PATIENCE[0] as usize,
            "the level rises after a delay"
        );
    }

    #[test]
    fn failed_returns_are_retried_less_and_less_often() {
        let mut quality = Quality::new(20.0);
        levels(&mut quality, 100, |level, _| if level == 0 { 30.0 } else { 15.0 });
        assert_eq!(quality.level(), 1);
        // The load seems lower, but only at the level below.
        let found = levels(&mut quality, 20_000, |level, _| if level == 0 { 30.0 } else { 7.0 });
        let returns = found.windows(2).filter(|pair| pair[0] > pair[1]).count();
        assert!(returns <= 3, "{returns}");
    }

    #[test]
    fn frames_of_another_level_and_invalid_times_do_not_count() {
        let mut quality = Quality::new(20.0);
        (0..100).for_each(|_| quality.note(3, 90.0));
        (0..100).for_each(|_| quality.note(0, f64::NAN));
        assert_eq!((quality.level(), quality.smoothed_ms()), (0, None));
    }

    #[test]
    fn levels_reduce_more_and_more_and_describe_it() {
        let settings = RenderSettings::default();
        assert_eq!(settings_at(0, &settings), settings);
        assert!(given_up(0, &settings).is_empty());
        assert_eq!(given_up(1, &settings), ["display_codes 1 instead of 0.5"]);
        assert_eq!(given_up(3, &settings), ["display_codes 4 instead of 0.5"]);
        assert_eq!(given_up(4, &settings), ["display_codes 8 instead of 0.5"]);
        // A coarser configured budget stays.
        let mut coarse = settings;
        coarse.accuracy.display_codes = 3.0;
        assert_eq!(settings_at(2, &coarse).accuracy.display_codes, 3.0);
        assert_eq!(given_up(2, &coarse), [""; 0]);
        assert_eq!(settings_at(99, &coarse), settings_at(4, &coarse));
    }
}
