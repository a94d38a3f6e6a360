//! Small bodies in front of each other. A body a few pixels across is drawn at least partly as a point, and a point hides little of the light behind
//! it. But a moon in front of the Sun hides all of the Sun's light, however small both are in a picture. So bodies that approach each other become
//! discs: the smaller their separation, the larger the fraction of their light that is drawn as a disc. If a body is too small even for that, it
//! stays a point, whose light is reduced by the area of the overlap of the two circles.

use glam::DVec3;

use crate::scene::bodies::hidden_share;

/// Diameters between which approaching bodies become discs, pixels: a disc is divided into 12 x 12 parts per pixel.
const DISCS_PX: [f64; 2] = [0.25, 0.5];
/// A nearer body that is smaller than this fraction of the farther one hides nothing.
const LEAST_OF_FARTHER: f64 = 0.02;

/// A body as a circle in the sky of an eye.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// Unit vector to its centre.
    pub(super) direction: DVec3,
    pub(super) distance_m: f64,
    /// Angular radius.
    pub(super) radius_rad: f64,
    pub(super) diameter_px: f64,
}

/// Division of the light of a body between its disc and its point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parts {
    /// Fraction of the light that the disc has.
    pub(super) disc: f64,
    /// Fraction that the point has: less than the remaining fraction if nearer bodies hide the point.
    pub(super) point: f64,
}

fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Greatest fraction that the disc has because another body is near.
fn may_be_disc(body: &Round) -> f64 {
    let [from, to] = DISCS_PX;
    smooth((body.diameter_px - from) / (to - from))
}

/// Division of the light of all bodies. `discs` are the fractions of their discs without other bodies.
pub(super) fn drawn(bodies: &[Round], discs: &[f64]) -> Vec<Parts> {
    let mut parts: Vec<Parts> = discs.iter().map(|disc| Parts { disc: *disc, point: 1.0 }).collect();
    // The farther and the nearer body, and their separation, for pairs that are not both entirely discs.
    let mut pairs = Vec::new();
    for (first, a) in bodies.iter().enumerate() {
        for (second, b) in bodies.iter().enumerate().skip(first + 1) {
            if discs[first] >= 1.0 && discs[second] >= 1.0 {
                continue;
            }
            let reach_rad = a.radius_rad + b.radius_rad;
            if (a.direction - b.direction).length_squared() > (2.0 * reach_rad).powi(2) {
                continue;
            }
            let (far, near) = if a.distance_m >= b.distance_m { (first, second) } else { (second, first) };
            if bodies[near].radius_rad < LEAST_OF_FARTHER * bodies[far].radius_rad {
                continue;
            }
            let apart_rad = a.direction.angle_between(b.direction);
            // Entirely a disc from first contact.
            let meets = smooth(2.0 - apart_rad / reach_rad);
            for index in [far, near] {
                parts[index].disc = parts[index].disc.max(meets * may_be_disc(&bodies[index]));
            }
            pairs.push((far, near, apart_rad));
        }
    }
    for (far, near, apart_rad) in pairs {
        let hidden = hidden_share(bodies[far].radius_rad, bodies[near].radius_rad, apart_rad);
        // The disc of the nearer body already hides a point behind it, either all of it or none, to the extent that the body is a disc.
        let hides_middle = apart_rad < bodies[near].radius_rad;
        let left = if hides_middle { 1.0 - parts[near].disc } else { 1.0 };
        parts[far].point *= if left > 1.0 - hidden { (1.0 - hidden) / left } else { 1.0 };
    }
    for part in &mut parts {
        part.point *= 1.0 - part.disc;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(right_rad: f64, distance_m: f64, radius_rad: f64, diameter_px: f64) -> Round {
        let direction = DVec3::new(right_rad.sin(), 0.0, -right_rad.cos());
        Round { direction, distance_m, radius_rad, diameter_px }
    }

    #[test]
    fn touching_bodies_are_discs_and_others_are_unchanged() {
        let sun = round(0.0, 1.5e11, 0.0047, 3.0);
        let moon = |right_rad: f64| round(right_rad, 3.8e8, 0.0048, 3.1);
        let alone = [0.5, 0.6];
        assert_eq!(
            drawn(&[sun, moon(0.03)], &alone),
            [Parts { disc: 0.5, point: 0.5 }, Parts { disc: 0.6, point: 0.4 }]
        );
        for right_rad in [0.0, 0.003, 0.0094] {
            let parts = drawn(&[moon(right_rad), sun], &alone);
            assert!(parts.iter().all(|part| *part == Parts { disc: 1.0, point: 0.0 }), "{right_rad}: {parts:?}");
        }
        // The change is continuous.
        let mut last = drawn(&[sun, moon(0.02)], &alone);
        for step in 0..1000 {
            let parts = drawn(&[sun, moon(0.02 - 2e-5 * f64::from(step))], &alone);
            let jump = parts.iter().zip(&last).map(|(a, b)| (a.disc - b.disc).abs() + (a.point - b.point).abs());
            assert!(jump.fold(0.0, f64::max) < 0.01, "{step}");
            last = parts;
        }
    }

    #[test]
    fn a_moon_of_any_size_hides_the_point_behind_it() {
        for diameter_px in [0.1, 0.3, 0.38, 0.45, 0.6, 3.0] {
            let sun = round(0.0, 1.5e11, 0.0047, diameter_px);
            for (right_rad, moon_rad) in [(0.0, 0.0048), (0.003, 0.0048), (0.007, 0.0048), (0.0, 0.003)] {
                let moon = round(right_rad, 3.8e8, moon_rad, diameter_px * moon_rad / 0.0047);
                let [far, near] = drawn(&[sun, moon], &[0.0, 0.0])[..] else { panic!("two bodies") };
                // As in shaders, the disc of the moon hides the centre of the sun either entirely or not at all.
                let passed = if right_rad < moon_rad { 1.0 - near.disc } else { 1.0 };
                let open = 1.0 - hidden_share(0.0047, moon_rad, right_rad);
                let error = far.point * passed - (1.0 - far.disc) * open;
                // The disc of a smaller moon hides the whole point: the ring of light around the moon is lost to the extent that the moon is a disc.
                let most = if moon_rad < 0.0047 || open > 0.0 { near.disc * open } else { 0.0 };
                assert!(error < 1e-12 && error >= -most - 1e-12, "{diameter_px} px, {right_rad}, {moon_rad}: {error}");
            }
        }
    }

    #[test]
    fn a_body_too_small_for_a_disc_loses_light_by_areas() {
        let sun = round(0.0, 1.5e11, 0.0047, 0.1);
        let moon = |right_rad: f64| round(right_rad, 3.8e8, 0.0048, 0.1);
        let point = |right_rad: f64| drawn(&[sun, moon(right_rad)], &[0.0, 0.0])[0].point;
        assert_eq!([point(0.0), point(0.0096)], [0.0, 1.0]);
        assert!((point(0.0047) - (1.0 - hidden_share(0.0047, 0.0048, 0.0047))).abs() < 1e-9);
        // The nearer body keeps its light, and a tiny body in front of the Sun has no effect.
        assert_eq!(drawn(&[sun, moon(0.0)], &[0.0, 0.0])[1].point, 1.0);
        let speck = round(0.0, 1e9, 1e-5, 2e-4);
        assert_eq!(drawn(&[sun, speck], &[0.0, 0.0])[0], Parts { disc: 0.0, point: 1.0 });
        // Two discs are left unchanged.
        assert_eq!(drawn(&[sun, moon(0.0)], &[1.0, 1.0])[0], Parts { disc: 1.0, point: 0.0 });
    }
}
