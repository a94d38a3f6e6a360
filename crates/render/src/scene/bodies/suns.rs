//! The suns of a scene, and their light on bodies.

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    sync::Arc,
};

use glam::{DQuat, DVec3};

use super::{Body, Emission, Occluder, Shadow, preset, shape::light_over_sphere};
use crate::{
    photometry::{
        phase_curve::{self, Tilt},
        rec709::luminance,
        reflection::sphere_illuminance_lx,
    },
    scene::SceneObjects,
    solar_system::SolarBody,
};

/// Light from other bodies is ignored below this fraction of the suns' light: 17.5 magnitudes.
const LEAST_REFLECTED: f64 = 1e-7;
/// Radius of the Earth's shadow without its air, m: the equatorial radius.
const EARTH_M: f64 = 6_378_137.0;

/// A body that emits light. It is treated as far away.
#[derive(Clone, Debug, PartialEq)]
pub struct Sun {
    /// Its centre: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Luminous intensity as linear Rec. 709, cd (lx m^2): illuminance times the square of the distance. For a
    /// non-spherical body, the mean over all directions.
    pub intensity_cd: [f64; 3],
    /// Radius of the sphere with the same mean projected area, m.
    pub radius_m: f64,
    /// Bodies that can hide it.
    pub occluders: Arc<[Occluder]>,
    /// Bodies that can reflect its light onto others.
    pub reflectors: Arc<[Arc<Body>]>,
    /// Year of the scene, or the nearest year in which the measured brightness of all bodies is the same ([`phase_curve::year_of_brightness`]).
    pub year: f64,
}

/// The light of a sun at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards the sun, world axes.
    pub direction: DVec3,
    /// Illuminance on a surface facing the sun, as linear Rec. 709, lx, outside of the shadow.
    pub illuminance_lx: [f64; 3],
    /// The deepest shadow on the lit body.
    pub shadow: Option<Shadow>,
}

impl Light {
    /// The same light in other axes.
    #[must_use]
    pub fn turned(&self, rotation: DQuat) -> Self {
        let turned =
            |shadow: Shadow| Shadow { offset_m: rotation * shadow.offset_m, pole: rotation * shadow.pole, ..shadow };
        let shadow = self.shadow.map(turned);
        Self { direction: rotation * self.direction, shadow, ..*self }
    }
}

impl Sun {
    /// The sun of a body with an emission.
    fn from_body(body: &Body, emission: &Emission, around: &Around) -> Self {
        // A limb-darkened element emits pi L(1) (1 - u / 3) over all directions, and the surface is four times the mean
        // projected area.
        let radius_m = mean_radius_m(body.radii_m);
        let factor = PI * radius_m * radius_m * emission.mean_over_middle();
        Self {
            position_m: body.position_m,
            intensity_cd: emission.luminance_cd_m2.map(|channel| channel * factor),
            radius_m,
            occluders: Arc::clone(&around.occluders),
            reflectors: Arc::clone(&around.reflectors),
            year: around.year,
        }
    }

    /// Its light at a position, m; `None` at its exact centre.
    pub fn light_at(&self, place_m: DVec3) -> Option<Light> {
        let to_sun_m = self.position_m - place_m;
        let distance_m = to_sun_m.length();
        (distance_m > 0.0).then(|| Light {
            direction: to_sun_m / distance_m,
            illuminance_lx: self.intensity_cd.map(|channel| channel / distance_m / distance_m),
            shadow: None,
        })
    }

    /// Its light on a body, with the deepest shadow there.
    fn light_on(&self, body: &Body) -> Option<Light> {
        let light = self.light_at(body.position_m)?;
        let distance_m = (self.position_m - body.position_m).length();
        let sun_rad = (self.radius_m / distance_m).min(1.0).asin();
        let shadows =
            self.occluders.iter().filter_map(|occluder| occluder.shadow_on(body, light.direction, distance_m, sun_rad));
        let deepest = shadows.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(shadow, _)| shadow);
        Some(Light { shadow: deepest, ..light })
    }
}

/// Bodies around the suns, and the year.
struct Around {
    occluders: Arc<[Occluder]>,
    reflectors: Arc<[Arc<Body>]>,
    year: f64,
}

/// The suns of a scene: its bodies with an emission, in their order.
pub fn suns(objects: &SceneObjects) -> Vec<Sun> {
    let body_occluders = objects.bodies.iter().map(|body| Occluder::from_body(body));
    // An observer is on the Earth, which is not in the list of bodies.
    let earth = objects.earth_m.map(|position_m| Occluder::earth(position_m, EARTH_M));
    let dark = objects.bodies.iter().filter(|body| body.emission.is_none()).cloned();
    let around = Around {
        occluders: body_occluders.chain(earth).collect(),
        reflectors: dark
            .chain(objects.earth_m.map(|at_m| Arc::new(Body::preset(SolarBody::Earth, "", at_m))))
            .collect(),
        year: phase_curve::year_of_brightness(objects.time_s),
    };
    objects.bodies.iter().filter_map(|body| Some(Sun::from_body(body, body.emission.as_ref()?, &around))).collect()
}

/// Returns the light of suns on a body for an eye at `eye_m` (world axes). If the body has a measured phase curve, the illuminance is scaled so that
/// a body of the measured size and albedo sends the eye the light that the curve gives. Suns whose centre lies within the body, such as the body
/// itself, do not light it.
///
/// Nearby bodies also light it with the sunlight that they reflect: the light of the Earth on the Moon.
pub fn lights_on(body: &Body, suns: &[Sun], eye_m: DVec3) -> Vec<Light> {
    let direct = suns_on(body, suns, eye_m);
    let direct_lx: f64 = direct.iter().map(|light| luminance(light.illuminance_lx)).sum();
    let (reflectors, year) = suns.first().map_or((&[][..], 0.0), |sun| (&sun.reflectors[..], sun.year));
    let reflected = reflectors.iter().filter_map(|reflector| {
        let to_reflector_m = reflector.position_m - body.position_m;
        let distance_m = to_reflector_m.length();
        let radius_m = mean_radius_m(reflector.radii_m);
        // Upper bound: the light that a white disc reflects at full phase. Distant bodies are skipped, and so are bodies that touch the lit one.
        let most = (radius_m / distance_m).powi(2);
        if most < LEAST_REFLECTED || distance_m < radius_m + body.radii_m.max_element() {
            return None;
        }
        let lights = suns_on(reflector, suns, body.position_m);
        let illuminance_lx = lights.iter().fold([0.0; 3], |sum, light| {
            let open = light.shadow.map_or([1.0; 3], |shadow| shadow.open_share_of_body(radius_m, light.direction));
            let lx = reflected_lx(reflector, -to_reflector_m, light);
            [0, 1, 2].map(|c| sum[c] + lx[c] * open[c])
        });
        let light = Light { direction: to_reflector_m / distance_m, illuminance_lx, shadow: None };
        let is_seen = luminance(illuminance_lx) > LEAST_REFLECTED * direct_lx;
        is_seen.then(|| with_phase_curve(light, body, eye_m, year))
    });
    direct.iter().copied().chain(reflected).collect()
}

/// Returns the illuminance that a distant body's reflection of one light causes at an eye at `to_eye_m` from the body's centre, without shadows:
/// linear Rec. 709, lx.
pub fn reflected_lx(body: &Body, to_eye_m: DVec3, light: &Light) -> [f64; 3] {
    let (radius_m, distance_m) = (mean_radius_m(body.radii_m), to_eye_m.length());
    let towards_eye = to_eye_m / distance_m;
    let phase_rad = towards_eye.cross(light.direction).length().atan2(towards_eye.dot(light.direction));
    let shape = light_over_sphere(body, towards_eye, light.direction);
    [0, 1, 2].map(|c| {
        let (law, albedo) = (body.surface.law, body.surface.geometric_albedo[c]);
        shape * sphere_illuminance_lx(law, albedo, light.illuminance_lx[c], radius_m, distance_m, phase_rad)
    })
}

/// The direct light of suns on a body.
fn suns_on(body: &Body, suns: &[Sun], eye_m: DVec3) -> Vec<Light> {
    // Half the smallest axis: it does not depend on the body's rotation, and two suns that do not overlap are never this close.
    let within_m = body.radii_m.min_element() / 2.0;
    let outside = suns.iter().filter(|sun| (sun.position_m - body.position_m).length() > within_m);
    outside.filter_map(|sun| Some(with_phase_curve(sun.light_on(body)?, body, eye_m, sun.year))).collect()
}

/// The light of a sun, scaled to the body's measured phase curve in a year.
fn with_phase_curve(mut light: Light, body: &Body, eye_m: DVec3, year: f64) -> Light {
    if let Some(measured_body) = body.surface.phase_curve {
        let to_eye_m = eye_m - body.position_m;
        // No eye is at the exact centre of a body.
        let phase_rad = if to_eye_m == DVec3::ZERO { 0.0 } else { light.direction.angle_between(to_eye_m) };
        let (albedo, radius_m) = preset::measured(measured_body);
        let pole = body.orientation * DVec3::Z;
        let latitude_rad = |towards: DVec3| FRAC_PI_2 - pole.angle_between(towards);
        let eye_rad = if to_eye_m == DVec3::ZERO { 0.0 } else { latitude_rad(to_eye_m) };
        let tilt = Tilt { eye_rad, sun_rad: latitude_rad(light.direction) };
        let factor = phase_curve::factor(measured_body, body.surface.law, albedo, radius_m, phase_rad, tilt, year);
        // The factor applies to a sphere. All curves include the effect of the body's outline, and Saturn's curve includes the change of its outline
        // with the tilt.
        let shape = to_eye_m.try_normalize().map_or(1.0, |to_eye| light_over_sphere(body, to_eye, light.direction));
        let scale = factor / (shape * tint(body.surface.geometric_albedo, light.illuminance_lx));
        light.illuminance_lx = light.illuminance_lx.map(|channel| channel * scale);
    }
    light
}

/// Luminance that a coloured surface reflects from coloured light, relative to the product of the luminances of surface and light. The curves refer
/// to this product. The ratio is 0.98 to 1.02 for the presets in sunlight.
fn tint(albedo: [f64; 3], illuminance_lx: [f64; 3]) -> f64 {
    let reflected = luminance([0, 1, 2].map(|c| albedo[c] * illuminance_lx[c]));
    let product = luminance(albedo) * luminance(illuminance_lx);
    if reflected > 0.0 && product > 0.0 { reflected / product } else { 1.0 }
}

/// Radius of the sphere with the mean projected area of an ellipsoid, m.
pub fn mean_radius_m(radii_m: DVec3) -> f64 {
    if radii_m == DVec3::splat(radii_m.x) { radii_m.x } else { (mean_projected_area_m2(radii_m) / PI).sqrt() }
}

/// Projected area of an ellipsoid, averaged over all directions, m^2: a quarter of its surface (Cauchy). In closed form
/// if x and y are equal.
fn mean_projected_area_m2(radii_m: DVec3) -> f64 {
    let DVec3 { x: across, y, z: along } = radii_m;
    if across == y {
        let squared_e = 1.0 - (along / across).powi(2);
        // artanh(e) (1 - e^2) / e if oblate, or asin(e) / (e cos asin(e)) if prolate, each with its own definition of e.
        // Near the sphere both are (1 - e^2) (1 + e^2 / 3 + ...).
        let side_term = if squared_e.abs() < 1e-6 {
            (1.0 - squared_e) * (1.0 + squared_e / 3.0)
        } else if squared_e > 0.0 {
            (1.0 - squared_e) / squared_e.sqrt() * squared_e.sqrt().atanh()
        } else {
            let tangent = (-squared_e).sqrt();
            (1.0 - squared_e) * tangent.atan() / tangent
        };
        return PI / 2.0 * across * across * (1.0 + side_term);
    }
    triaxial_mean_projected_area_m2(radii_m)
}

/// The same area as a mean over directions: along n it is pi |(b c n_x, a c n_y, a b n_z)|.
fn triaxial_mean_projected_area_m2(radii_m: DVec3) -> f64 {
    const N: usize = 64;
    let products = DVec3::new(radii_m.y * radii_m.z, radii_m.x * radii_m.z, radii_m.x * radii_m.y);
    let largest = products.max_element();
    let mut sum = 0.0;
    for i in 0..N {
        // Equal steps of z and of longitude cover equal areas.
        let z = (i as f64 + 0.5) / N as f64 * 2.0 - 1.0;
        let across = (1.0 - z * z).sqrt();
        for j in 0..N {
            let (sin, cos) = ((j as f64 + 0.5) / N as f64 * TAU).sin_cos();
            sum += (products / largest * DVec3::new(across * cos, across * sin, z)).length();
        }
    }
    PI * largest * sum / (N * N) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scene::bodies::{ReflectionLaw, Surface},
        units::{ASTRONOMICAL_UNIT_M, illuminance_lx_from_magnitude},
    };

    /// A grey sphere of the Moon's size, between Sun and Earth, or moved from there around the Earth.
    fn grey_moon(angle_rad: f64, distance_m: f64) -> Body {
        let surface =
            Surface { law: ReflectionLaw::Lambert, geometric_albedo: [0.1; 3], phase_curve: None, texture: None };
        let (sin, cos) = angle_rad.sin_cos();
        let position_m = DVec3::X * ASTRONOMICAL_UNIT_M + DVec3::new(-cos, sin, 0.0) * distance_m;
        Body { surface, ..Body::preset(SolarBody::Moon, "moon", position_m) }
    }

    fn reflected_on(moon: &Body, others: &[SolarBody]) -> Vec<Light> {
        let place_of = |body: &SolarBody| match body {
            SolarBody::Sun => DVec3::ZERO,
            _ => DVec3::X * ASTRONOMICAL_UNIT_M,
        };
        let bodies = others
            .iter()
            .map(|other| Arc::new(Body::preset(*other, &format!("{other:?}"), place_of(other))))
            .chain([Arc::new(moon.clone())]);
        let objects = SceneObjects { bodies: bodies.collect(), ..SceneObjects::default() };
        let mut lights = lights_on(moon, &suns(&objects), DVec3::Z * 1e12);
        // The first light, from the Sun, is by far the strongest.
        assert!(luminance(lights[0].illuminance_lx) > 1e5, "{lights:?}");
        lights.remove(0);
        lights
    }

    #[test]
    fn the_full_earth_lights_the_moon() {
        let lights = reflected_on(&grey_moon(0.05, 3.844e8), &[SolarBody::Sun, SolarBody::Earth]);
        // V = -3.99 at 1 au from both (Mallama and Hilton 2018): -16.94 from the Moon.
        let expected = illuminance_lx_from_magnitude(-3.99 + 5.0 * (3.844e8 / ASTRONOMICAL_UNIT_M).log10());
        let found = luminance(lights[0].illuminance_lx);
        println!("{found:.2} lx, {expected:.2} from the Earth's magnitude");
        assert!(lights.len() == 1 && (found / expected - 1.0).abs() < 0.03, "{found} {expected}");
        assert!(lights[0].direction.angle_between(DVec3::X) < 0.051);
        // On the line to the Sun, the Moon's shadow covers (1737 / 6371)^2 of the Earth.
        let eclipsed =
            luminance(reflected_on(&grey_moon(0.0, 3.844e8), &[SolarBody::Sun, SolarBody::Earth])[0].illuminance_lx);
        assert!((eclipsed / found - 0.926).abs() < 0.01, "{}", eclipsed / found);
        let half =
            luminance(reflected_on(&grey_moon(1.57, 3.844e8), &[SolarBody::Sun, SolarBody::Earth])[0].illuminance_lx);
        assert!((0.1..0.45).contains(&(half / found)), "{}", half / found);
        // The Earth adds no light if its night side faces the Moon, if it is far away, or if it does not exist.
        assert!(
            reflected_on(&grey_moon(std::f64::consts::PI, 3.844e8), &[SolarBody::Sun, SolarBody::Earth]).is_empty()
        );
        assert!(reflected_on(&grey_moon(0.0, 3e10), &[SolarBody::Sun, SolarBody::Earth]).is_empty());
        assert!(reflected_on(&grey_moon(0.0, 3.844e8), &[SolarBody::Sun]).is_empty());
    }

    #[test]
    fn the_mean_projected_area_is_a_quarter_of_the_surface() {
        assert!((mean_projected_area_m2(DVec3::splat(3.0)) / (9.0 * PI) - 1.0).abs() < 1e-14);
        for along in [0.5, 0.999, 0.999_999_9, 1.000_000_1, 1.001, 2.0] {
            let radii_m = DVec3::new(1.0, 1.0, along) * 2.0;
            let [closed, summed] = [mean_projected_area_m2(radii_m), triaxial_mean_projected_area_m2(radii_m)];
            assert!((closed / summed - 1.0).abs() < 2e-4, "{along}: {closed} {summed}");
            let turned = mean_projected_area_m2(DVec3::new(1.0, along, 1.0) * 2.0);
            assert!((turned / closed - 1.0).abs() < 2e-4, "{along}: {turned} {closed}");
        }
        // The surface of an oblate ellipsoid: 2 pi a^2 (1 + (1 - e^2) / e artanh e).
        let (a, c) = (2.0f64, 1.0f64);
        let e = (1.0 - c * c / (a * a)).sqrt();
        let surface = TAU * a * a * (1.0 + (1.0 - e * e) / e * e.atanh());
        let found = mean_projected_area_m2(DVec3::new(a, a, c));
        assert!((found / (surface / 4.0) - 1.0).abs() < 1e-14, "{found} {surface}");
    }
}
