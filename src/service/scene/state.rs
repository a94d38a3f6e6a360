//! The part of the scene that clients may change: settings of stars and asteroids, bodies and fields, views, and time.
//! The render thread holds it; every change increases its revision.

use super::{
    objects::{BodyForm, Change, MadeChange, Objects},
    observer::ObserverChange,
    overlay::OverlayChange,
    views::ViewSet,
};
use crate::{
    plan::settings::{AsteroidSettings, ImpostorMethod, StarMethod, StarSettings},
    scene::{SceneClock, asteroids::FieldSpec},
};
use std::{sync::Arc, time::SystemTime};

/// The scene without its stars, with its settings and its revision.
#[derive(Clone, Debug)]
pub(crate) struct SceneState {
    /// Number of changes.
    pub(crate) revision: u64,
    /// Settings of stars.
    pub(crate) stars: StarSettings,
    /// Settings of asteroids.
    pub(crate) asteroids: AsteroidSettings,
    /// Bodies, fields and observer.
    pub(crate) objects: Objects,
    /// The scene's time, which may run.
    pub(crate) clock: SceneClock,
    /// Views, with their exposure, glare and tone mapping.
    pub(crate) views: Arc<ViewSet>,
    /// Number of jumps of time or place. After a jump, automatic exposure starts again without the previous frames.
    pub(crate) jumps: u64,
}

/// A star catalogue of the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneCatalogue {
    /// Its name.
    pub name: String,
    /// Number of its stars.
    pub stars: u64,
}

/// A change of time by more than this counts as a jump, s. Twilight changes by a third of a magnitude in this time.
const JUMP_S: f64 = 60.0;

/// Changes of the scene; `None` and [`Change::Nothing`] keep a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneUpdate {
    /// Rendering method of stars.
    pub star_method: Option<StarMethod>,
    /// Limiting magnitude, finite.
    pub magnitude_limit: Option<f64>,
    /// Time of the scene, s since 2000-01-01T12:00:00Z, as [`calendar::check`](crate::calendar::check) accepts it.
    pub time_s: Option<f64>,
    /// Seconds of scene time per second of real time, at most [`SceneClock::MOST_RATE`] in either direction.
    pub time_rate: Option<f64>,
    /// Impostor method for distant asteroids.
    pub impostor: Option<ImpostorMethod>,
    /// Factor of the distances at which detail of asteroids is reduced, 0.1 to 10.
    pub quality: Option<f64>,
    /// Bodies.
    pub bodies: Change<BodyForm>,
    /// Fields of asteroids.
    pub asteroid_fields: Change<FieldSpec>,
    /// Lines and text over display images.
    pub overlay: OverlayChange,
    /// Observer, if the scene has one.
    pub observer: ObserverChange,
}

impl SceneUpdate {
    /// Whether preparing the change takes long: it may place asteroids, compute tables of the atmosphere or decode pictures.
    pub(crate) fn takes_long(&self) -> bool {
        !self.asteroid_fields.is_nothing() || !self.observer.is_nothing() || !self.overlay.pictures.is_nothing()
    }

    /// Whether the change may have the effect that frames cannot be drawn.
    pub(crate) fn needs_plan_check(&self) -> bool {
        let Self {
            star_method,
            magnitude_limit: _,
            time_s: _,
            time_rate: _,
            impostor,
            quality,
            bodies,
            asteroid_fields,
            overlay,
            observer,
        } = self;
        star_method.is_some()
            || impostor.is_some()
            || quality.is_some()
            || !bodies.is_nothing()
            || !asteroid_fields.is_nothing()
            || *overlay != OverlayChange::default()
            || !observer.is_nothing()
    }

    /// Prepares the change for a scene; the error states the valid values.
    pub(crate) fn make(&self, scene: &SceneState) -> Result<MadeUpdate, String> {
        Ok(MadeUpdate {
            star_method: self.star_method,
            magnitude_limit: self.magnitude_limit,
            impostor: self.impostor,
            quality: self.quality,
            time_s: self.time_s,
            time_rate: self.time_rate,
            objects: scene.objects.make(&self.bodies, &self.asteroid_fields, &self.observer)?,
            overlay: self.overlay.decoded()?,
        })
    }
}

/// A prepared change, which is applied without delay.
#[derive(Clone, Debug)]
pub(crate) struct MadeUpdate {
    star_method: Option<StarMethod>,
    magnitude_limit: Option<f64>,
    impostor: Option<ImpostorMethod>,
    quality: Option<f64>,
    time_s: Option<f64>,
    time_rate: Option<f64>,
    objects: MadeChange,
    overlay: OverlayChange,
}

/// Reasons why a change of the scene is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SceneError {
    /// The revision differs from the expected one.
    #[error("the scene has revision {found}, not {expected}: read it again")]
    Revision {
        /// Revision that the change was made for.
        expected: u64,
        /// Revision of the scene.
        found: u64,
    },
    /// The change is invalid.
    #[error("{0}")]
    Invalid(String),
}

impl SceneState {
    /// Returns the number of jumps after this scene replaces `before` at `now`.
    pub(crate) fn jumps_after(&self, before: &Self, now: SystemTime) -> u64 {
        let observers = [before, self].map(|scene| scene.objects.drawn.observer.map(|observer| observer.place));
        let apart_s = self.clock.time_s(now) - before.clock.time_s(now);
        before.jumps + u64::from(observers[0] != observers[1] || apart_s.abs() > JUMP_S)
    }

    /// Rejects changes that were made for another revision.
    pub(crate) fn expect(&self, revision: Option<u64>) -> Result<(), SceneError> {
        match revision.filter(|expected| *expected != self.revision) {
            Some(expected) => Err(SceneError::Revision { expected, found: self.revision }),
            None => Ok(()),
        }
    }

    /// Returns the scene with other views. `pattern` turns the test pattern of a named view on or off. The revision
    /// stays the same.
    pub(crate) fn with_views(mut self, views: ViewSet, pattern: Option<(&str, bool)>) -> Result<Self, SceneError> {
        self.views = Arc::new(views);
        let patterns = &self.objects.drawn.overlay.test_patterns;
        if let Some((name, shown)) = pattern.filter(|(name, shown)| patterns.iter().any(|one| one == name) != *shown) {
            let others = patterns.iter().filter(|one| *one != name).cloned();
            let test_patterns = Some(others.chain(shown.then(|| name.to_owned())).collect());
            let change = OverlayChange { test_patterns, ..OverlayChange::default() };
            self.objects = self.objects.with_overlay(&change).map_err(SceneError::Invalid)?;
        }
        Ok(self)
    }

    /// Returns the scene after a change at the daemon's time `now`, if it has the expected revision.
    pub(crate) fn changed(
        mut self,
        update: &MadeUpdate,
        expected_revision: Option<u64>,
        now: SystemTime,
    ) -> Result<Self, SceneError> {
        self.expect(expected_revision)?;
        if update.time_s.is_some() || update.time_rate.is_some() {
            let time_s = update.time_s.unwrap_or_else(|| self.clock.time_s(now));
            self.clock = SceneClock::running(time_s, update.time_rate.unwrap_or(self.clock.rate), now);
        }
        // If the clock does not run, place the objects once for all frames.
        self.objects = self.objects.changed(&update.objects, self.clock.time_s).map_err(SceneError::Invalid)?;
        self.objects = self.objects.with_overlay(&update.overlay).map_err(SceneError::Invalid)?;
        self.stars.method = update.star_method.unwrap_or(self.stars.method);
        self.stars.magnitude_limit = update.magnitude_limit.unwrap_or(self.stars.magnitude_limit);
        self.asteroids.impostor = update.impostor.unwrap_or(self.asteroids.impostor);
        self.asteroids.quality = update.quality.unwrap_or(self.asteroids.quality);
        self.revision += 1;
        Ok(self)
    }
}
