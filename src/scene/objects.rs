//! What a scene has besides stars: bodies and fields of asteroids, and the moment at which they are shown.

use std::sync::Arc;

use super::{asteroids::AsteroidField, bodies::Body, overlay::Overlay};

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneObjects {
    /// Bodies, of unique names.
    pub bodies: Vec<Arc<Body>>,
    /// Fields of asteroids, of unique names.
    pub fields: Vec<Arc<AsteroidField>>,
    /// The moment, s since 2000-01-01T12:00:00Z: spins follow it.
    pub time_s: f64,
    /// What is drawn over display images.
    pub overlay: Arc<Overlay>,
}

impl SceneObjects {
    /// Whether there is nothing but stars.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty() && self.fields.is_empty()
    }
}
