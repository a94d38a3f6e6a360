//! Objects of a scene besides stars: bodies and asteroid fields, and the time at which they are shown.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{
    asteroids::AsteroidField,
    bodies::{Body, Spin},
    overlay::Overlay,
    surroundings::{LocalSky, Surroundings},
};
use crate::{
    catalogue::zodiacal_light::ZodiacalLight,
    ephemeris::Kernels,
    observer::{Frame, Moment, Observer, refraction::dip_rad},
    solar_system::SolarBody,
};

/// Objects of a scene; see the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneObjects {
    /// Bodies, with unique names.
    pub bodies: Vec<Arc<Body>>,
    /// Asteroid fields, with unique names.
    pub fields: Vec<Arc<AsteroidField>>,
    /// The time, s since 2000-01-01T12:00:00Z: determines spins and ephemerides.
    pub time_s: f64,
    /// The observer; `None`: bodies are placed at their true positions, without light time.
    pub observer: Option<Observer>,
    /// Source of the positions of bodies with an ephemeris `spk:NUMBER`.
    pub kernels: Option<Arc<Kernels>>,
    /// The ground and the air around the observer; `None`: space.
    pub surroundings: Option<Arc<Surroundings>>,
    /// The local sky of the camera at the time of the frame; set only in plans, whose bodies are already dimmed by the
    /// air.
    pub local_sky: Option<Arc<LocalSky>>,
    /// Centre of the Earth on which the observer stands, at its drawn position, m: the Earth may cast a shadow on the Moon. It is set together with
    /// the bodies that have an ephemeris.
    pub earth_m: Option<DVec3>,
    /// Whether the zodiacal light is drawn. It requires an observer and a Sun that has an ephemeris.
    pub zodiacal_light: bool,
    /// Overlay drawn over display images.
    pub overlay: Arc<Overlay>,
}

impl SceneObjects {
    /// Whether the scene contains only stars.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty() && self.fields.is_empty() && self.surroundings.is_none()
    }

    /// Whether the observer is in air.
    pub fn has_air(&self) -> bool {
        self.surroundings.as_ref().is_some_and(|around| around.air.is_some())
    }

    /// Rotation from the axes of a frame to ICRS axes at the scene's time; `None` for the horizon without an observer.
    pub fn icrs_from(&self, frame: Frame) -> Option<DMat3> {
        frame.icrs_from(self.observer.as_ref(), self.time_s)
    }

    /// The objects at another time, s since 2000-01-01T12:00:00Z.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Self {
        Self { time_s, ..self.clone() }.placed()
    }

    /// The objects as a camera sees them through the air around it, with the local sky; unchanged if the camera has no
    /// surroundings.
    #[must_use]
    pub fn seen_from(self: &Arc<Self>, camera_m: DVec3) -> Arc<Self> {
        let Some(sky) = self.local_sky(camera_m) else { return Arc::clone(self) };
        let dip_rad = self.observer.as_ref().map_or(0.0, |observer| {
            dip_rad(observer.place.height_m, self.surroundings.as_ref().and_then(|around| around.refraction.as_ref()))
        });
        let through = |body: &Arc<Body>| {
            let offset_m = body.position_m - camera_m;
            let radius_rad = body.angular_radius_rad(camera_m);
            let direction = (sky.seen_body(offset_m, radius_rad) * offset_m).normalize_or(DVec3::Y);
            let passed = sky.transmission_of_disc(direction, radius_rad);
            let risen = if body.emission.is_some() { sky.risen_share(direction, radius_rad, dip_rad) } else { 1.0 };
            let seen_through = passed.map(|passed| passed * risen);
            Arc::new(Body { seen_through, ..(**body).clone() })
        };
        let bodies = self.bodies.iter().map(through).collect();
        Arc::new(Self { bodies, local_sky: Some(Arc::new(sky)), ..(**self).clone() })
    }

    /// The zodiacal light at the scene's time, if it is drawn. In air, the part that is the same in all directions is left out, because the light of
    /// the night sky includes it.
    pub fn zodiacal_light(&self) -> Option<ZodiacalLight> {
        let of_sun = |body: &&Arc<Body>| body.ephemeris == Some(SolarBody::Sun.into());
        let sun = self.bodies.iter().find(of_sun).filter(|_| self.zodiacal_light)?;
        let has_air = self.local_sky.as_ref().is_some_and(|sky| sky.air.is_some());
        Some(ZodiacalLight::new((sun.position_m - self.earth_m?).normalize(), has_air))
    }

    /// The objects, with the bodies that have an ephemeris moved to their positions at the scene's time.
    #[must_use]
    pub fn placed(mut self) -> Self {
        if self.bodies.iter().all(|body| body.ephemeris.is_none()) {
            return self;
        }
        let moment = Moment::new(self.time_s, self.observer.as_ref());
        self.earth_m = moment.earth_m();
        for body in &mut self.bodies {
            let Some(ephemeris) = body.ephemeris else { continue };
            // The kernels could give the body's position when the body was accepted. If they have a gap at this time, the body keeps its position.
            let Ok((position_m, body_orientation)) = moment.place(ephemeris, self.kernels.as_deref()) else { continue };
            let (orientation, spin) =
                body_orientation.map_or((body.orientation, body.spin), |orientation| (orientation, Spin::default()));
            if (body.position_m, body.orientation, body.spin) != (position_m, orientation, spin) {
                *body = Arc::new(Body { position_m, orientation, spin, ..(**body).clone() });
            }
        }
        self
    }
}
