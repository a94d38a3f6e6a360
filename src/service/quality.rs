//! What display images give up, step by step, where frames take longer than `accuracy.frame_ms`.
//!
//! [`Quality`] is a machine of states without a clock: times of frames go in, a level comes out, and the same times give the same levels. A
//! level is judged by its own times alone, smoothed, and not by its first frames, in which maps are made anew. It falls when these are too long. It rises when
//! the level above is expected to be in time for a while, by how much longer that took when it was left. Where the level above turns out too slow all the same, the
//! next attempt takes twice the patience. HDR images give up nothing, and their times do not count.

use crate::plan::settings::RenderSettings;

/// Frames at the beginning of a level that tell nothing of it: six of them may make pictures of the map of faint stars.
const SETTLING: u32 = 10;
/// Frames that a level is judged by at least.
const JUDGED: u32 = 12;
/// Weight of the newest frame in the smoothed time.
const NEWEST: f64 = 0.125;
/// Share of the time allowed that the level above must be expected to stay within.
const RETURN_WITHIN: f64 = 0.8;
/// Frames in a row that must have that time to spare before the level rises: at first, and at most.
const PATIENCE: [u32; 2] = [60, 960];

/// The levels in the stated order: the budget of display images is at least this, codes; 0: as configured. Larger budgets put more stars into the map of
/// faint stars and draw the veil of single sources less far. Leaving glare out saves nothing: without it there is no map.
const LEVELS: [f64; 5] = [0.0, 1.0, 2.0, 4.0, 8.0];

/// The settings of display images at a level, 0 being what is configured.
pub(super) fn settings_at(level: u32, settings: &RenderSettings) -> RenderSettings {
    let mut reduced = settings.clone();
    let least = LEVELS[(level as usize).min(LEVELS.len() - 1)];
    reduced.accuracy.display_codes = settings.accuracy.display_codes.max(least);
    reduced
}

/// What a level gives up of settings, in words; nothing where it changes nothing.
pub(super) fn given_up(level: u32, settings: &RenderSettings) -> Vec<String> {
    let (codes, before) = (settings_at(level, settings).accuracy.display_codes, settings.accuracy.display_codes);
    (codes != before).then(|| format!("display_codes {codes} in place of {before}")).into_iter().collect()
}

/// Chooses the level of the frames of a daemon.
#[derive(Clone, Debug)]
pub(super) struct Quality {
    frame_ms: f64,
    level: u32,
    /// Of the frames of this level.
    smoothed_ms: Option<f64>,
    /// Frames of this level.
    frames: u32,
    /// Frames in a row with time to spare.
    spare: u32,
    /// How many of these it takes.
    patience: u32,
    /// For each level below the first how much longer the one above took, as far as that is known.
    costlier: [Option<f64>; LEVELS.len()],
    /// The smoothed time of the level above when it was left.
    left_at_ms: Option<f64>,
}

impl Quality {
    /// Frames may take that long, ms.
    pub(super) fn new(frame_ms: f64) -> Self {
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

    /// The level of frames to come.
    pub(super) fn level(&self) -> u32 {
        self.level
    }

    /// How long frames may take, ms.
    pub(super) fn frame_ms(&self) -> f64 {
        self.frame_ms
    }

    /// How long frames of this level take, ms, smoothed; `None`: not known yet.
    pub(super) fn smoothed_ms(&self) -> Option<f64> {
        self.smoothed_ms
    }

    /// A frame of that level took that long, ms. Frames that were begun at another level tell nothing.
    pub(super) fn note(&mut self, level: u32, took_ms: f64) {
        if level != self.level || !took_ms.is_finite() {
            return;
        }
        self.frames += 1;
        if self.frames <= SETTLING {
            return;
        }
        // A single frame that takes very long, as one that waits for a disk, does not count for many.
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
                // It was not worth the return.
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

    /// Whether the level was reached from below.
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

    /// The levels that frames have whose time depends on the level alone.
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
    fn it_falls_in_order_and_no_further_than_it_must() {
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
    fn frames_in_time_and_single_slow_ones_change_nothing() {
        let mut quality = Quality::new(20.0);
        let found = levels(&mut quality, 1000, |_, frame| if frame % 100 == 50 { 60.0 } else { 15.0 });
        assert_eq!(changes(&found), 0, "{found:?}");
        // Nor do the frames in which maps are made.
        let mut starting = Quality::new(20.0);
        assert_eq!(changes(&levels(&mut starting, 500, |_, frame| if frame < 8 { 300.0 } else { 15.0 })), 0);
    }

    #[test]
    fn a_steady_load_between_two_levels_does_not_make_it_oscillate() {
        let mut quality = Quality::new(20.0);
        // The level above takes too long, the one below a quarter of the time: tempting, were it not known.
        let found = levels(&mut quality, 5000, |level, _| if level == 0 { 21.0 } else { 5.0 });
        assert_eq!((changes(&found), found.last()), (1, Some(&1)));
    }

    #[test]
    fn it_rises_when_there_is_time_again() {
        let mut quality = Quality::new(20.0);
        let cost = |level: u32| [40.0, 36.0, 30.0, 15.0, 10.0][level as usize];
        levels(&mut quality, 300, |level, _| cost(level));
        assert_eq!(quality.level(), 3);
        // The scene is a third of what it was.
        let found = levels(&mut quality, 600, |level, _| cost(level) / 3.0);
        assert_eq!(found.last(), Some(&0));
        assert!(found.iter().rev().is_sorted(), "{found:?}");
        assert!(found.iter().filter(|level| **level == 3).count() >= PATIENCE[0] as usize, "not at once");
    }

    #[test]
    fn a_return_that_fails_is_tried_less_and_less_often() {
        let mut quality = Quality::new(20.0);
        levels(&mut quality, 100, |level, _| if level == 0 { 30.0 } else { 15.0 });
        assert_eq!(quality.level(), 1);
        // It seems to have become cheap, but only at the level below.
        let found = levels(&mut quality, 20_000, |level, _| if level == 0 { 30.0 } else { 7.0 });
        let returns = found.windows(2).filter(|pair| pair[0] > pair[1]).count();
        assert!(returns <= 3, "{returns}");
    }

    #[test]
    fn frames_begun_at_another_level_and_what_is_no_time_do_not_count() {
        let mut quality = Quality::new(20.0);
        (0..100).for_each(|_| quality.note(3, 90.0));
        (0..100).for_each(|_| quality.note(0, f64::NAN));
        assert_eq!((quality.level(), quality.smoothed_ms()), (0, None));
    }

    #[test]
    fn levels_give_up_more_and_more_and_say_so() {
        let settings = RenderSettings::default();
        assert_eq!(settings_at(0, &settings), settings);
        assert!(given_up(0, &settings).is_empty());
        assert_eq!(given_up(1, &settings), ["display_codes 1 in place of 0.5"]);
        assert_eq!(given_up(3, &settings), ["display_codes 4 in place of 0.5"]);
        assert_eq!(given_up(4, &settings), ["display_codes 8 in place of 0.5"]);
        // A coarser budget stays.
        let mut coarse = settings;
        coarse.accuracy.display_codes = 3.0;
        assert_eq!(settings_at(2, &coarse).accuracy.display_codes, 3.0);
        assert_eq!(given_up(2, &coarse), [""; 0]);
        assert_eq!(settings_at(99, &coarse), settings_at(4, &coarse));
    }
}
