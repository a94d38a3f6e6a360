//! What a scene has besides stars: bodies and fields of asteroids, and the moment at which they are shown.

use std::sync::Arc;

use super::{
    asteroids::AsteroidField,
    bodies::{Body, Spin},
    overlay::Overlay,
};
use crate::observer::{Moment, Observer};

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneObjects {
    /// Bodies, of unique names.
    pub bodies: Vec<Arc<Body>>,
    /// Fields of asteroids, of unique names.
    pub fields: Vec<Arc<AsteroidField>>,
    /// The moment, s since 2000-01-01T12:00:00Z: spins and ephemerides follow it.
    pub time_s: f64,
    /// Who looks; `None`: bodies are where they are, not where they are seen.
    pub observer: Option<Observer>,
    /// What is drawn over display images.
    pub overlay: Arc<Overlay>,
}

impl SceneObjects {
    /// Whether there is nothing but stars.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty() && self.fields.is_empty()
    }

    /// The moment, as bodies with an ephemeris follow it.
    pub fn moment(&self) -> Moment {
        Moment::new(self.time_s, self.observer.as_ref())
    }

    /// The objects at another moment, s since 2000-01-01T12:00:00Z.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Self {
        Self { time_s, ..self.clone() }.placed()
    }

    /// The objects with the bodies that have an ephemeris where they are at the moment.
    #[must_use]
    pub fn placed(mut self) -> Self {
        if self.bodies.iter().all(|body| body.ephemeris.is_none()) {
            return self;
        }
        let moment = self.moment();
        for body in &mut self.bodies {
            if let Some(of) = body.ephemeris {
                let (position_m, orientation) = moment.place(of);
                if (body.position_m, body.orientation, body.spin) == (position_m, orientation, Spin::default()) {
                    continue;
                }
                *body = Arc::new(Body { position_m, orientation, spin: Spin::default(), ..(**body).clone() });
            }
        }
        self
    }
}
