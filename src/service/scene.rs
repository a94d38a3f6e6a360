//! What of the scene clients may change: how its stars and asteroids are drawn, its bodies and fields, and the moment
//! that is shown. The render thread holds it, and every change is a revision.

use super::{
    objects::{BodyForm, Change, FieldForm, MadeChange, Objects},
    observer::ObserverChange,
    overlay::OverlayChange,
    views::ViewSet,
};
use std::{sync::Arc, time::SystemTime};

use crate::{
    plan::settings::{AsteroidSettings, ImpostorMethod, StarMethod, StarSettings},
    scene::SceneClock,
};

/// The scene but for its stars, and how it is drawn, with its revision.
#[derive(Clone, Debug)]
pub(super) struct SceneState {
    /// Counts the changes.
    pub(super) revision: u64,
    /// How stars are drawn.
    pub(super) stars: StarSettings,
    /// How asteroids are drawn.
    pub(super) asteroids: AsteroidSettings,
    /// Bodies and fields.
    pub(super) objects: Objects,
    /// The moment, which may go on.
    pub(super) clock: SceneClock,
    /// Views, with their exposure, glare and tone mapping.
    pub(super) views: Arc<ViewSet>,
    /// Counts the changes after which nobody's eye goes on adapting from what it saw before: other times and places.
    pub(super) jumps: u64,
}

/// A scene whose time is set this far from where it would be has jumped, s: twilight changes by a third of a magnitude meanwhile.
const JUMP_S: f64 = 60.0;

/// Changes of the scene; what is `None` or [`Change::Nothing`] stays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneUpdate {
    /// How stars are drawn.
    pub star_method: Option<StarMethod>,
    /// Faintest magnitude that is drawn, finite.
    pub magnitude_limit: Option<f64>,
    /// The moment that is shown, s since 2000-01-01T12:00:00Z, of the years 1 to 9999.
    pub time_s: Option<f64>,
    /// Seconds of the scene for each second that goes by, at most [`SceneClock::MOST_RATE`] either way.
    pub time_rate: Option<f64>,
    /// What stands in for far asteroids.
    pub impostor: Option<ImpostorMethod>,
    /// Factor on the distances at which detail of asteroids is left out, 0.1 to 10.
    pub quality: Option<f64>,
    /// Bodies.
    pub bodies: Change<BodyForm>,
    /// Fields of asteroids.
    pub asteroid_fields: Change<FieldForm>,
    /// Lines and text over display images.
    pub overlay: OverlayChange,
    /// From where the scene is seen, if it has an observer.
    pub observer: ObserverChange,
}

impl SceneUpdate {
    /// Whether it takes long: asteroids may have to be placed, or tables of air made.
    pub(super) fn takes_long(&self) -> bool {
        !self.asteroid_fields.is_nothing() || !self.observer.is_nothing()
    }

    /// Whether frames may become ones that cannot be drawn.
    pub(super) fn changes_what_is_drawn(&self) -> bool {
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

    /// Makes what the change needs for a scene; the error says what is not allowed.
    pub(super) fn make(&self, scene: &SceneState) -> Result<MadeUpdate, String> {
        Ok(MadeUpdate {
            star_method: self.star_method,
            magnitude_limit: self.magnitude_limit,
            impostor: self.impostor,
            quality: self.quality,
            time_s: self.time_s,
            time_rate: self.time_rate,
            objects: scene.objects.make(&self.bodies, &self.asteroid_fields, &self.observer)?,
            overlay: self.overlay.clone(),
        })
    }
}

/// A change for which everything is made: it takes no time any more.
#[derive(Clone, Debug)]
pub(super) struct MadeUpdate {
    star_method: Option<StarMethod>,
    magnitude_limit: Option<f64>,
    impostor: Option<ImpostorMethod>,
    quality: Option<f64>,
    time_s: Option<f64>,
    time_rate: Option<f64>,
    objects: MadeChange,
    overlay: OverlayChange,
}

/// Why the scene stays as it is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum SceneError {
    /// The scene has another revision than the one that a change was made for.
    #[error("the scene has revision {found}, not {expected}: read it again")]
    Revision {
        /// What the change was made for.
        expected: u64,
        /// What the scene has.
        found: u64,
    },
    /// The change is not allowed.
    #[error("{0}")]
    Invalid(String),
}

impl SceneState {
    /// How many jumps there were once it takes the place of another scene at a moment.
    pub(super) fn jumps_after(&self, before: &Self, now: SystemTime) -> u64 {
        let observers = [before, self].map(|scene| scene.objects.drawn.observer.map(|observer| observer.place));
        let apart_s = self.clock.time_s(now) - before.clock.time_s(now);
        before.jumps + u64::from(observers[0] != observers[1] || apart_s.abs() > JUMP_S)
    }

    /// Refuses changes that were made for another revision.
    pub(super) fn expect(&self, revision: Option<u64>) -> Result<(), SceneError> {
        match revision.filter(|expected| *expected != self.revision) {
            Some(expected) => Err(SceneError::Revision { expected, found: self.revision }),
            None => Ok(()),
        }
    }

    /// The scene with other views, and where it is said with a test pattern in the one of a name, or without. The revision stays.
    pub(super) fn with_views(mut self, views: ViewSet, pattern: Option<(&str, bool)>) -> Result<Self, SceneError> {
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

    /// The scene after a change, if it has the revision expected.
    pub(super) fn changed(mut self, update: &MadeUpdate, expected_revision: Option<u64>) -> Result<Self, SceneError> {
        self.expect(expected_revision)?;
        if update.time_s.is_some() || update.time_rate.is_some() {
            let now = SystemTime::now();
            let time_s = update.time_s.unwrap_or_else(|| self.clock.time_s(now));
            self.clock = SceneClock::running(time_s, update.time_rate.unwrap_or(self.clock.rate), now);
        }
        // What does not run is placed once for all frames.
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
