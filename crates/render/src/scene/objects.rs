//! What a scene has besides stars: bodies and fields of asteroids, and the moment at which they are shown.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{
    asteroids::AsteroidField,
    bodies::{Body, Spin},
    overlay::Overlay,
    surroundings::{LocalSky, Surroundings},
};
use crate::{
    ephemeris::Kernels,
    observer::{Frame, Moment, Observer},
};

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
    /// What bodies with an ephemeris `spk:NUMBER` are placed by.
    pub kernels: Option<Arc<Kernels>>,
    /// The ground and the air around who looks; `None`: space.
    pub surroundings: Option<Arc<Surroundings>>,
    /// What is around the camera of a frame at its moment, whose bodies are then as bright as they are seen through it: plans have it.
    pub local_sky: Option<Arc<LocalSky>>,
    /// The middle of the Earth that the observer stands on, as it is drawn, m: it may cast a shadow on the Moon. Bodies with an ephemeris are placed with it.
    pub earth_m: Option<DVec3>,
    /// What is drawn over display images.
    pub overlay: Arc<Overlay>,
}

impl SceneObjects {
    /// Whether there is nothing but stars.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty() && self.fields.is_empty() && self.surroundings.is_none()
    }

    /// Rotation from the axes of a frame to those of ICRS at the moment; `None` for the horizon without an observer.
    pub fn icrs_from(&self, frame: Frame) -> Option<DMat3> {
        frame.icrs_from(self.observer.as_ref(), self.time_s)
    }

    /// The objects at another moment, s since 2000-01-01T12:00:00Z.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Self {
        Self { time_s, ..self.clone() }.placed()
    }

    /// The objects as a camera sees them through the air around it, and what is around it; as they are where nothing is.
    #[must_use]
    pub fn seen_from(self: &Arc<Self>, camera_m: DVec3) -> Arc<Self> {
        let Some(sky) = self.local_sky(camera_m) else { return Arc::clone(self) };
        let through = |body: &Arc<Body>| {
            let offset_m = body.position_m - camera_m;
            let radius_rad = body.angular_radius_rad(camera_m);
            let direction = (sky.seen_body(offset_m, radius_rad) * offset_m).normalize_or(DVec3::Y);
            let seen_through = sky.transmission_of_disc(direction, radius_rad);
            Arc::new(Body { seen_through, ..(**body).clone() })
        };
        let bodies = self.bodies.iter().map(through).collect();
        Arc::new(Self { bodies, local_sky: Some(Arc::new(sky)), ..(**self).clone() })
    }

    /// The objects with the bodies that have an ephemeris where they are at the moment.
    #[must_use]
    pub fn placed(mut self) -> Self {
        if self.bodies.iter().all(|body| body.ephemeris.is_none()) {
            return self;
        }
        let moment = Moment::new(self.time_s, self.observer.as_ref());
        self.earth_m = moment.earth_m();
        for body in &mut self.bodies {
            let Some(of) = body.ephemeris else { continue };
            // Kernels were asked for it when the body was accepted; where one has a gap the body stays.
            let Ok((position_m, stands)) = moment.place(of, self.kernels.as_deref()) else { continue };
            let (orientation, spin) =
                stands.map_or((body.orientation, body.spin), |orientation| (orientation, Spin::default()));
            if (body.position_m, body.orientation, body.spin) != (position_m, orientation, spin) {
                *body = Arc::new(Body { position_m, orientation, spin, ..(**body).clone() });
            }
        }
        self
    }
}
