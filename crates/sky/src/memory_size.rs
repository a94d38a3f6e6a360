//! Sizes of memory as people write them: `512MiB`, `2GiB`.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Least size, bytes.
const LEAST_BYTES: f64 = 67_108_864.0;
/// Sizes of this number of bytes or more are rejected as mistakes.
const MOST_BYTES: f64 = 1e18;
/// Units and their powers of two, the largest last.
const UNITS: [(&str, i32); 4] = [("KiB", 10), ("MiB", 20), ("GiB", 30), ("TiB", 40)];

/// A number of bytes, at least 64 MiB. Its text is a number with a unit, such as `1.5GiB`, or a number of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String", extend("pattern" = r"^\s*[0-9.]+\s*([KMGT]iB)?\s*$"))]
pub struct MemorySize {
    /// Bytes.
    pub bytes: u64,
}

impl MemorySize {
    /// A number of GiB.
    pub const fn gib(number: u64) -> Self {
        Self { bytes: number << 30 }
    }
}

impl FromStr for MemorySize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let valid = || "must be a size of at least 64MiB, such as 512MiB or 2GiB".to_owned();
        let text = text.trim();
        let (number, power) = UNITS
            .iter()
            .find_map(|(unit, power)| text.strip_suffix(unit).map(|number| (number, *power)))
            .unwrap_or((text, 0));
        let number: f64 = number.trim().parse().map_err(|_| valid())?;
        let bytes = number * f64::from(power).exp2();
        if (LEAST_BYTES..MOST_BYTES).contains(&bytes) { Ok(Self { bytes: bytes as u64 }) } else { Err(valid()) }
    }
}

impl TryFrom<String> for MemorySize {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse().map_err(|valid| format!("`{text}`: {valid}"))
    }
}

impl From<MemorySize> for String {
    fn from(size: MemorySize) -> Self {
        size.to_string()
    }
}

impl fmt::Display for MemorySize {
    /// The largest unit of which the size is a multiple.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fitting = UNITS.iter().rev().find(|(_, power)| self.bytes.is_multiple_of(1_u64 << power));
        match fitting {
            Some((unit, power)) => write!(f, "{}{unit}", self.bytes >> power),
            None => write!(f, "{}", self.bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_parsed_and_written_or_refused() {
        let bytes = |text: &str| text.parse::<MemorySize>().map(|size| size.bytes);
        assert_eq!(bytes("1GiB"), Ok(1 << 30));
        assert_eq!(bytes("1.5 GiB"), Ok(3 << 29));
        assert_eq!(bytes("67108864"), Ok(64 << 20));
        assert!(["63MiB", "-1GiB", "1GB", "", "GiB", "inf", "nan"].iter().all(|text| bytes(text).is_err()));
        for text in ["1GiB", "1536MiB", "67108865"] {
            assert_eq!(text.parse::<MemorySize>().map(String::from), Ok(text.to_owned()));
        }
        assert!(MemorySize::try_from("1GB".to_owned()).is_err_and(|error| error.contains("`1GB`")));
    }
}
