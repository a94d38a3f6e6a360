//! What of the scene clients may change: how its stars are drawn. The render thread holds it, and every change is a revision.

use crate::plan::settings::{StarMethod, StarSettings};

/// How the scene is drawn, with its revision.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SceneState {
    /// Counts the changes.
    pub(super) revision: u64,
    /// How stars are drawn.
    pub(super) stars: StarSettings,
}

/// Changes of the scene; what is `None` stays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneUpdate {
    /// How stars are drawn.
    pub star_method: Option<StarMethod>,
    /// Faintest magnitude that is drawn, finite.
    pub magnitude_limit: Option<f64>,
}

/// The scene has another revision than the one that a change was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the scene has revision {found}, not {expected}: read it again")]
pub(super) struct RevisionMismatch {
    expected: u64,
    found: u64,
}

impl SceneState {
    /// The scene after a change, if it has the revision expected.
    pub(super) fn changed(
        mut self,
        update: &SceneUpdate,
        expected_revision: Option<u64>,
    ) -> Result<Self, RevisionMismatch> {
        if let Some(expected) = expected_revision.filter(|expected| *expected != self.revision) {
            return Err(RevisionMismatch { expected, found: self.revision });
        }
        self.stars.method = update.star_method.unwrap_or(self.stars.method);
        self.stars.magnitude_limit = update.magnitude_limit.unwrap_or(self.stars.magnitude_limit);
        self.revision += 1;
        Ok(self)
    }
}
