//! Which frames are drawn, and what their files are called.

use std::str::FromStr;

use crate::view::Rig;

/// Frames of a range at most.
pub const MOST_FRAMES: u32 = 1_000_000;

/// Numbers of frames: from the first one to the one before the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// The first frame.
    pub first: u32,
    /// The one after the last.
    pub end: u32,
}

impl FromStr for FrameRange {
    type Err = String;

    /// `A..B` without B, `A..=B` with it.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("`{text}` is no range of frames: allowed are A..B (B is not drawn) and A..=B, for instance 0..240")
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
            return Err(format!("{text} has {} frames: allowed are {MOST_FRAMES} at once", end - first));
        }
        Ok(Self { first, end })
    }
}

/// One of several parts of a range, each of every so-many-th frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which one, from 1.
    pub number: u32,
    /// How many there are.
    pub of: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err(format!("`{text}` is no shard: allowed are 1/N to N/N, for instance 2/4")),
        }
    }
}

impl FrameRange {
    /// Number of frames.
    pub fn count(self) -> u32 {
        self.end - self.first
    }

    /// The frames of a shard, or all.
    pub fn frames(self, shard: Option<Shard>) -> impl Iterator<Item = u32> {
        let Shard { number, of } = shard.unwrap_or(Shard { number: 1, of: 1 });
        (self.first..self.end).filter(move |frame| (frame - self.first) % of == number - 1)
    }
}

/// What the files of each image begin with, in the order of views and parts: `<view>` or `<view>.<part>`.
pub fn stems(rig: &Rig) -> Vec<String> {
    let of_view = |view: &crate::view::View| {
        let stem =
            |part: crate::view::Part| part.name().map_or(view.name.clone(), |part| format!("{}.{part}", view.name));
        view.pictures().iter().map(|picture| stem(picture.part)).collect::<Vec<_>>()
    };
    rig.views().iter().flat_map(of_view).collect()
}

/// Name of the file of an image of a frame.
pub fn file_name(stem: &str, frame: u32, extension: &str) -> String {
    format!("{stem}_{frame:05}.{extension}")
}

/// Whether that is the name of such a file.
pub(super) fn is_file_of(name: &str, stem: &str, extension: &str) -> bool {
    let number = name
        .strip_prefix(stem)
        .and_then(|rest| rest.strip_prefix('_'))
        .and_then(|rest| rest.strip_suffix(extension))
        .and_then(|rest| rest.strip_suffix('.'));
    number.is_some_and(|number| number.len() >= 5 && number.bytes().all(|byte| byte.is_ascii_digit()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_shards_share_all_frames_and_wrong_ones_are_refused() {
        let range: FrameRange = "3..14".parse().unwrap();
        assert_eq!("3..=13".parse::<FrameRange>().unwrap(), range);
        let mut all: Vec<u32> = (1..=4).flat_map(|number| range.frames(Some(Shard { number, of: 4 }))).collect();
        assert_eq!(range.frames(Some("2/4".parse().unwrap())).collect::<Vec<_>>(), [4, 8, 12]);
        all.sort_unstable();
        assert_eq!(all, range.frames(None).collect::<Vec<_>>());
        for text in ["", "3", "3..3", "4..3", "-1..3", "0..1000001", "a..b", "0..=4294967295"] {
            assert!(text.parse::<FrameRange>().is_err(), "{text}");
        }
        assert_eq!("0..1000000".parse::<FrameRange>().unwrap().count(), MOST_FRAMES);
        for text in ["", "0/2", "3/2", "1", "1/0", "a/b", "-1/2"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    #[test]
    fn names_of_files_are_told_from_others() {
        assert_eq!(file_name("cube.up", 7, "exr"), "cube.up_00007.exr");
        assert_eq!(file_name("dome", 1_234_567, "png"), "dome_1234567.png");
        assert!(is_file_of("dome_1234567.png", "dome", "png") && is_file_of("cube.up_00007.exr", "cube.up", "exr"));
        for name in ["dome_0007.png", "dome_00007.exr", "dome_00007.png.bak", "dome_x_00007.png", "domes_00007.png"] {
            assert!(!is_file_of(name, "dome", "png"), "{name}");
        }
    }
}
