//! The total light of a body. A body smaller than a pixel is drawn with this light; for a larger body it is the sum over the disc.
//!
//! The illuminance at the eye is the integral of luminance over the solid angle of the visible disc. In coordinates divided by the semi-axes the body
//! is the unit sphere, the eye is at distance Q from its centre, and the disc is round. It is divided into rings of w = Q sin(a), 0 to 1, where a is
//! the angle from the axis. The element sin(a) da dphi of a ring is a solid angle in the scaled space. Multiplied by det(D) / |D u|^3, with the
//! semi-axes D and the ray u, it is the solid angle in the world, at every distance. The lit half of the body is also half of the unit sphere, so the
//! ends of the lit arc of each ring are known. The ring at which arcs begin divides the rings into two spans. Nodes are denser at the ends of spans
//! and arcs (t^3 (10 - 15 t + 6 t^2)), where the integrand is steep. Nodes are fixed, so that equal inputs give equal bits.
//!
//! If a sphere has no texture and is farther away than 100,000 radii, the closed forms of `photometry::reflection` are used. Their relative error is
//! of the order of radius divided by distance.

use glam::DVec3;

use crate::scene::bodies::{Body, Light, SeenBody, Sun, Texture, lights_on, reflected_lx};

/// Distance in radii from which the closed forms are used.
const FAR_RADII: f64 = 1e5;
/// Nodes across and around a disc without texture.
const PLAIN_NODES: usize = 40;
/// Fewest and most nodes across and around a disc with a texture.
const TEXTURE_NODES: [usize; 2] = [128, 256];

/// Returns the illuminance that a body causes at `eye_m` at the time `time_s`, on a surface that faces the body: linear Rec. 709, lx. It includes
/// reflected light of the suns ([`crate::scene::bodies::suns`]) and emitted light, from the part of the body's surface that the eye sees. Other
/// bodies are ignored. The result is accurate to 1e-4 without a texture. With a texture whose finest detail averages out it is accurate to 1e-3. It
/// is 0 for an eye inside the body.
pub fn illuminance_of(body: &Body, eye_m: DVec3, suns: &[Sun], time_s: f64) -> [f64; 3] {
    illuminance_lit_by(body, eye_m, &lights_on(body, suns, eye_m), time_s)
}

/// Returns the same illuminance for given incident light.
pub fn illuminance_lit_by(body: &Body, eye_m: DVec3, lights: &[Light], time_s: f64) -> [f64; 3] {
    let radius_m = body.radii_m.x;
    let is_plain_sphere = body.radii_m == DVec3::splat(radius_m) && body.surface.texture.is_none();
    let to_eye_m = eye_m - body.position_m;
    let distance_m = to_eye_m.length();
    let in_light = lights.iter().all(|light| light.shadow.is_none());
    if is_plain_sphere && in_light && distance_m > FAR_RADII * radius_m {
        let light = far_sphere(body, to_eye_m, lights);
        return [0, 1, 2].map(|channel| light[channel] * body.seen_through[channel]);
    }
    let seen = SeenBody::new(body, eye_m, lights, time_s);
    let disc = Disc::new(&seen);
    let mut sum = [0.0; 3];
    let mut add = |light: [f64; 3]| (0..3).for_each(|channel| sum[channel] += light[channel]);
    if let Some(disc) = disc {
        if body.emission.is_some() {
            add(disc.integrate(None, PLAIN_NODES, &|unit| seen.emitted_cd_m2(unit)));
        }
        let [least, most] = TEXTURE_NODES;
        let of_texture = |texture: &std::sync::Arc<Texture>| (texture.size[0] as usize).clamp(least, most);
        let nodes = body.surface.texture.as_ref().map_or(PLAIN_NODES, of_texture);
        for light in seen.lights() {
            let towards = (light.direction / body.radii_m).normalize();
            add(disc.integrate(Some(towards), nodes, &|unit| seen.reflected_cd_m2(unit, light)));
        }
    }
    sum
}

/// The closed forms.
fn far_sphere(body: &Body, to_eye_m: DVec3, lights: &[Light]) -> [f64; 3] {
    let disc_sr = std::f64::consts::PI * (body.radii_m.x / to_eye_m.length()).powi(2);
    let emitted = body.emission.map_or([0.0; 3], |emission| {
        emission.luminance_cd_m2.map(|channel| disc_sr * channel * emission.mean_over_middle())
    });
    lights
        .iter()
        .map(|light| reflected_lx(body, to_eye_m, light))
        .fold(emitted, |sum, light| [0, 1, 2].map(|c| sum[c] + light[c]))
}

/// The visible disc of a body in the space in which the body is the unit sphere.
struct Disc {
    radii_m: DVec3,
    /// Distance of the eye from the centre, semi-axes.
    q: f64,
    /// Unit vector towards the eye.
    axis: DVec3,
}

impl Disc {
    /// `None`: the eye is inside the body.
    fn new(seen: &SeenBody<'_>) -> Option<Self> {
        let q = seen.eye().length();
        (q > 1.0).then(|| Self { radii_m: seen.body().radii_m, q, axis: seen.eye() / q })
    }

    /// Integral of the luminance at points of the unit sphere over the solid angle of the disc. With `towards` (unit vector), only over the half that
    /// faces `towards`.
    fn integrate(&self, towards: Option<DVec3>, nodes: usize, luminance: &dyn Fn(DVec3) -> [f64; 3]) -> [f64; 3] {
        use std::f64::consts::PI;
        let mut sum = [0.0; 3];
        let Some(towards) = towards else {
            self.span([0.0, 1.0], nodes, &|_, _| [-PI, PI], self.axis.any_orthonormal_vector(), luminance, &mut sum);
            return sum;
        };
        let along = towards.dot(self.axis);
        let across = towards - self.axis * along;
        let across_length = across.length();
        let first = if across_length > 1e-9 { across / across_length } else { self.axis.any_orthonormal_vector() };
        // From the centre to the ring that the terminator touches, rings are lit either entirely or not at all.
        let touched = self.ring_at(across_length, along.abs());
        let full: &Arc = &|_, _| [-PI, PI];
        if along > 0.0 {
            self.span([0.0, touched], nodes, full, first, luminance, &mut sum);
        }
        if touched < 1.0 {
            let lit = move |cos: f64, sin: f64| {
                let half = (-cos * along / (sin * across_length)).clamp(-1.0, 1.0).acos();
                [-half, half]
            };
            self.span([touched, 1.0], nodes, &lit, first, luminance, &mut sum);
        }
        sum
    }

    /// Returns w of the points of the sphere at a given angle from the axis, measured at the body's centre; 1 if these points are behind the outline.
    fn ring_at(&self, cos: f64, sin: f64) -> f64 {
        if cos * self.q <= 1.0 {
            return 1.0;
        }
        // Q times the sine of the angle at the eye.
        (sin / (sin / self.q).hypot(1.0 - cos / self.q)).min(1.0)
    }

    /// Adds the rings of a span of w. `arc` returns the ends of the arc of a ring from the cosine and sine of its angle from the axis; angles along
    /// rings are counted from `first`.
    fn span(
        &self,
        [from, to]: [f64; 2],
        nodes: usize,
        arc: &Arc,
        first: DVec3,
        luminance: &dyn Fn(DVec3) -> [f64; 3],
        sum: &mut [f64; 3],
    ) {
        let second = self.axis.cross(first);
        let crowded = crowded(nodes);
        let determinant = self.radii_m.element_product();
        // Rings are uniform in the angle at the eye. If they were uniform in w, the last rings before a near horizon would contain most of the sky.
        let [from_rad, to_rad] = [from, to].map(|w: f64| (w / self.q).asin());
        for &(t, weight) in &crowded {
            let (sin_eye, cos_eye) = (from_rad + (to_rad - from_rad) * t).sin_cos();
            let w = sin_eye * self.q;
            // The angle at the body's centre is asin(w) - asin(w / Q).
            let limb = (1.0 - w * w).max(0.0).sqrt();
            let sin = w * cos_eye - limb * sin_eye;
            let cos = limb * cos_eye + w * sin_eye;
            let element = sin_eye * weight * (to_rad - from_rad);
            let [begin, end] = arc(cos, sin);
            for &(s, share) in &crowded {
                let (sin_phi, cos_phi) = (begin + (end - begin) * s).sin_cos();
                let around = first * cos_phi + second * sin_phi;
                let ray = around * sin_eye - self.axis * cos_eye;
                let stretch = determinant / (self.radii_m * ray).length().powi(3);
                let value = luminance((self.axis * cos + around * sin).normalize());
                for channel in 0..3 {
                    sum[channel] += value[channel] * stretch * element * share * (end - begin);
                }
            }
        }
    }
}

/// Ends of a ring's arc, rad, from cosine and sine of the ring's angle from the axis.
type Arc = dyn Fn(f64, f64) -> [f64; 2];

/// Nodes and weights of a midpoint rule from 0 to 1. The nodes are denser at both ends; the weights sum to 1.
fn crowded(nodes: usize) -> Vec<(f64, f64)> {
    let middle = move |i: usize| (i as f64 + 0.5) / nodes as f64;
    let slope = |t: f64| (t * (1.0 - t)).powi(2);
    let total: f64 = (0..nodes).map(|i| slope(middle(i))).sum();
    let node = |t: f64| (t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t), slope(t) / total);
    (0..nodes).map(|i| node(middle(i))).collect()
}

#[cfg(test)]
mod tests {
    use std::{f64::consts::PI, sync::Arc as Shared};

    use super::*;
    use crate::{
        scene::{
            SceneObjects,
            bodies::{Emission, ReflectionLaw, SolarBody, suns},
        },
        units::illuminance_lx_from_magnitude,
    };

    const AU_M: f64 = 1.495_978_707e11;

    /// One body of semi-axes lit by 1 lx from +x.
    fn lit(radii_m: DVec3, law: ReflectionLaw, eye_m: DVec3) -> f64 {
        let mut body = Body::preset(SolarBody::Moon, "body", DVec3::ZERO);
        body.radii_m = radii_m;
        body.surface.law = law;
        body.surface.geometric_albedo = [0.3; 3];
        let light = Light { direction: DVec3::X, illuminance_lx: [1.0; 3], shadow: None };
        illuminance_lit_by(&body, eye_m, &[light], 0.0)[0]
    }

    #[test]
    fn discs_of_spheres_have_the_light_of_the_closed_forms() {
        for law in ReflectionLaw::ALL {
            for phase_deg in [0.0, 0.01, 10.0, 45.0, 89.9, 90.0, 120.0, 150.0, 175.0] {
                let phase_rad = f64::to_radians(phase_deg);
                let eye_m = DVec3::new(phase_rad.cos(), 0.0, phase_rad.sin()) * 1e8;
                // Nearly a sphere, but not exactly: no closed form.
                let summed = lit(DVec3::new(1.0, 1.0, 1.0 + 1e-12), law, eye_m);
                let closed = lit(DVec3::ONE, law, eye_m);
                let expected = 0.3 * 1e-16 * law.phase_function(phase_rad);
                assert!((closed / expected - 1.0).abs() < 1e-9, "{law:?} {phase_deg}: {closed} {expected}");
                assert!((summed / closed - 1.0).abs() < 1e-4, "{law:?} {phase_deg}: {summed} {closed}");
                // Another reflection law or another albedo makes a measurable difference.
                assert!((summed * 1.001 / closed - 1.0).abs() > 5e-4);
            }
        }
    }

    #[test]
    fn discs_of_ellipsoids_cover_their_cross_sections_and_near_ones_their_caps() {
        let mut body = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
        body.emission = Some(Emission { luminance_cd_m2: [1.0; 3], limb_darkening: 0.0, corona: false });
        body.radii_m = DVec3::new(2.0, 3.0, 5.0);
        let from = |body: &Body, eye_m: DVec3| illuminance_of(body, eye_m, &[], 0.0)[0];
        for (axis, area) in [(DVec3::X, 15.0 * PI), (DVec3::Y, 10.0 * PI), (DVec3::Z, 6.0 * PI)] {
            assert!((from(&body, axis * 1e7) / (area * 1e-14) - 1.0).abs() < 1e-6);
        }
        // A sphere of unit luminance covers 2 pi (1 - cos) of the sky at every distance, down to the ground.
        body.radii_m = DVec3::ONE;
        for distance in [1.000_001, 1.01, 1.5, 3.0, 100.0] {
            let sine2 = 1.0 / (distance * distance);
            let sky = 2.0 * PI * sine2 / (1.0 + (1.0 - sine2).sqrt());
            assert!((from(&body, DVec3::Y * distance) / sky - 1.0).abs() < 1e-5, "{distance}");
        }
        assert_eq!(from(&body, DVec3::Y * 0.9), 0.0, "the eye is within");
    }

    #[test]
    fn the_sun_gives_the_earth_the_light_of_its_magnitude() {
        let sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
        let objects = SceneObjects { bodies: vec![Shared::new(sun.clone())], ..SceneObjects::default() };
        let expected = illuminance_lx_from_magnitude(4.83 + 5.0 * (AU_M / (10.0 * crate::units::PARSEC_M)).log10());
        assert!((expected / 1.26e5 - 1.0).abs() < 0.01, "{expected}");
        let y = crate::photometry::rec709::luminance;
        let seen = y(illuminance_of(&sun, DVec3::X * AU_M, &suns(&objects), 0.0));
        let sent = y(suns(&objects)[0].light_at(DVec3::X * AU_M).unwrap().illuminance_lx);
        let far = y(illuminance_of(&sun, DVec3::X * AU_M * 1e4, &[], 0.0)) * 1e8;
        for found in [seen, sent, far] {
            assert!((found / expected - 1.0).abs() < 5e-5, "{found} {expected}");
        }
        // The centre of the disc is brighter than the mean, 1.9e9 cd/m^2.
        let middle = y(sun.emission.unwrap().luminance_cd_m2);
        assert!((middle * 0.8 / 1.86e9 - 1.0).abs() < 0.02, "{middle}");
    }

    #[test]
    fn textures_count_only_where_visible_and_lit() {
        let mut body = Body::preset(SolarBody::Moon, "moon", DVec3::ZERO);
        let half = |x: u32| if x < 32 { [0.0; 3] } else { [1.0; 3] };
        let rgb = (0..32).flat_map(|_| (0..64).map(half)).collect();
        let light = |towards: DVec3| Light { direction: towards, illuminance_lx: [1.0; 3], shadow: None };
        let from = |body: &Body, towards: DVec3| illuminance_lit_by(body, towards * 1e9, &[light(towards)], 0.0)[0];
        let plain = from(&body, DVec3::Y);
        body.surface.texture = Some(Shared::new(Texture { size: [64, 32], rgb }));
        // The bright half has y > 0.
        assert!((from(&body, DVec3::Y) / plain - 1.0).abs() < 0.03);
        assert!(from(&body, DVec3::NEG_Y) / plain < 0.03);
        assert!((from(&body, DVec3::X) / plain - 0.5).abs() < 1e-3);
        assert!((from(&body, DVec3::Z) / plain - 0.5).abs() < 1e-3);
        // A quarter of a turn later the bright half faces -x.
        body.spin.phase_rad = PI / 2.0;
        assert!((from(&body, DVec3::NEG_X) / plain - 1.0).abs() < 0.03);
    }
}
