//! An error in a part of a file, before the name of the file is known.

use std::path::Path;

use super::TheatreError;

/// Becomes a [`TheatreError`] when the name of the file is added.
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

    /// The same error within an entry of the file.
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
