//! Atmospheric refraction for an observer.
//!
//! The refraction R is given by tan R = A cos h / (s + a / (s + b / (s + c / (s + d)))), where h is the apparent
//! altitude and s = sin h. It is fitted to the formula of G. G. Bennett ("The calculation of astronomical refraction in
//! marine navigation", Journal of Navigation 35, 255, 1982) with its second term, which agrees with the Nautical
//! Almanac within 0.9 arcsec. The error of the fit is at most 0.9 arcsec from 15 degrees up, 1.8 arcsec above the
//! horizon, and 4 arcsec down to 1 degree below it. The formula maps directions without computing angles, in the same
//! way as the shaders (`shaders/shared/refraction.wgsl`). For true altitudes (without air) a second set of coefficients
//! gives the starting value of an iteration. Refraction is proportional to the density of the air at the observer.

use glam::{DMat3, DVec3};

use crate::{photometry::atmosphere::standard_air, units::KELVIN_OF_ZERO_CELSIUS};

/// Coefficients A, a, b, c and d for the sine of the apparent altitude.
pub const OF_SEEN: [f64; 5] = [2.834e-4, 1.1994e-3, 2.3775e-3, 7.0109e-3, 0.12504];
/// Coefficients for the sine of the true altitude in standard air; the error is within 7 arcsec.
pub const OF_ARRIVING: [f64; 5] = [2.8363e-4, 1.52593e-3, 2.98557e-3, 1.174432e-2, 0.177_913_33];
/// Below these sines, the formula keeps the value that it has at them.
pub const LOWEST_SEEN: f64 = -0.0175;
/// See [`LOWEST_SEEN`].
pub const LOWEST_ARRIVING: f64 = -0.032;
/// Sines between which refraction fades with depth: it is zero at the first and unreduced from the second on.
/// Such low directions meet the ground.
pub const FADING: [f64; 2] = [-0.07, -0.02];
/// Margin below the first of these: at lower sines refraction is 0 without an iteration.
const FADING_MARGIN: f64 = 1e-3;
/// Change of the refraction at which an iteration ends, rad.
const LEAST_CHANGE: f64 = 1e-13;
/// Maximum number of iterations from a true altitude to the apparent one. Each one reduces the error to a fifth at the horizon,
/// and to far less above it.
const STEPS: usize = 8;

/// Curvature of light near the horizon in standard air at sea level, as a share of the Earth's curvature. It follows
/// from the dip, which is 1.76 arcmin times the square root of the height in m (Nautical Almanac), instead of 1.926 for
/// straight lines.
const BENT: f64 = 0.165;
/// Mean radius of the Earth, m.
const EARTH_M: f64 = 6_371_000.0;

/// The air for which the coefficients hold, that of the Nautical Almanac.
const STANDARD: RefractingAir = RefractingAir { pressure_hpa: 1010.0, temperature_c: 10.0 };

/// The air at an observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefractingAir {
    /// Pressure, hPa; 0: no air.
    pub pressure_hpa: f64,
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
}

/// Refraction for an observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refraction {
    /// Unit vector to the zenith.
    pub zenith: DVec3,
    /// Density of the air relative to the air of the coefficients.
    pub density: f64,
}

impl RefractingAir {
    /// Air of the standard atmosphere (ISO 2533) at a height above the sea, m, up to 50 km.
    pub fn at_height(height_m: f64) -> Self {
        let (pressure_hpa, temperature_c) = standard_air(height_m);
        Self { pressure_hpa, temperature_c }
    }

    /// Density relative to [`STANDARD`].
    pub fn density(&self) -> f64 {
        let kelvin = |air: &Self| KELVIN_OF_ZERO_CELSIUS + air.temperature_c;
        self.pressure_hpa / STANDARD.pressure_hpa * kelvin(&STANDARD) / kelvin(self)
    }

    /// Refraction to be added to the true altitude, rad, at the apparent altitude `seen_rad`.
    pub fn refraction_of_seen_rad(&self, seen_rad: f64) -> f64 {
        (of_seen(self.density(), seen_rad.sin()) * seen_rad.cos()).atan()
    }

    /// Refraction to be added to a true altitude, rad.
    pub fn refraction_rad(&self, altitude_rad: f64) -> f64 {
        (of_arriving(self.density(), altitude_rad.sin()) * altitude_rad.cos()).atan()
    }
}

/// Apparent depth of the sea's horizon below altitude 0, rad, from a height above the sea, m, with or without air.
pub fn dip_rad(height_m: f64, air: Option<&RefractingAir>) -> f64 {
    let bent = BENT * air.map_or(0.0, RefractingAir::density);
    (EARTH_M / (EARTH_M + height_m.max(0.0))).acos() * (1.0 - bent).max(0.0).sqrt()
}

fn fraction([first, a, b, c, d]: [f64; 5], sine: f64) -> f64 {
    first / (sine + a / (sine + b / (sine + c / (sine + d))))
}

/// Tangent of the refraction divided by the cosine of the apparent altitude, as a function of its sine.
fn of_seen(density: f64, sine: f64) -> f64 {
    let [gone, whole] = FADING;
    let kept = ((sine - gone) / (whole - gone)).clamp(0.0, 1.0);
    density * kept * fraction(OF_SEEN, sine.max(LOWEST_SEEN))
}

/// As [`of_seen`], for the true altitude.
fn of_arriving(density: f64, sine: f64) -> f64 {
    let cosine_squared = (1.0 - sine * sine).max(0.0);
    let mut found = density * fraction(OF_ARRIVING, sine.max(LOWEST_ARRIVING));
    // So far below the horizon, refraction has faded.
    if sine + found < FADING[0] - FADING_MARGIN {
        return 0.0;
    }
    for _ in 0..STEPS {
        let cosine = (1.0 + found * found * cosine_squared).sqrt().recip();
        let seen = (sine + found * cosine_squared) * cosine;
        // The cosine of the apparent altitude is that of the true one times this factor.
        let next = of_seen(density, seen) * (1.0 - sine * found) * cosine;
        let change = (next - found).abs();
        found = next;
        // Further steps would change it even less.
        if change < LEAST_CHANGE {
            break;
        }
    }
    found
}

impl Refraction {
    /// Apparent position of an object in the direction `arriving` (without air), at the same distance.
    pub fn seen(&self, arriving: DVec3) -> DVec3 {
        self.moved(arriving, |sine| of_arriving(self.density, sine))
    }

    /// True position of an object that is seen in the direction `seen`, at the same distance.
    pub fn arriving(&self, seen: DVec3) -> DVec3 {
        self.moved(seen, |sine| -of_seen(self.density, sine))
    }

    fn moved(&self, place: DVec3, upwards: impl Fn(f64) -> f64) -> DVec3 {
        let distance = place.length();
        if distance == 0.0 {
            return place;
        }
        let direction = place / distance;
        let sine = direction.dot(self.zenith);
        let upwards = upwards(sine);
        if upwards == 0.0 {
            return place;
        }
        (direction + upwards * (self.zenith - sine * direction)).normalize() * distance
    }

    /// Linear map from true to apparent directions, for the directions within an angle from a given one. It rotates the
    /// given direction as refraction does, and compresses its surroundings as much as refraction does at their edge.
    pub fn around(&self, arriving: DVec3, radius_rad: f64) -> DMat3 {
        let middle = arriving.normalize();
        let level = self.zenith.cross(middle).try_normalize().unwrap_or_else(|| middle.any_orthonormal_vector());
        let upwards = middle.cross(level);
        let (sin, cos) = radius_rad.clamp(1e-6, 0.1).sin_cos();
        let spread = |side: DVec3| {
            let end = |sign: f64| self.seen(middle * cos + side * (sign * sin));
            (end(1.0) - end(-1.0)) / (2.0 * sin)
        };
        let seen = DMat3::from_cols(self.seen(middle), spread(level), spread(upwards));
        seen * DMat3::from_cols(middle, level, upwards).transpose()
    }

    /// Upper bound of the refraction, rad, within a cone of a half-angle around an axis.
    pub fn most_rad(&self, axis: DVec3, half_angle_rad: f64) -> f64 {
        let lowest = (axis.dot(self.zenith).clamp(-1.0, 1.0).asin() - half_angle_rad).max(LOWEST_ARRIVING);
        // Below this altitude, refraction fades; above this altitude, it is smaller.
        (of_arriving(self.density, lowest.sin()) * lowest.cos()).atan() * 1.01
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::ARCSECOND_RAD;

    /// Mean refraction of the Nautical Almanac (1010 hPa, 10 degrees Celsius): apparent altitude in degrees,
    /// refraction in arcminutes.
    const ALMANAC: [[f64; 2]; 8] =
        [[0.0, 34.5], [1.0, 24.4], [5.0, 9.9], [10.0, 5.3], [15.0, 3.57], [30.0, 1.68], [45.0, 0.97], [75.0, 0.26]];

    fn bennett_rad(seen_deg: f64) -> f64 {
        let first = 1.0 / (seen_deg + 7.31 / (seen_deg + 4.4)).to_radians().tan();
        ((first - 0.06 * (14.7 * first + 13.0).to_radians().sin()) / 60.0).to_radians()
    }

    #[test]
    fn refraction_matches_the_almanac_and_the_formula() {
        for [degrees, arcmin] in ALMANAC {
            let found = STANDARD.refraction_of_seen_rad(degrees.to_radians()).to_degrees() * 60.0;
            assert!((found - arcmin).abs() < 0.05 + 0.002 * arcmin, "{degrees}: {found}");
        }
        for tenth in -10..=900 {
            let degrees = f64::from(tenth) / 10.0;
            let found = STANDARD.refraction_of_seen_rad(degrees.to_radians());
            let off = (found - bennett_rad(degrees)).abs() / ARCSECOND_RAD;
            let allowed = if degrees >= 15.0 {
                1.0
            } else if degrees >= 0.0 {
                2.0
            } else {
                5.0
            };
            assert!(off < allowed, "{degrees}: {off} arcsec");
        }
        assert_eq!(RefractingAir { pressure_hpa: 0.0, temperature_c: 10.0 }.refraction_rad(0.3), 0.0);
        // Air on a mountain and at sea level.
        assert!((RefractingAir::at_height(0.0).density() - 0.985_8).abs() < 1e-3);
        let paranal = RefractingAir::at_height(2635.0);
        assert!((paranal.pressure_hpa - 734.0).abs() < 3.0 && (paranal.temperature_c + 2.1).abs() < 0.1, "{paranal:?}");
        assert!(RefractingAir::at_height(30_000.0).pressure_hpa < 13.0);
    }

    #[test]
    fn the_dip_of_the_horizon_is_that_of_the_almanac() {
        for height_m in [2.0_f64, 25.0, 100.0, 400.0] {
            let air = RefractingAir::at_height(height_m);
            let found = dip_rad(height_m, Some(&air)).to_degrees() * 60.0;
            assert!((found / (1.76 * height_m.sqrt()) - 1.0).abs() < 0.01, "{height_m}: {found}");
            let straight = dip_rad(height_m, None).to_degrees() * 60.0;
            assert!((straight / (1.926 * height_m.sqrt()) - 1.0).abs() < 0.002, "{height_m}: {straight}");
        }
        assert_eq!(dip_rad(-30.0, None), 0.0);
    }

    #[test]
    fn true_and_apparent_directions_are_inverse_in_any_air() {
        for density in [0.3, 0.7, 1.0, 1.2] {
            let refraction = Refraction { zenith: DVec3::new(0.48, 0.6, 0.64), density };
            let (level, _) = refraction.zenith.any_orthonormal_pair();
            for step in 0..400 {
                let seen_rad = -0.017 + (std::f64::consts::FRAC_PI_2 + 0.017) * f64::from(step) / 399.0;
                let seen = (refraction.zenith * seen_rad.sin() + level * seen_rad.cos()) * 7.0;
                let back = refraction.seen(refraction.arriving(seen));
                assert!((back.length() - 7.0).abs() < 1e-12);
                let off = back.angle_between(seen) / ARCSECOND_RAD;
                assert!(off < 0.5, "{density} {seen_rad}: {off} arcsec");
            }
            // Apparent altitude decreases with true altitude everywhere.
            let altitude = |arriving_rad: f64| {
                let arriving = refraction.zenith * arriving_rad.sin() + level * arriving_rad.cos();
                refraction.seen(arriving).dot(refraction.zenith).asin()
            };
            let altitudes: Vec<f64> = (0..3000).map(|i| altitude(-0.3 + 0.0004 * f64::from(i))).collect();
            assert!(altitudes.windows(2).all(|pair| pair[1] > pair[0]), "{density}");
            assert!((altitude(-0.3) + 0.3).abs() < 1e-12);
        }
    }

    #[test]
    fn a_low_disc_is_raised_and_flattened() {
        let refraction = Refraction { zenith: DVec3::Y, density: 1.0 };
        let radius_rad = 0.00465;
        let middle = DVec3::new((-0.005_f64).cos(), (-0.005_f64).sin(), 0.0);
        let map = refraction.around(middle, radius_rad);
        assert!((map * middle - refraction.seen(middle)).length() < 1e-9);
        for turn in 0..12 {
            let (sin, cos) = (f64::from(turn) * std::f64::consts::FRAC_PI_6).sin_cos();
            let limb = (middle + radius_rad * (DVec3::Z * cos + middle.cross(DVec3::Z) * sin)).normalize();
            let off = (map * limb).angle_between(refraction.seen(limb)) / ARCSECOND_RAD;
            assert!(off < 20.0, "{turn}: {off} arcsec");
        }
        // The height of the Sun on the horizon is a sixth less than its width.
        let up = map * middle.cross(DVec3::Z).normalize();
        assert!((0.78..0.88).contains(&up.length()), "{}", up.length());
        assert!(((map * DVec3::Z).length() - 1.0).abs() < 1e-3);
        // Refraction within a cone does not exceed the bound.
        for [altitude, half] in [[0.3, 0.1], [0.05, 0.2], [-0.02, 0.01], [1.5, 0.3]] {
            let axis = DVec3::new(f64::cos(altitude), f64::sin(altitude), 0.0);
            let most = refraction.most_rad(axis, half);
            for step in 0..=100 {
                let angle = altitude - half + 2.0 * half * f64::from(step) / 100.0;
                let place = DVec3::new(angle.cos(), angle.sin(), 0.0);
                assert!(refraction.seen(place).angle_between(place) <= most + 1e-9, "{altitude} {half} {angle}");
            }
        }
    }
}
