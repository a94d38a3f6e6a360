//! Light of bodies as sources of glare: a few sources for each eye, at the apparent positions of the bodies. Hidden parts are left out.
//!
//! A body wider than the inner angle of glare has as many sources as its disc and its light require. Every pixel evaluates all of them, so
//! there are at most [`MOST_SOURCES`].

use glam::{DMat3, DVec3};

use crate::{
    photometry::{glare::GlareKernel, rec709::luminance},
    scene::{
        SceneObjects,
        bodies::{SeenBody, Sun, hides, lights_on},
    },
};

/// Maximum number of sources of an eye, including parts.
pub const MOST_SOURCES: usize = 256;
/// Minimum and maximum number of parts of a disc that has parts.
const LEAST_PARTS: usize = 12;
const MOST_PARTS: usize = 48;
/// Minimum number of lit parts. To reach it, the disc of a crescent is divided into more and smaller parts, at most about [`MOST_OF_CRESCENT`].
const LEAST_LIT: usize = 6;
const MOST_OF_CRESCENT: usize = 2048;
/// Half width of a part, in units of the disc's radius divided by the root of the number of parts. It is wide enough that a disc of parts looks
/// smooth.
const SOFTNESS: f64 = 2.0;
/// Distance between the parts of a disc, rad: two thirds of the default inner angle of glare.
const SPACING_RAD: f64 = 1.2e-3;
/// A body with a smaller radius is one source, rad.
const SMALL_RAD: f64 = 3e-4;
/// Distance in radii from which a body counts as one source. For a kernel that is proportional to theta^-2, the error is then 1 %.
const FAR_RADII: f64 = 10.0;

/// A point of light: unit vector in world axes, and linear Rec. 709, lx.
pub type PointOfLight = (DVec3, [f64; 3]);

/// A source of glare for one eye.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// All of its light in one point.
    pub whole: PointOfLight,
    /// Angle from `whole` within which the parts replace it, rad.
    pub reach_rad: f64,
    /// Its parts; empty for a small source.
    pub parts: Vec<PointOfLight>,
    /// Half width of a part, rad: the kernel is evaluated at the root of the sum of the squares of the angle and this width.
    pub soft_rad: f64,
    /// Index of the body.
    pub body: usize,
}

impl Source {
    /// A source without parts.
    fn point(body: usize, direction: DVec3, light: [f64; 3]) -> Self {
        Self { whole: (direction, light), reach_rad: 0.0, parts: Vec::new(), soft_rad: 0.0, body }
    }

    /// Factor on the luminance of the body in a picture from which `fraction` is then subtracted as scattered light. The softened kernels of its
    /// parts omit the light that falls on the parts themselves: the fraction of `kernel` within their half width. That light stays on the
    /// disc, so the body keeps it.
    pub fn kept(&self, kernel: &dyn GlareKernel, fraction: f64) -> f64 {
        if self.parts.is_empty() || fraction >= 1.0 {
            return 1.0;
        }
        1.0 + fraction * kernel.share_within(self.soft_rad) / (1.0 - fraction)
    }
}

/// Light from an extended area of the sky, such as many small sources. Glare also covers the dark parts between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtendedSource {
    /// Centre: unit vector, world axes.
    pub direction: DVec3,
    /// Linear Rec. 709, lx.
    pub light: [f64; 3],
    /// Radius, rad.
    pub radius_rad: f64,
}

fn sum_of(lights: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    lights.fold([0.0; 3], |sum, light| [0, 1, 2].map(|channel| sum[channel] + light[channel]))
}

/// Sources of glare at an eye at `eye_m`, world axes. `lights`: indices of the bodies, and their illuminances, lx.
pub fn body_sources(objects: &SceneObjects, eye_m: DVec3, lights: &[(usize, [f64; 3])], suns: &[Sun]) -> Vec<Source> {
    let mut brightest: Vec<&(usize, [f64; 3])> = lights.iter().filter(|(_, light)| luminance(*light) > 0.0).collect();
    brightest.sort_by(|(_, a), (_, b)| luminance(*b).total_cmp(&luminance(*a)));
    brightest.truncate(MOST_SOURCES);
    // Every body is one source; the brightest bodies also have parts.
    let mut left = MOST_SOURCES - brightest.len();
    let mut sources = Vec::new();
    for (number, light) in brightest {
        let Some(mut source) = of_body(objects, eye_m, *number, *light, suns) else { continue };
        if source.parts.len() > left {
            source.parts.clear();
        }
        left -= source.parts.len();
        sources.push(source);
    }
    sources
}

/// Source of glare for the part of a body that others do not hide; `None`: all of the body is hidden.
fn of_body(objects: &SceneObjects, eye_m: DVec3, number: usize, light: [f64; 3], suns: &[Sun]) -> Option<Source> {
    let body = &objects.bodies[number];
    let offset_m = body.position_m - eye_m;
    let distance_m = offset_m.length();
    let axis = offset_m / distance_m;
    let radius_rad = body.angular_radius_rad(eye_m);
    let local_sky = objects.local_sky.as_deref();
    let seen_from_place = local_sky.map_or(DMat3::IDENTITY, |sky| sky.seen_body(offset_m, radius_rad));
    let apparent = |direction: DVec3| (seen_from_place * direction).normalize();
    let is_open = |direction: DVec3, distance_m: f64| {
        !local_sky.is_some_and(|sky| sky.hides(apparent(direction)))
            && objects.bodies.iter().enumerate().all(|(other, of)| {
                other == number
                    || (of.position_m - eye_m).length() > distance_m
                    || !hides(of, eye_m, direction, objects.time_s)
            })
    };
    // A small body is one point.
    let one =
        |direction: DVec3| is_open(direction, distance_m).then(|| Source::point(number, apparent(direction), light));
    if radius_rad < SMALL_RAD {
        return one(axis);
    }
    // Lit parts of the disc.
    let mut count = ((radius_rad / SPACING_RAD).powi(2).ceil() as usize).clamp(LEAST_PARTS, MOST_PARTS);
    let lights = lights_on(body, suns, eye_m);
    let seen = SeenBody::new(body, eye_m, &lights, objects.time_s);
    let (right, up) = axis.any_orthonormal_pair();
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let lit = |count: usize| -> Vec<(DVec3, [f64; 3], f64)> {
        let point = |i: usize| {
            // Equal parts of a cap around the body.
            let half_sine = (0.5 * radius_rad).sin() * ((i as f64 + 0.5) / count as f64).sqrt();
            let angle = 2.0 * half_sine.asin();
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            let direction = axis * angle.cos() + (right * cos + up * sin) * angle.sin();
            let hit = seen.hit(direction)?;
            Some((direction, seen.luminance_cd_m2(hit.unit), hit.distance_m))
        };
        (0..count).filter_map(point).filter(|(_, own, _)| luminance(*own) > 0.0).collect()
    };
    let mut points = lit(count);
    while points.len() < LEAST_LIT && count < MOST_OF_CRESCENT {
        count *= 4;
        points = lit(count);
    }
    if points.is_empty() {
        // No point lies on the narrow crescent: place one source at the limb, towards the sun.
        let towards = lights.iter().max_by(|a, b| luminance(a.illuminance_lx).total_cmp(&luminance(b.illuminance_lx)));
        let aside = towards.and_then(|towards| towards.direction.reject_from_normalized(axis).try_normalize());
        return one(aside.map_or(axis, |aside| axis * radius_rad.cos() + aside * radius_rad.sin()));
    }
    // Divide the light among the parts that are not hidden.
    let total = sum_of(points.iter().map(|(_, own, _)| *own));
    let share = |own: &[f64; 3]| [0, 1, 2].map(|c| if total[c] > 0.0 { light[c] * own[c] / total[c] } else { 0.0 });
    let parts: Vec<PointOfLight> = points
        .iter()
        .filter(|(direction, _, distance_m)| is_open(*direction, *distance_m))
        .map(|(direction, own, _)| (apparent(*direction), share(own)))
        .collect();
    let middle: DVec3 = parts.iter().map(|(direction, light)| *direction * luminance(*light)).sum();
    let whole = (middle.try_normalize()?, sum_of(parts.iter().map(|(_, light)| *light)));
    let soft_rad = SOFTNESS * radius_rad / (count as f64).sqrt();
    Some(Source { whole, reach_rad: FAR_RADII * radius_rad, parts, soft_rad, body: number })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]

    use std::sync::Arc;

    use super::*;
    use crate::{
        plan::bodies::light::illuminance_of,
        scene::bodies::{Body, SolarBody, suns},
    };

    const AU_M: f64 = 1.495_978_707e11;

    fn scene(bodies: Vec<Body>) -> (SceneObjects, Vec<(usize, [f64; 3])>) {
        let objects = SceneObjects { bodies: bodies.into_iter().map(Arc::new).collect(), ..Default::default() };
        let suns = suns(&objects);
        let lights = objects.bodies.iter().map(|body| illuminance_of(body, DVec3::ZERO, &suns, 0.0)).enumerate();
        let lights = lights.collect();
        (objects, lights)
    }

    fn light_of(sources: &[Source]) -> f64 {
        sources.iter().map(|source| luminance(source.whole.1)).sum()
    }

    #[test]
    fn sources_have_the_light_of_their_bodies() {
        let sun = Body::preset(SolarBody::Sun, "sun", DVec3::X * AU_M);
        let moon = Body::preset(SolarBody::Moon, "moon", DVec3::new(-3.8e8, 1e7, 0.0));
        let (objects, lights) = scene(vec![sun, moon]);
        let sources = body_sources(&objects, DVec3::ZERO, &lights, &suns(&objects));
        assert_eq!(sources.len(), 2);
        for source in &sources {
            assert!(source.parts.len() >= LEAST_PARTS && source.parts.len() <= MOST_PARTS, "{}", source.parts.len());
            let parts: f64 = source.parts.iter().map(|(_, light)| luminance(*light)).sum();
            assert!((parts / luminance(source.whole.1) - 1.0).abs() < 1e-9);
        }
        let expected: f64 = lights.iter().map(|(_, light)| luminance(*light)).sum();
        assert!((light_of(&sources) / expected - 1.0).abs() < 1e-9);
    }

    /// Every body has at least one source, the brightest bodies have parts, and the total number is within the bound.
    #[test]
    #[ignore = "long: make test-all"]
    fn many_bodies_stay_within_the_bound() {
        let moons = (0..200).map(|i| {
            let angle = f64::from(i) * 0.1;
            Body::preset(
                SolarBody::Moon,
                &format!("moon-{i}"),
                DVec3::new(angle.cos(), angle.sin(), f64::from(i) * 0.01) * 4e8,
            )
        });
        let (objects, lights) = scene(moons.chain([Body::preset(SolarBody::Sun, "sun", DVec3::X * AU_M)]).collect());
        let sources = body_sources(&objects, DVec3::ZERO, &lights, &suns(&objects));
        let count: usize = sources.iter().map(|source| 1 + source.parts.len()).sum();
        assert!(count <= MOST_SOURCES && sources.len() > 190, "{count} of {}", sources.len());
        assert!(!sources[0].parts.is_empty() && sources.last().unwrap().parts.is_empty());
    }

    /// If the Moon covers the Sun, no light is scattered. If it covers half of the Sun, about half of the light is.
    #[test]
    fn hidden_light_does_not_scatter() {
        let share = |aside: f64| {
            let sun = Body::preset(SolarBody::Sun, "sun", DVec3::X * AU_M);
            let moon = Body::preset(SolarBody::Moon, "moon", DVec3::new(3.5e8, aside * 3.5e8 * 4.65e-3, 0.0));
            let (objects, lights) = scene(vec![sun, moon]);
            light_of(&body_sources(&objects, DVec3::ZERO, &lights, &suns(&objects))) / luminance(lights[0].1)
        };
        assert!(share(0.0) < 1e-4, "{}", share(0.0));
        assert!((0.3..0.8).contains(&share(1.0)), "{}", share(1.0));
        assert!(share(3.0) > 0.999);
    }
}
