//! Shadows of bodies on each other: umbra and penumbra for suns that are discs.
//!
//! A sun is a disc of uniform luminance, and the occluder is a sphere: the hidden fraction is that of circles in a
//! plane. The air of the Earth refracts a little light into its shadow, and enlarges it by a hundredth of its radius
//! (A. Danjon, Comptes Rendus 173, 706, 1921: a hundredth of the Moon's parallax).

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
    /// Radius of its shadow at the body, m.
    pub radius_m: f64,
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
    /// Angular radius of the sun, rad.
    pub sun_rad: f64,
    /// See [`Occluder`].
    pub refracted: [f64; 3],
}

impl Occluder {
    /// The occluder for a body.
    pub fn from_body(body: &Body) -> Self {
        // Radius of the sphere with the same volume.
        let radius_m = body.radii_m.element_product().cbrt();
        match body.ephemeris.and_then(Ephemeris::stands_as) {
            Some(SolarBody::Earth) => Self::earth(body.position_m, body.radii_m.max_element()),
            _ => Self { position_m: body.position_m, radius_m, refracted: [0.0; 3] },
        }
    }

    /// The Earth with its air.
    pub fn earth(position_m: DVec3, radius_m: f64) -> Self {
        Self { position_m, radius_m: EARTH_ENLARGED * radius_m, refracted: EARTH_REFRACTED }
    }

    /// Its shadow on a body in the light of a sun, given by its direction from the body (unit vector), its distance, m,
    /// and its angular radius, rad. The second result is the depth to which the body reaches into the penumbra, m.
    /// `None` if it does not.
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
        // The occluder must be between the two, and must not be one of them.
        if along_m <= 0.0 || along_m >= 0.999 * sun_distance_m || offset_m.length() < 0.5 * largest_m {
            return None;
        }
        let penumbra_m = self.radius_m + (along_m + largest_m) * sun_rad.tan();
        let reach_m = penumbra_m + largest_m - (offset_m - to_sun * along_m).length();
        let shadow = Shadow { offset_m, radius_m: self.radius_m, sun_rad, refracted: self.refracted };
        (reach_m > 0.0).then_some((shadow, reach_m))
    }
}

impl Shadow {
    /// Fraction of the sun's light that arrives at a position, m from the body's centre, by channel; `to_sun`: unit
    /// vector.
    pub fn open_share(&self, place_m: DVec3, to_sun: DVec3) -> [f64; 3] {
        let towards = self.offset_m - place_m;
        let distance_m = towards.length();
        let own_rad = (self.radius_m / distance_m).min(1.0).asin();
        let apart_rad = towards.cross(to_sun).length().atan2(towards.dot(to_sun));
        let hidden = hidden_share(self.sun_rad, own_rad, apart_rad);
        self.refracted.map(|refracted| 1.0 - hidden * (1.0 - refracted))
    }

    /// Fraction of the light that arrives on a whole body of a given radius, m, by channel: that at its centre, but the
    /// loss is at most the fraction that the occluder's cross-section covers.
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
        // A Moon on the other side of the Earth is not in shadow; the Earth is in the Moon's shadow.
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
