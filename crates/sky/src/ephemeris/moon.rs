//! The Moon: the semi-analytical theory ELP/MPP02 (J. Chapront and G. Francou, "The lunar theory ELP revisited",
//! Astronomy and Astrophysics 404, 735, 2003), truncated at 0.01 arcsec. Compared with JPL's DE440 from 1900 to 2100,
//! its error is 0.12 arcsec on average and 0.51 arcsec at most, and 0.6 km in distance.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};
use serde::Deserialize;

use super::{LUNAR_EQUINOX, LUNAR_OBLIQUITY, julian_centuries};
use crate::{coordinates::direction_from_lon_lat, polynomial::polynomial, units::ARCSECOND_RAD};

/// Semi-major axis of DE405 over that of the theory.
const SCALE: f64 = 384_747.961_370_172_5 / 384_747.980_674_318;
/// Mean longitude, rad, by powers of time in centuries.
const MEAN_LONGITUDE: [f64; 5] = [
    3.810_343_920_321_909,
    8_399.684_730_207_433,
    -3.319_199_297_527_46e-5,
    3.201_709_550_047_375e-8,
    -1.536_374_555_436_119_7e-10,
];
/// Laskar's P and Q of the mean ecliptic of date, by powers of time, starting at the first power.
const P: [f64; 5] = [1.018_039_1e-5, 4.702_043_9e-7, -5.417_367e-10, -2.507_948e-12, 4.634_86e-15];
const Q: [f64; 5] = [-1.134_690_02e-4, 1.237_267_4e-7, 1.265_417e-9, -1.371_808e-12, -3.203_34e-15];

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Coordinate {
    Longitude,
    Latitude,
    Distance,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Term {
    coordinate: Coordinate,
    power: i32,
    amplitude: f64,
    phase_0: f64,
    phase_1: f64,
    phase_2: f64,
    phase_3: f64,
    phase_4: f64,
}

impl Term {
    fn value(&self, t: f64) -> f64 {
        let phase = self.phase_0 + t * (self.phase_1 + t * (self.phase_2 + t * (self.phase_3 + t * self.phase_4)));
        self.amplitude * t.powi(self.power) * phase.sin()
    }
}

#[allow(clippy::expect_used, reason = "the file is part of the program, and a test reads it")]
static TERMS: LazyLock<Vec<Term>> = LazyLock::new(|| super::table(include_str!("moon.csv")).expect("the Moon's terms"));

/// The Moon's centre relative to the Earth's, ICRS axes, m, without light time; `tdb_s` is TDB, s since J2000.0.
pub(super) fn geocentric_m(tdb_s: f64) -> DVec3 {
    let t = julian_centuries(tdb_s);
    let sum = |coordinate: Coordinate| {
        TERMS.iter().filter(|term| term.coordinate == coordinate).map(|term| term.value(t)).sum::<f64>()
    };
    let longitude = polynomial(&MEAN_LONGITUDE, t) + sum(Coordinate::Longitude) * ARCSECOND_RAD;
    let latitude = sum(Coordinate::Latitude) * ARCSECOND_RAD;
    let distance_m = 1e3 * SCALE * sum(Coordinate::Distance);
    let of_date = direction_from_lon_lat(longitude, latitude);
    // Rotate to the ecliptic of J2000.
    let (p, q) = (t * polynomial(&P, t), t * polynomial(&Q, t));
    let root = 2.0 * (1.0 - p * p - q * q).sqrt();
    let ecliptic = DVec3::new(
        (1.0 - 2.0 * p * p) * of_date.x + 2.0 * p * q * of_date.y + p * root * of_date.z,
        2.0 * p * q * of_date.x + (1.0 - 2.0 * q * q) * of_date.y - q * root * of_date.z,
        -p * root * of_date.x + q * root * of_date.y + (1.0 - 2.0 * p * p - 2.0 * q * q) * of_date.z,
    );
    DMat3::from_rotation_z(LUNAR_EQUINOX) * DMat3::from_rotation_x(LUNAR_OBLIQUITY) * ecliptic * distance_m
}
