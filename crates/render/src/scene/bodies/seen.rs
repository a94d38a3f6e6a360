//! A body at a moment, as an eye sees it: the intersection of a ray with it, and the luminance there.
//!
//! Divided by the semi-axes, the body is the unit sphere, rays remain rays, and the half lit by a sun remains a half. A
//! point of the surface is identified by the corresponding point of the unit sphere. Everything is f64.

use glam::{DQuat, DVec3};

use super::{Body, Light, Shadow};

/// Intersection of a ray with a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point of the unit sphere that corresponds to the surface point, in the body's axes.
    pub unit: DVec3,
    /// Distance from the eye, m.
    pub distance_m: f64,
}

/// A body at a moment for an eye; see the module.
#[derive(Clone, Debug)]
pub struct SeenBody<'a> {
    body: &'a Body,
    body_from_world: DQuat,
    /// The eye in the body's axes, in units of the semi-axes.
    eye: DVec3,
    /// Distance of the eye from the body's centre, m.
    distance_m: f64,
    /// Lights, with directions in the body's axes.
    lights: Vec<Light>,
}

impl<'a> SeenBody<'a> {
    /// A body at a time, s, for an eye at `eye_m` (world axes), lit by `lights` ([`super::lights_on`]).
    pub fn new(body: &'a Body, eye_m: DVec3, lights: &[Light], time_s: f64) -> Self {
        let body_from_world = body.world_from_body(time_s).conjugate();
        let from_body_m = eye_m - body.position_m;
        Self {
            body,
            body_from_world,
            eye: body_from_world * from_body_m / body.radii_m,
            distance_m: from_body_m.length(),
            lights: lights.iter().map(|light| light.turned(body_from_world)).collect(),
        }
    }

    /// The body.
    pub fn body(&self) -> &'a Body {
        self.body
    }

    /// The eye in the body's axes, in units of the semi-axes: outside of the body if its length exceeds 1.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Distance of the eye from the body's centre, m.
    pub fn distance_m(&self) -> f64 {
        self.distance_m
    }

    /// The light on it, with directions in the body's axes.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Returns the first intersection of the body with a ray from the eye along `direction` (unit vector, world axes). `None` if there is none, and
    /// if the eye is inside the body, where it sees nothing of the surface.
    pub fn hit(&self, direction: DVec3) -> Option<Hit> {
        let ray = self.body_from_world * direction / self.body.radii_m;
        let length2 = ray.length_squared();
        let along = self.eye.dot(ray);
        if along >= 0.0 || self.eye.length_squared() <= 1.0 {
            return None;
        }
        // Uses the perpendicular from the centre: the usual difference of squares would cancel completely for a distant
        // body.
        let foot = ray.cross(self.eye.cross(ray)) / length2;
        let half2 = 1.0 - foot.length_squared();
        if half2 < 0.0 {
            return None;
        }
        let unit = foot - ray * (half2 / length2).sqrt();
        let distance_m = (self.eye.length_squared() - 1.0) / (-along + (half2 * length2).sqrt());
        Some(Hit { unit: unit.normalize(), distance_m })
    }

    /// Luminance at a point of the surface, linear Rec. 709, cd/m^2: reflected and emitted light.
    pub fn luminance_cd_m2(&self, unit: DVec3) -> [f64; 3] {
        let mut sum = self.emitted_cd_m2(unit);
        for light in &self.lights {
            let reflected = self.reflected_cd_m2(unit, light);
            for channel in 0..3 {
                sum[channel] += reflected[channel];
            }
        }
        sum
    }

    /// Light emitted at a point of the surface.
    pub fn emitted_cd_m2(&self, unit: DVec3) -> [f64; 3] {
        let emitted = self.body.emission.map_or([0.0; 3], |emission| emission.luminance_at(self.cos_e(unit)));
        [0, 1, 2].map(|c| emitted[c] * self.body.seen_through[c])
    }

    /// Light from one of [`Self::lights`] reflected at a point of the surface.
    pub fn reflected_cd_m2(&self, unit: DVec3, light: &Light) -> [f64; 3] {
        let surface = &self.body.surface;
        let factor = surface.law.luminance_factor(self.normal(unit).dot(light.direction), self.cos_e(unit));
        if factor == 0.0 {
            return [0.0; 3];
        }
        let texture = surface.texture.as_ref().map_or([1.0; 3], |texture| texture.sample(unit));
        let reflectance = |c: usize| surface.geometric_albedo[c] * texture[c] * factor / std::f64::consts::PI;
        let open = |shadow: Shadow| shadow.open_share(unit * self.body.radii_m, light.direction);
        let open = light.shadow.map_or([1.0; 3], open);
        [0, 1, 2].map(|c| reflectance(c) * light.illuminance_lx[c] * open[c] * self.body.seen_through[c])
    }

    fn normal(&self, unit: DVec3) -> DVec3 {
        (unit / self.body.radii_m).normalize()
    }

    /// At the limb, rounding must not put the eye below the horizon.
    fn cos_e(&self, unit: DVec3) -> f64 {
        let to_eye = ((self.eye - unit) * self.body.radii_m).normalize();
        self.normal(unit).dot(to_eye).max(0.0)
    }
}

/// Whether a body covers a direction (unit vector, world axes) at a time, s, as seen from `eye_m`. The outline is exact. An eye inside the body sees
/// through it.
pub fn hides(body: &Body, eye_m: DVec3, direction: DVec3, time_s: f64) -> bool {
    SeenBody::new(body, eye_m, &[], time_s).hit(direction).is_some()
}
