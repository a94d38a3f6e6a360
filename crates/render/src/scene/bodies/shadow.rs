//! Shadows of bodies on each other: umbra and penumbra for suns that are discs.
//!
//! A sun is a disc of uniform luminance, and the occluder is a sphere or a spheroid: the hidden fraction is computed from circles in a plane. The
//! circle of a spheroid has the radius of its outline in the direction of the sun's centre; the error is less than a hundredth of the flattening if
//! the sun is small compared with the occluder. The air of the Earth refracts a little light into the Earth's shadow, and enlarges the shadow by a
//! hundredth of its radius (A. Danjon, Comptes Rendus 173, 706, 1921: a hundredth of the Moon's parallax).

use std::f64::consts::PI;

use glam::DVec3;

use super::Body;
use crate::{ephemeris::Ephemeris, solar_system::SolarBody};

/// Factor by which the Earth's air enlarges its shadow.
const EARTH_ENLARGED: f64 = 1.01;
/// Fraction of the Sun's light that the Earth's air refracts into its shadow, by channel: in a total eclipse the Moon
/// has V near 0, compared with -12.7.
const EARTH_REFRACTED: [f64; 3] = [1.9e-5, 0.8e-5, 0.4e-5];

/// A body that can hide a sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occluder {
    /// Its centre, m.
    pub position_m: DVec3,
    /// Radius of its shadow at the occluder, m; for a spheroid, the equatorial radius.
    pub radius_m: f64,
    /// Its pole, unit vector, world axes.
    pub pole: DVec3,
    /// Square of the ratio of its equatorial and polar radii, minus 1; 0: a sphere.
    pub oblate: f64,
    /// Fraction of the light that arrives where a sun is completely hidden, by channel.
    pub refracted: [f64; 3],
}

/// The shadow of one body on another one, in the light of a sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    /// Centre of the occluder relative to the centre of the shadowed body, in the axes of the light's direction, m.
    pub offset_m: DVec3,
    /// See [`Occluder`].
    pub radius_m: f64,
    /// See [`Occluder`]; in the axes of the light's direction.
    pub pole: DVec3,
    /// See [`Occluder`].
    pub oblate: f64,
    /// Angular radius of the sun, rad.
    pub sun_rad: f64,
    /// See [`Occluder`].
    pub refracted: [f64; 3],
}

impl Occluder {
    /// The occluder for a body.
    pub fn from_body(body: &Body) -> Self {
        let DVec3 { x: equator_m, y: other_m, z: polar_m } = body.radii_m;
        // If the equator is not round, use the sphere with the same volume.
        let (radius_m, oblate) = if equator_m == other_m {
            (equator_m, (equator_m / polar_m).powi(2) - 1.0)
        } else {
            (body.radii_m.element_product().cbrt(), 0.0)
        };
        let pole = body.orientation * DVec3::Z;
        match body.ephemeris.and_then(Ephemeris::stands_as) {
            Some(SolarBody::Earth) => Self::earth(body.position_m, body.radii_m.max_element()),
            _ => Self { position_m: body.position_m, radius_m, pole, oblate, refracted: [0.0; 3] },
        }
    }

    /// The Earth with its air, as a sphere.
    pub fn earth(position_m: DVec3, radius_m: f64) -> Self {
        let radius_m = EARTH_ENLARGED * radius_m;
        Self { position_m, radius_m, pole: DVec3::Z, oblate: 0.0, refracted: EARTH_REFRACTED }
    }

    /// Returns its shadow on a body in the light of a sun. The sun is given by its direction from the body (unit vector), its distance, m, and its
    /// angular radius, rad. The second result is the depth to which the body reaches into the penumbra, m. `None`: the body does not reach into it.
    pub(super) fn shadow_on(
        &self,
        body: &Body,
        to_sun: DVec3,
        sun_distance_m: f64,
        sun_rad: f64,
    ) -> Option<(Shadow, f64)> {
        let offset_m = self.position_m - body.position_m;
        let largest_m = body.radii_m.max_element();
        let along_m = offset_m.dot(to_sun);
        // The occluder must be between the body and the sun, and must not be either of them.
        if along_m <= 0.0 || along_m >= 0.999 * sun_distance_m || offset_m.length() < 0.5 * largest_m {
            return None;
        }
        let penumbra_m = self.radius_m + (along_m + largest_m) * sun_rad.tan();
        let reach_m = penumbra_m + largest_m - (offset_m - to_sun * along_m).length();
        let Self { radius_m, pole, oblate, refracted, .. } = *self;
        let shadow = Shadow { offset_m, radius_m, pole, oblate, sun_rad, refracted };
        (reach_m > 0.0).then_some((shadow, reach_m))
    }
}

impl Shadow {
    /// Fraction of the sun's light that arrives at a position, m from the body's centre, by channel; `to_sun`: unit
    /// vector.
    pub fn open_share(&self, place_m: DVec3, to_sun: DVec3) -> [f64; 3] {
        let towards = self.offset_m - place_m;
        let distance_m = towards.length();
        let own_rad = (self.outline_m(towards, to_sun) / distance_m).min(1.0).asin();
        let apart_rad = towards.cross(to_sun).length().atan2(towards.dot(to_sun));
        let hidden = hidden_share(self.sun_rad, own_rad, apart_rad);
        self.refracted.map(|refracted| 1.0 - hidden * (1.0 - refracted))
    }

    /// Radius of the occluder's outline, seen along the light, in the direction of an offset, m.
    fn outline_m(&self, offset_m: DVec3, to_sun: DVec3) -> f64 {
        let across = offset_m - to_sun * offset_m.dot(to_sun);
        if self.oblate == 0.0 || across == DVec3::ZERO {
            return self.radius_m;
        }
        let (squared, along) = (self.pole.dot(across).powi(2) / across.length_squared(), self.pole.dot(to_sun));
        self.radius_m / (1.0 + self.oblate * squared / (1.0 + self.oblate * along * along)).sqrt()
    }

    /// Fraction of the light that arrives on a whole body of a given radius, m, by channel. It is the fraction at the body's centre, but the loss is
    /// limited to the fraction of the body that the occluder's cross-section covers.
    pub fn open_share_of_body(&self, radius_m: f64, to_sun: DVec3) -> [f64; 3] {
        let most = (self.radius_m / radius_m).powi(2);
        self.open_share(DVec3::ZERO, to_sun).map(|open| 1.0 - (1.0 - open).min(most))
    }
}

/// Fraction of a disc of angular radius `radius` that is hidden by another one, with centres `apart` (all in rad):
/// areas of circles in a plane.
pub fn hidden_share(radius: f64, other: f64, apart: f64) -> f64 {
    if apart >= radius + other {
        return 0.0;
    }
    if apart <= (other - radius).abs() {
        return if other >= radius { 1.0 } else { (other / radius).powi(2) };
    }
    let half_angle = |own: f64, other: f64| {
        ((apart * apart + own * own - other * other) / (2.0 * apart * own)).clamp(-1.0, 1.0).acos()
    };
    let (own, its) = (half_angle(radius, other), half_angle(other, radius));
    let lens = radius * radius * (own - own.sin() * own.cos()) + other * other * (its - its.sin() * its.cos());
    lens / (PI * radius * radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{
        SceneObjects,
        bodies::{lights_on, suns},
    };

    #[test]
    fn hidden_share_is_the_overlap_of_circles() {
        assert_eq!(hidden_share(1.0, 1.1, 0.05), 1.0);
        assert_eq!(hidden_share(1.0, 0.5, 0.3), 0.25);
        assert_eq!(hidden_share(1.0, 1.0, 2.1), 0.0);
        // Two equal circles with centres a radius apart: 2/3 - sqrt(3)/(2 pi).
        assert!((hidden_share(1.0, 1.0, 1.0) - (2.0 / 3.0 - 3f64.sqrt() / (2.0 * PI))).abs() < 1e-12);
    }

    #[test]
    fn the_earth_has_an_umbra_and_a_penumbra_at_the_moon() {
        const AU_M: f64 = 1.495_978_707e11;
        let sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
        let mut earth = Body::preset(SolarBody::Earth, "earth", DVec3::X * AU_M);
        earth.ephemeris = Some(SolarBody::Earth.into());
        let moon_at = |aside_m: f64| Body::preset(SolarBody::Moon, "moon", DVec3::new(AU_M + 3.844e8, aside_m, 0.0));
        let middle = |aside_m: f64| {
            let bodies = [sun.clone(), earth.clone(), moon_at(aside_m)].map(std::sync::Arc::new).to_vec();
            let objects = SceneObjects { bodies, ..Default::default() };
            let lights = lights_on(&objects.bodies[2], &suns(&objects), DVec3::X * AU_M);
            lights[0].shadow.map_or([1.0; 3], |shadow| shadow.open_share(DVec3::ZERO, lights[0].direction))
        };
        // Radii of umbra and penumbra 384,400 km behind the Earth: 1.01 R -+ d R_sun / AU, to within 1e-3.
        let spread_m = 3.844e8 * (6.957e8 / AU_M);
        let (umbra_m, penumbra_m) = (1.01 * 6.3781e6 - spread_m, 1.01 * 6.3781e6 + spread_m);
        for aside_m in [0.0, 0.99 * umbra_m] {
            let found = middle(aside_m);
            assert!((0..3).all(|c| (found[c] - EARTH_REFRACTED[c]).abs() < 1e-12), "{aside_m}: {found:?}");
        }
        let edge = middle(0.5 * (umbra_m + penumbra_m))[1];
        assert!((0.3..0.7).contains(&edge), "{edge}");
        assert!(middle(0.98 * penumbra_m)[1] > 0.97 && middle(1.02 * penumbra_m) == [1.0; 3]);
        // If the Moon is on the sunward side of the Earth, the Moon is not in shadow, but the Earth is in the Moon's shadow.
        let bodies = [sun.clone(), earth.clone(), Body::preset(SolarBody::Moon, "moon", DVec3::X * (AU_M - 3.844e8))];
        let objects = SceneObjects { bodies: bodies.map(std::sync::Arc::new).to_vec(), ..Default::default() };
        let suns = suns(&objects);
        assert_eq!(lights_on(&objects.bodies[2], &suns, DVec3::ZERO)[0].shadow, None);
        let on_earth = lights_on(&objects.bodies[1], &suns, DVec3::ZERO)[0];
        let share =
            |place_m: DVec3| on_earth.shadow.map_or(1.0, |shadow| shadow.open_share(place_m, on_earth.direction)[1]);
        assert!(share(DVec3::NEG_X * 6.371e6) < 0.12 && share(DVec3::Y * 6.371e6) == 1.0);
    }

    #[test]
    fn the_shadow_of_a_flattened_planet_is_flattened() {
        // Saturn and a moon 20 radii behind it. The light at the moon is the fraction of the Sun's disc that unblocked rays reach. The ellipsoid
        // blocks a ray if, in units of the semi-axes, the ray meets the unit sphere.
        let au_m = crate::units::ASTRONOMICAL_UNIT_M;
        for tilt_deg in [0.0_f64, 20.0, 60.0] {
            let mut saturn = Body::preset(SolarBody::Saturn, "saturn", DVec3::X * 9.5 * au_m);
            saturn.orientation = glam::DQuat::from_rotation_y(tilt_deg.to_radians());
            let radii_m = saturn.radii_m;
            let sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
            let sun_rad = sun.radii_m.x / (9.5 * au_m);
            let mut worst = [0.0_f64; 2];
            for (step, turn) in (0..60).flat_map(|step| [0.0_f64, 0.7, 1.5].map(|turn| (step, turn))) {
                let aside_m = radii_m.x * (0.86 + 0.004 * f64::from(step));
                let aside = DVec3::new(0.0, turn.cos(), turn.sin()) * aside_m;
                let place_m = saturn.position_m + DVec3::X * 20.0 * radii_m.x + aside;
                let moon = Body { radii_m: DVec3::splat(1.0), ..Body::preset(SolarBody::Titan, "moon", place_m) };
                let objects = SceneObjects {
                    bodies: [&sun, &saturn, &moon].map(|body| body.clone().into()).to_vec(),
                    ..Default::default()
                };
                let light = lights_on(&moon, &suns(&objects), DVec3::ZERO)[0];
                let open = |shadow: Shadow| shadow.open_share(DVec3::ZERO, light.direction)[1];
                let found = light.shadow.map_or(1.0, open);
                let as_sphere = |shadow: Shadow| {
                    let radius_m = radii_m.element_product().cbrt();
                    open(Shadow { oblate: 0.0, radius_m, ..shadow })
                };
                let (side, up) = light.direction.any_orthonormal_pair();
                let (mut free, mut all) = (0.0, 0.0);
                for (i, j) in (0..60).flat_map(|i| (0..60).map(move |j| (i, j))) {
                    let at = |index: i32| (f64::from(index) + 0.5) / 30.0 - 1.0;
                    let (x, y) = (at(i), at(j));
                    if x * x + y * y > 1.0 {
                        continue;
                    }
                    let ray = light.direction + (side * x + up * y) * sun_rad;
                    let to_body = saturn.orientation.conjugate();
                    let (from, ray) = (to_body * (place_m - saturn.position_m) / radii_m, to_body * ray / radii_m);
                    all += 1.0;
                    free += f64::from(u8::from(from.cross(ray).length() > ray.length()));
                }
                let expected: f64 = free / all;
                let sphere = light.shadow.map_or(1.0, as_sphere);
                worst = [worst[0].max((found - expected).abs()), worst[1].max((sphere - expected).abs())];
            }
            println!("tilt {tilt_deg}: largest error of the light {:.3}, of a sphere {:.3}", worst[0], worst[1]);
            assert!(worst[0] < 0.04 && worst[1] > 0.3, "{tilt_deg}: {worst:?}");
        }
    }

    #[test]
    fn a_small_moon_dims_a_planet_by_at_most_its_area() {
        let sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
        let jupiter = Body::preset(SolarBody::Jupiter, "jupiter", DVec3::X * 5.2 * crate::units::ASTRONOMICAL_UNIT_M);
        let io = Body::preset(SolarBody::Io, "io", DVec3::X * (5.2 * crate::units::ASTRONOMICAL_UNIT_M - 4.22e8));
        let objects = SceneObjects {
            bodies: [&sun, &jupiter, &io].map(|body| body.clone().into()).to_vec(),
            ..Default::default()
        };
        let light = lights_on(&jupiter, &suns(&objects), DVec3::ZERO)[0];
        let shadow = light.shadow.unwrap();
        assert!(
            shadow.open_share(DVec3::X * -jupiter.radii_m.x, light.direction)[1] < 1e-9,
            "the umbra is on the clouds"
        );
        let share = 1.0 - shadow.open_share_of_body(jupiter.radii_m.x, light.direction)[1];
        assert!((share / (1821.49f64 / 71_492.0).powi(2) - 1.0).abs() < 1e-9, "{share}");
        assert_eq!(shadow.open_share_of_body(1e6, light.direction), shadow.open_share(DVec3::ZERO, light.direction));
    }
}
