//! The effect of a change on a scene's overlay.

use std::sync::Arc;

use super::objects::{Change, Objects};
use crate::scene::{
    SceneObjects,
    overlay::{Grid, Label, Lists, Overlay, Trajectory},
};

/// A change of an overlay; `None` and [`Change::Nothing`] keep a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OverlayChange {
    /// Replaces all grids.
    pub grids: Option<Vec<Grid>>,
    /// Trajectories.
    pub trajectories: Change<Trajectory>,
    /// Labels.
    pub labels: Change<Label>,
    /// Whether the points of the compass are written.
    pub cardinal_points: Option<bool>,
    /// Names of all views that show a test pattern.
    pub test_patterns: Option<Vec<String>>,
}

impl OverlayChange {
    /// Returns the change that produces this overlay from any other.
    pub fn all(overlay: Overlay) -> Self {
        Self {
            grids: Some(overlay.grids),
            trajectories: Change::All(overlay.trajectories),
            labels: Change::All(overlay.labels),
            cardinal_points: Some(overlay.cardinal_points),
            test_patterns: Some(overlay.test_patterns),
        }
    }

    /// Whether the change has no effect.
    pub fn is_nothing(&self) -> bool {
        self.grids.is_none()
            && self.trajectories.is_nothing()
            && self.labels.is_nothing()
            && self.cardinal_points.is_none()
            && self.test_patterns.is_none()
    }

    /// Rejects test patterns of views that do not exist.
    pub(crate) fn check_views(&self, views: &[&str]) -> Result<(), String> {
        match self.test_patterns.iter().flatten().find(|name| !views.contains(&name.as_str())) {
            Some(name) => Err(format!("overlay.test_patterns: no view `{name}`: must be one of {}", views.join(", "))),
            None => Ok(()),
        }
    }

    fn applied(&self, overlay: &Overlay) -> Result<Overlay, String> {
        let applied = Overlay {
            // Only configurations have pictures.
            pictures: overlay.pictures.clone(),
            grids: self.grids.clone().unwrap_or_else(|| overlay.grids.clone()),
            trajectories: self.trajectories.applied(&overlay.trajectories, "overlay.trajectories", |one| &one.name)?,
            labels: self.labels.applied(&overlay.labels, "overlay.labels", |one| &one.name)?,
            cardinal_points: self.cardinal_points.unwrap_or(overlay.cardinal_points),
            test_patterns: self.test_patterns.clone().unwrap_or_else(|| overlay.test_patterns.clone()),
        };
        applied.check().map_err(|wrong| {
            let name = match wrong.list {
                Lists::Grids | Lists::Pictures => None,
                Lists::Trajectories => applied.trajectories.get(wrong.index).map(|one| &one.name),
                Lists::Labels => applied.labels.get(wrong.index).map(|one| &one.name),
            };
            match name {
                Some(name) => format!("overlay.{}.{name}: {}", wrong.list.key(), wrong.error),
                None => wrong.to_string(),
            }
        })?;
        Ok(applied)
    }
}

impl Objects {
    /// Returns the objects with the changed overlay.
    pub(crate) fn with_overlay(mut self, change: &OverlayChange) -> Result<Self, String> {
        if change.is_nothing() {
            return Ok(self);
        }
        let overlay = Arc::new(change.applied(&self.drawn.overlay)?);
        let checked = overlay.check_observer(self.drawn.observer.is_some());
        checked.map_err(|(key, problem)| format!("overlay.{key}: {problem}"))?;
        self.drawn = Arc::new(SceneObjects { overlay, ..(*self.drawn).clone() });
        Ok(self)
    }
}
