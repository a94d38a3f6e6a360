//! View of a moving observer: special relativity in closed form, in f64.
//!
//! Speeds are in units of the speed of light, angles in radians. `a` is the angle between velocity and star in the
//! rest frame of the stars (the world's); primes denote the observer's frame. With gamma = 1/sqrt(1 - beta^2):
//!
//! - Doppler factor D = gamma (1 + beta cos a), by which every frequency is multiplied,
//! - aberration cos a' = (cos a + beta) / (1 + beta cos a): stars are concentrated ahead,
//! - a black body remains one, with temperature T' = D T,
//! - illuminance E' = E D^-2 Y(D T) / Y(T), with Y the luminance of a black body of that temperature.
//!
//! The last two follow from two facts. Spectral radiance divided by the cube of frequency is the same for every
//! observer, so that Planck's law keeps its form with temperature D T. And the solid angle of a small source shrinks
//! by D^2; with the luminance Y(D T), this gives the illuminance above. (Einstein 1905, section 7; Rybicki and
//! Lightman, "Radiative Processes in Astrophysics", chapter 4.)
//!
//! Stars are treated as black bodies at rest in the world. The offsets between the eyes of a rig are not contracted;
//! that matters only for nearby sources.

use glam::DVec3;

use crate::photometry::blackbody::ln_luminance_cd_m2;

/// Highest speed that is drawn. D is then between 1/141.4 and 141.4; closer to 1, f32 would lose more digits.
pub const MAX_SPEED_C: f64 = 0.9999;

/// Lorentz factor of a speed below 1.
pub fn gamma(beta: f64) -> f64 {
    // (1 - beta)(1 + beta) keeps its digits near 1; 1 - beta^2 does not.
    1.0 / ((1.0 - beta) * (1.0 + beta)).sqrt()
}

/// Doppler factor of a star whose angle `a` from the velocity, in the stars' frame, has the cosine `cos_a`.
pub fn doppler_factor(beta: f64, cos_a: f64) -> f64 {
    gamma(beta) * (1.0 + beta * cos_a)
}

/// Cosine of the angle between the velocity and the star in the observer's frame.
pub fn aberrated_cos(beta: f64, cos_a: f64) -> f64 {
    (cos_a + beta) / (1.0 + beta * cos_a)
}

/// Illuminance of a black body of `temperature_k` in the observer's frame divided by that in the stars' frame: D^-2
/// Y(D T) / Y(T). 0 if it underflows f64.
pub fn illuminance_factor(temperature_k: f64, doppler: f64) -> f64 {
    (ln_luminance_cd_m2(doppler * temperature_k) - ln_luminance_cd_m2(temperature_k) - 2.0 * doppler.ln()).exp()
}

/// A nonzero velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Unit vector of the velocity, world axes.
    pub direction: DVec3,
    /// Speed, above 0 and below 1.
    pub beta: f64,
}

/// Unit vector in which an observer with a velocity, in units of the speed of light, sees an object at `place`
/// relative to the eye in the world's frame; 0 for an object at the eye.
pub fn seen_direction(velocity_c: DVec3, place: DVec3) -> DVec3 {
    if place == DVec3::ZERO {
        return DVec3::ZERO;
    }
    Motion::new(velocity_c).map_or(place, |motion| motion.seen(place)).normalize_or_zero()
}

impl Motion {
    /// Motion with a velocity in units of the speed of light, which must be shorter than 1; `None` at rest.
    pub fn new(velocity_c: DVec3) -> Option<Self> {
        let beta = velocity_c.length();
        // Below 1e-30 the squares underflow, and the effect is invisible.
        (beta > 1e-30).then(|| Self { direction: velocity_c / beta, beta })
    }

    /// Lorentz factor.
    pub fn gamma(&self) -> f64 {
        gamma(self.beta)
    }

    /// Doppler factor straight behind, gamma (1 - beta): the smallest one. Its inverse, straight ahead, is the
    /// largest.
    pub fn doppler_behind(&self) -> f64 {
        ((1.0 - self.beta) / (1.0 + self.beta)).sqrt()
    }

    /// Returns 1 + cos a and the length of `place`, a nonzero vector.
    fn one_plus_cos(&self, place: DVec3) -> (f64, f64) {
        let length = place.length();
        let along = place.dot(self.direction) / length;
        if along >= 0.0 {
            return (1.0 + along, length);
        }
        // sin^2 / (1 - cos) has no cancellation for directions behind the observer.
        let across = place / length - self.direction * along;
        (across.length_squared() / (1.0 - along), length)
    }

    /// Doppler factor of a star at `place`, a nonzero vector from the eye in the stars' frame.
    pub fn doppler_of(&self, place: DVec3) -> f64 {
        let (one_plus_cos, _) = self.one_plus_cos(place);
        self.doppler_behind() + self.gamma() * self.beta * one_plus_cos
    }

    /// Position in which the observer sees a star at `place`, a nonzero vector from the eye in the stars' frame: a
    /// vector in the aberrated direction, D times as long.
    pub fn seen(&self, place: DVec3) -> DVec3 {
        let (one_plus_cos, length) = self.one_plus_cos(place);
        // A light-like vector in another frame: its transverse part stays, its longitudinal part becomes gamma (cos a
        // + beta).
        let across = place - self.direction * place.dot(self.direction);
        across + self.direction * (length * (self.gamma() * one_plus_cos - self.doppler_behind()))
    }

    /// The observer's image of a cone in the stars' frame: axis (unit vector) and half-angle, rad, from 0 to pi.
    /// Aberration maps circles to circles.
    pub fn seen_cone(&self, axis: DVec3, half_angle_rad: f64) -> (DVec3, f64) {
        let (sin, cos) = half_angle_rad.clamp(0.0, std::f64::consts::PI).sin_cos();
        // A direction u is inside if u . axis - cos >= 0: a plane through the light cone, (axis; cos), which
        // transforms like any four-vector. Its square, sin^2, is invariant.
        let along = axis.dot(self.direction);
        let gamma = self.gamma();
        let seen_axis = axis - self.direction * along + self.direction * (gamma * (along + self.beta * cos));
        let seen_cos = gamma * (cos + self.beta * along);
        (seen_axis.normalize_or(self.direction), sin.atan2(seen_cos))
    }

    /// Smallest and largest Doppler factor within a cone in the stars' frame.
    pub fn doppler_range(&self, axis: DVec3, half_angle_rad: f64) -> [f64; 2] {
        let middle = axis.angle_between(self.direction);
        [(middle + half_angle_rad).min(std::f64::consts::PI), (middle - half_angle_rad).max(0.0)].map(|angle| {
            // 1 + cos a = 2 cos^2(a/2) keeps its digits for directions behind the observer.
            self.doppler_behind() + self.gamma() * self.beta * 2.0 * (angle / 2.0).cos().powi(2)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::photometry::{
        blackbody::luminance_cd_m2,
        cie1931::{COLOUR_MATCHING, STEP_M, wavelength_m},
    };

    const SPEEDS: [f64; 6] = [1e-4, 0.1, 0.5, 0.9, 0.99, MAX_SPEED_C];

    fn motion(beta: f64) -> Motion {
        Motion::new(DVec3::new(0.3, -0.8, 0.52).normalize() * beta).unwrap()
    }

    /// Directions spread uniformly over the sphere.
    fn spiral(count: usize) -> impl Iterator<Item = DVec3> {
        (0..count).map(move |i| {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
            DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        })
    }

    /// Illuminance of a star in the observer's frame divided by that in its rest frame, by another method. It
    /// integrates over frequency, uses the fact that spectral radiance divided by the cube of frequency is invariant,
    /// and includes the change of the solid angle.
    fn integrated_factor(temperature_k: f64, doppler: f64) -> f64 {
        let (h, c, k) = (6.626_070_15e-34, 299_792_458.0, 1.380_649e-23);
        // Per frequency, W s/(m^2 sr).
        let planck = |nu: f64| 2.0 * h * nu.powi(3) / (c * c) / (h * nu / (k * temperature_k)).exp_m1();
        let seen = |nu: f64| planck(nu / doppler) * doppler.powi(3);
        let photopic = |radiance: &dyn Fn(f64) -> f64| -> f64 {
            let band = |(index, row): (usize, &[f64; 3])| {
                let wavelength = wavelength_m(index);
                radiance(c / wavelength) * c / (wavelength * wavelength) * row[1] * STEP_M
            };
            COLOUR_MATCHING.iter().enumerate().map(band).sum()
        };
        photopic(&seen) / photopic(&planck) / (doppler * doppler)
    }

    #[test]
    fn illuminance_agrees_with_an_integral_over_the_shifted_spectrum() {
        let mut worst = 0.0_f64;
        for temperature_k in [1000.0, 3000.0, 5800.0, 12_000.0, 50_000.0] {
            for beta in SPEEDS {
                for cos_a in [-1.0, -0.7, -0.2, 0.0, 0.4, 0.9, 1.0] {
                    let doppler = doppler_factor(beta, cos_a);
                    let expected = integrated_factor(temperature_k, doppler);
                    let found = illuminance_factor(temperature_k, doppler);
                    if expected > 1e-250 {
                        worst = worst.max((found / expected - 1.0).abs());
                    } else {
                        assert!(found < 1e-249);
                    }
                }
            }
        }
        println!("closed form against integral of the shifted spectrum: {worst:.1e}");
        assert!(worst < 1e-9);
    }

    #[test]
    fn other_powers_of_the_doppler_factor_fail_the_integral() {
        let doppler = doppler_factor(0.9, 1.0);
        let expected = integrated_factor(5800.0, doppler);
        println!(
            "5800 K straight ahead at 0.9 c: {expected:.4}; D^2 {:.1}, D^4 {:.1}",
            doppler.powi(2),
            doppler.powi(4)
        );
        assert!((expected - 2.6).abs() < 0.05);
        assert!((illuminance_factor(5800.0, doppler) / expected - 1.0).abs() < 1e-9);
        for wrong in [doppler.powi(2), doppler.powi(4), doppler.powi(-2), 1.0] {
            assert!((wrong / expected - 1.0).abs() > 0.5, "{wrong}");
        }
        let without_solid_angle = luminance_cd_m2(doppler * 5800.0) / luminance_cd_m2(5800.0);
        assert!(without_solid_angle / expected > 10.0);
    }

    #[test]
    fn solid_angles_shrink_by_the_doppler_factor_squared_and_fill_the_sphere() {
        for beta in SPEEDS {
            let motion = motion(beta);
            let count = 200_000;
            let mut sum = 0.0;
            for (index, star) in spiral(count).enumerate() {
                let doppler = motion.doppler_of(star);
                sum += doppler.powi(-2);
                if index % 1000 != 0 {
                    continue;
                }
                // A small triangle of directions before and after.
                let (u, v) = star.any_orthonormal_pair();
                let corners = [star, (star + u * 1e-5).normalize(), (star + v * 1e-5).normalize()];
                let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
                let shrunk = area(corners.map(|corner| motion.seen(corner).normalize())) / area(corners);
                assert!((shrunk * doppler * doppler - 1.0).abs() < 3e-3, "{beta}: {shrunk} at D = {doppler}");
            }
            // At 0.9999 c half of the observed sky comes from 2 of these 200,000 directions; the sum is then too
            // coarse.
            if beta < 0.999 {
                assert!((sum / count as f64 - 1.0).abs() < 1e-3, "{beta}: {sum}");
            }
        }
    }

    #[test]
    fn vectors_agree_with_the_scalar_forms_and_keep_the_plane_of_velocity_and_star() {
        let mut worst = 0.0_f64;
        for beta in SPEEDS {
            let motion = motion(beta);
            for star in spiral(2000) {
                let cos_a = star.dot(motion.direction);
                let seen = motion.seen(star * 7.0);
                let doppler = doppler_factor(beta, cos_a);
                assert!((motion.doppler_of(star) / doppler - 1.0).abs() < 1e-10);
                assert!((seen.length() / (7.0 * doppler) - 1.0).abs() < 1e-10, "D times as long");
                let seen_cos = seen.normalize().dot(motion.direction);
                worst = worst.max((seen_cos - aberrated_cos(beta, cos_a)).abs());
                assert!(seen.dot(star.cross(motion.direction)).abs() < 1e-9 * seen.length());
                assert!(seen_cos >= cos_a - 1e-12, "forwards");
                // The opposite motion is the inverse.
                let back = Motion::new(motion.direction * -beta).unwrap().seen(seen).normalize();
                assert!(back.distance(star) < 1e-9, "{back} {star}");
            }
        }
        println!("aberration by vectors against the closed form: cosine within {worst:.1e}");
        assert!(worst < 1e-10);
    }

    #[test]
    fn straight_ahead_and_behind_are_exact() {
        for beta in SPEEDS {
            let motion = motion(beta);
            let ahead = ((1.0 + beta) / (1.0 - beta)).sqrt();
            assert!((motion.doppler_of(motion.direction) / ahead - 1.0).abs() < 1e-12);
            assert!((motion.doppler_of(-motion.direction) * ahead - 1.0).abs() < 1e-12);
            assert!(motion.seen(motion.direction).angle_between(motion.direction) < 1e-7);
            assert!(motion.seen(-motion.direction).angle_between(-motion.direction) < 1e-7);
        }
        assert_eq!(Motion::new(DVec3::ZERO), None);
        assert_eq!(Motion::new(DVec3::new(-0.0, 0.0, -0.0)), None);
    }

    #[test]
    fn directions_stay_inside_or_outside_of_a_cone() {
        for beta in SPEEDS {
            let motion = motion(beta);
            let axes = spiral(40).chain([motion.direction, -motion.direction]);
            for (index, axis) in axes.enumerate() {
                for half in [0.0, 0.01, 0.4, 1.2, PI / 2.0, 2.2, 3.1, PI] {
                    let (seen_axis, seen_half) = motion.seen_cone(axis, half);
                    assert!((seen_axis.length() - 1.0).abs() < 1e-12);
                    let [lowest, highest] = motion.doppler_range(axis, half);
                    let inner = half * 0.999;
                    for turn in 0..12 {
                        let (u, v) = axis.any_orthonormal_pair();
                        let side = u * f64::from(turn).cos() + v * f64::from(turn).sin();
                        let direction = |angle: f64| axis * angle.cos() + side * angle.sin();
                        let seen_angle = |angle: f64| motion.seen(direction(angle)).angle_between(seen_axis);
                        // The rim is mapped to the rim.
                        assert!((seen_angle(half) - seen_half).abs() < 1e-6, "{beta} {index} {half}");
                        assert!(seen_angle(inner) <= seen_half + 1e-7);
                        let doppler = motion.doppler_of(direction(inner));
                        assert!(doppler >= lowest * (1.0 - 1e-9) && doppler <= highest * (1.0 + 1e-9));
                    }
                }
            }
        }
    }
}
