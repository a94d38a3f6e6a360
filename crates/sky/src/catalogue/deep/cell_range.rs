//! A range of the cells of order 4 ("buckets"), which divides the work on a store among several programs.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::BUCKETS;
use super::cells::SkyPlace;
use super::{BUCKET_ORDER, SUM_ORDER};

/// A range of cells of order 4, nested; it has at least one cell and ends at [`BUCKETS`] or before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct CellRange {
    first: u64,
    end: u64,
}

impl CellRange {
    /// All cells.
    pub const ALL: Self = Self { first: 0, end: BUCKETS };

    /// Creates the range from `first` to `end`, which is excluded; `None` if it is empty, or if `end` is beyond the last cell.
    pub fn new(first: u64, end: u64) -> Option<Self> {
        (first < end && end <= BUCKETS).then_some(Self { first, end })
    }

    /// First cell.
    pub fn first(self) -> u64 {
        self.first
    }

    /// The cell after the last one.
    pub fn end(self) -> u64 {
        self.end
    }

    /// Whether the range contains this cell.
    pub fn contains(self, cell: u64) -> bool {
        (self.first..self.end).contains(&cell)
    }

    /// Whether a direction is in a cell of the range.
    pub fn contains_direction(self, direction: glam::DVec3) -> bool {
        self == Self::ALL || self.contains(SkyPlace::from_direction(direction).cell(BUCKET_ORDER))
    }

    /// Returns the range of cells of a finer order that covers the same part of the sky.
    pub fn at_order(self, order: u8) -> Range<usize> {
        let shift = 2 * (order - BUCKET_ORDER);
        (self.first << shift) as usize..(self.end << shift) as usize
    }
}

const _: () = assert!(SUM_ORDER >= BUCKET_ORDER);

impl fmt::Display for CellRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.end)
    }
}

impl FromStr for CellRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let range = text.split_once("..").and_then(|(first, end)| Self::new(first.parse().ok()?, end.parse().ok()?));
        range.ok_or_else(|| format!("must be a range A..B of cells with 0 <= A < B <= {BUCKETS}, such as 0..384"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_parsed_or_refused() {
        let range: CellRange = "384..768".parse().expect("a range");
        assert_eq!((range.first(), range.end(), range.to_string().as_str()), (384, 768, "384..768"));
        assert!(range.contains(384) && range.contains(767) && !range.contains(768));
        assert_eq!(range.at_order(6), 6144..12_288);
        assert_eq!("0..3072".parse(), Ok(CellRange::ALL));
        for wrong in ["0..0", "5..4", "0..3073", "-1..4", "0..=4", "7", "..", "a..b"] {
            let error = wrong.parse::<CellRange>().expect_err(wrong);
            assert!(error.contains("3072"), "{wrong}: {error}");
        }
    }
}
