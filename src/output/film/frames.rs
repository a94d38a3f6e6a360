//! Ranges of frames and names of their files.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::view::Rig;

/// Maximum number of frames of a range.
pub const MOST_FRAMES: u32 = 1_000_000;

/// Range of frame numbers; `end` is excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FrameRange {
    /// First frame.
    pub first: u32,
    /// Frame after the last one.
    pub end: u32,
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.end)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    /// Parses `A..B` (excluding B) or `A..=B` (including B).
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is not a range of frames: must be A..B (excluding B) or A..=B (including B), such as 0..240"
            )
        };
        let (first, last) = text.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| wrong());
        let first = number(first)?;
        let end = match last.strip_prefix('=') {
            Some(last) => number(last)?.checked_add(1).ok_or_else(wrong)?,
            None => number(last)?,
        };
        if end <= first {
            return Err(format!("{text} has no frames: the end must be above {first}"));
        }
        if end - first > MOST_FRAMES {
            return Err(format!("{text} has {} frames: must be at most {MOST_FRAMES}", end - first));
        }
        Ok(Self { first, end })
    }
}

/// One of several parts of a range, which takes every N-th frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the part, from 1.
    pub number: u32,
    /// Number of parts.
    pub total: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once('/').and_then(|(number, total)| Some((number.parse().ok()?, total.parse().ok()?)));
        match numbers {
            Some((number, total)) if (1..=total).contains(&number) => Ok(Self { number, total }),
            _ => Err(format!("`{text}` is not a shard: must be 1/N to N/N, such as 2/4")),
        }
    }
}

impl FrameRange {
    /// A range; `None` if it has no frames.
    pub fn new(first: u32, end: u32) -> Option<Self> {
        (first < end).then_some(Self { first, end })
    }

    /// Whether the range contains this frame.
    pub fn contains(self, frame: u32) -> bool {
        (self.first..self.end).contains(&frame)
    }

    /// Returns the union of `ranges` and this range, as ranges in order and without overlaps.
    pub fn joined_with(self, ranges: &[Self]) -> Vec<Self> {
        let mut all = ranges.to_vec();
        all.push(self);
        all.sort_unstable();
        let mut joined: Vec<Self> = Vec::new();
        for range in all {
            match joined.last_mut() {
                Some(last) if range.first <= last.end => last.end = last.end.max(range.end),
                _ => joined.push(range),
            }
        }
        joined
    }

    /// Number of frames.
    pub fn count(self) -> u32 {
        self.end - self.first
    }

    /// Returns the frames of a shard, or all frames.
    pub fn frames(self, shard: Option<Shard>) -> impl Iterator<Item = u32> {
        let Shard { number, total } = shard.unwrap_or(Shard { number: 1, total: 1 });
        (self.first..self.end).filter(move |frame| (frame - self.first) % total == number - 1)
    }
}

/// Returns the prefix of the file names of each image, in the order of views and parts: `<view>` or `<view>.<part>`.
pub fn stems(rig: &Rig) -> Vec<String> {
    let of_view = |view: &crate::view::View| {
        let stem =
            |part: crate::view::Part| part.name().map_or(view.name.clone(), |part| format!("{}.{part}", view.name));
        view.pictures().iter().map(|picture| stem(picture.part)).collect::<Vec<_>>()
    };
    rig.views().iter().flat_map(of_view).collect()
}

/// Returns the file name of an image of a frame.
pub fn file_name(stem: &str, frame: u32, extension: &str) -> String {
    format!("{stem}_{frame:05}.{extension}")
}

/// Whether a name has the form of such a file name.
pub(super) fn is_file_of(name: &str, stem: &str, extension: &str) -> bool {
    digits_of(name, stem, extension).is_some()
}

/// Returns the frame number in such a file name; `None` if the name has another form, or if the number is not a valid frame number.
pub(super) fn number_of(name: &str, stem: &str, extension: &str) -> Option<u32> {
    let number = digits_of(name, stem, extension)?.parse().ok()?;
    (file_name(stem, number, extension) == name).then_some(number)
}

/// Digits of the frame number in such a file name.
fn digits_of<'a>(name: &'a str, stem: &str, extension: &str) -> Option<&'a str> {
    let number = name
        .strip_prefix(stem)
        .and_then(|rest| rest.strip_prefix('_'))
        .and_then(|rest| rest.strip_suffix(extension))
        .and_then(|rest| rest.strip_suffix('.'));
    number.filter(|number| number.len() >= 5 && number.bytes().all(|byte| byte.is_ascii_digit()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn shards_partition_their_range_and_invalid_ones_are_refused() {
        let range: FrameRange = "3..14".parse().unwrap();
        assert_eq!("3..=13".parse::<FrameRange>().unwrap(), range);
        let mut all: Vec<u32> = (1..=4).flat_map(|number| range.frames(Some(Shard { number, total: 4 }))).collect();
        assert_eq!(range.frames(Some("2/4".parse().unwrap())).collect::<Vec<_>>(), [4, 8, 12]);
        all.sort_unstable();
        assert_eq!(all, range.frames(None).collect::<Vec<_>>());
        for text in ["", "3", "3..3", "4..3", "-1..3", "0..1000001", "a..b", "0..=4294967295"] {
            assert!(text.parse::<FrameRange>().is_err(), "{text}");
        }
        assert_eq!("0..1000000".parse::<FrameRange>().unwrap().count(), MOST_FRAMES);
        let joined = |ranges: &[&str], more: &str| {
            let parsed = |text: &str| text.parse::<FrameRange>().unwrap();
            let ranges: Vec<FrameRange> = ranges.iter().map(|text| parsed(text)).collect();
            parsed(more).joined_with(&ranges).iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(joined(&["0..6", "12..18"], "6..9"), ["0..9", "12..18"]);
        assert_eq!(joined(&["0..6", "12..18"], "5..13"), ["0..18"]);
        assert_eq!(joined(&[], "5..13"), ["5..13"]);
        for text in ["", "0/2", "3/2", "1", "1/0", "a/b", "-1/2"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    #[test]
    fn frame_file_names_are_recognised() {
        assert_eq!(number_of("dome_00007.png", "dome", "png"), Some(7));
        assert_eq!(number_of("dome_000007.png", "dome", "png"), None);
        assert_eq!(file_name("cube.up", 7, "exr"), "cube.up_00007.exr");
        assert_eq!(file_name("dome", 1_234_567, "png"), "dome_1234567.png");
        assert!(is_file_of("dome_1234567.png", "dome", "png") && is_file_of("cube.up_00007.exr", "cube.up", "exr"));
        for name in ["dome_0007.png", "dome_00007.exr", "dome_00007.png.bak", "dome_x_00007.png", "domes_00007.png"] {
            assert!(!is_file_of(name, "dome", "png"), "{name}");
        }
    }
}
