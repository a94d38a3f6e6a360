//! An error in a part of a file, before the name of the file is known.

use std::path::Path;

use super::TheatreError;

/// Rounds a computed number for messages to at most six decimals.
pub(super) fn rounded(value: f64) -> f64 {
    // A number that is too large for six decimals stays unchanged. Adding 0 makes a negative zero positive.
    let scaled = value * 1e6;
    if scaled.is_finite() { scaled.round() / 1e6 + 0.0 } else { value }
}

/// Several such numbers.
pub(super) fn shown<const N: usize>(values: [f64; N]) -> String {
    let texts = values.map(|value| rounded(value).to_string());
    format!("[{}]", texts.join(", "))
}

/// An error without the name of the file; with the name it becomes a [`TheatreError`].
#[derive(Debug)]
pub(super) enum Fault {
    /// [`TheatreError::Content`].
    Content { place: String, problem: String, allowed: String },
    /// [`TheatreError::Refused`].
    Refused { what: String, reason: String },
}

impl Fault {
    pub fn new(place: impl Into<String>, problem: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self::Content { place: place.into(), problem: problem.into(), allowed: allowed.into() }
    }

    pub fn refused(what: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Refused { what: what.into(), reason: reason.into() }
    }

    /// Returns the same error, located in an entry of the file.
    pub fn within(self, outer: &str) -> Self {
        match self {
            Self::Content { place, problem, allowed } => {
                Self::Content { place: format!("{outer}: {place}"), problem, allowed }
            }
            Self::Refused { what, reason } => Self::Refused { what: format!("{outer}: {what}"), reason },
        }
    }

    pub fn of_file(self, path: &Path) -> TheatreError {
        let path = path.to_owned();
        match self {
            Self::Content { place, problem, allowed } => TheatreError::Content { path, place, problem, allowed },
            Self::Refused { what, reason } => TheatreError::Refused { path, what, reason },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn computed_numbers_have_six_decimals_at_most() {
        assert_eq!(shown([-29.999_999_999_999_996, -6.25e-8, 0.123_456_78]), "[-30, 0, 0.123457]");
        assert_eq!(shown([f64::NAN, f64::INFINITY, 1e300]), format!("[NaN, inf, {}]", 1e300));
    }
}
