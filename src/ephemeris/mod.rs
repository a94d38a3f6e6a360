//! Where the Sun, the Moon and the planets are: VSOP87 for planets, ELP/MPP02 for the Moon, both measured against JPL's DE440 (`docs/sky.md`).
//!
//! Places are ICRS axes, m, as the bodies stand at a moment, without light time; times are TDB, s since J2000.0. TT serves as TDB: they differ by 1.7 ms at most, in which
//! the Moon moves by 0.001 arcsec.

mod moon;
mod planets;
mod rotation;

use glam::{DMat3, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::units::{ARCSECOND_RAD, LIGHT_M_S};

/// From the ecliptic and equinox of VSOP87 to the axes of FK5, which ICRS has within 0.03 arcsec (the authors' `vsop87.doc`).
const ICRS_FROM_VSOP: DMat3 = DMat3::from_cols_array(&[
    1.0,
    -0.000_000_479_966,
    0.0,
    0.000_000_440_360,
    0.917_482_137_087,
    0.397_776_982_902,
    -0.000_000_190_919,
    -0.397_776_982_902,
    0.917_482_137_087,
]);
/// Obliquity of the inertial mean ecliptic of J2000.0 in ICRS and the place of its equinox, rad (J. Chapront, M. Chapront-Touze and G. Francou, Astronomy and Astrophysics 387,
/// 700, 2002).
const LUNAR_OBLIQUITY: f64 = 84_381.411 * ARCSECOND_RAD;
const LUNAR_EQUINOX: f64 = -0.055_42 * ARCSECOND_RAD;

/// s of a day.
const DAY_S: f64 = 86_400.0;
/// The Julian date of J2000.0.
const J2000_JD: f64 = 2_451_545.0;

fn julian_date(tdb_s: f64) -> f64 {
    J2000_JD + tdb_s / DAY_S
}

fn julian_centuries(tdb_s: f64) -> f64 {
    tdb_s / (36_525.0 * DAY_S)
}

/// The rows of a table that is part of the program.
fn table<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, csv::Error> {
    csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes()).deserialize().collect()
}

/// Rotation from the mean ecliptic and equinox of J2000.0 to ICRS.
pub fn icrs_from_ecliptic() -> DMat3 {
    ICRS_FROM_VSOP
}

/// A body whose place is known at any time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ephemeris {
    /// The Sun.
    Sun,
    /// Mercury.
    Mercury,
    /// Venus.
    Venus,
    /// The Earth.
    Earth,
    /// The Moon.
    Moon,
    /// Mars; with its moons, as all that follow.
    Mars,
    /// Jupiter.
    Jupiter,
    /// Saturn.
    Saturn,
    /// Uranus.
    Uranus,
    /// Neptune.
    Neptune,
}

impl Ephemeris {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Sun,
        Self::Mercury,
        Self::Venus,
        Self::Earth,
        Self::Moon,
        Self::Mars,
        Self::Jupiter,
        Self::Saturn,
        Self::Uranus,
        Self::Neptune,
    ];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sun => "sun",
            Self::Mercury => "mercury",
            Self::Venus => "venus",
            Self::Earth => "earth",
            Self::Moon => "moon",
            Self::Mars => "mars",
            Self::Jupiter => "jupiter",
            Self::Saturn => "saturn",
            Self::Uranus => "uranus",
            Self::Neptune => "neptune",
        }
    }

    /// Its centre from the barycentre of the Solar System, m.
    pub fn barycentric_m(self, tdb_s: f64) -> DVec3 {
        use planets::{Planet, heliocentric_m};
        let of_planet = |planet: Planet| planets::sun_m(tdb_s) + heliocentric_m(planet, tdb_s);
        match self {
            Self::Sun => planets::sun_m(tdb_s),
            Self::Mercury => of_planet(Planet::Mercury),
            Self::Venus => of_planet(Planet::Venus),
            Self::Earth => of_planet(Planet::Earth),
            Self::Moon => of_planet(Planet::Earth) + moon::geocentric_m(tdb_s),
            Self::Mars => of_planet(Planet::Mars),
            Self::Jupiter => of_planet(Planet::Jupiter),
            Self::Saturn => of_planet(Planet::Saturn),
            Self::Uranus => of_planet(Planet::Uranus),
            Self::Neptune => of_planet(Planet::Neptune),
        }
    }

    /// Its velocity, m/s, by central differences.
    pub fn velocity_m_s(self, tdb_s: f64) -> DVec3 {
        const STEP_S: f64 = 600.0;
        (self.barycentric_m(tdb_s + STEP_S) - self.barycentric_m(tdb_s - STEP_S)) / (2.0 * STEP_S)
    }

    /// Where it was when the light left it that reaches `observer_m` at a time: from the observer, m.
    pub fn astrometric_m(self, observer_m: DVec3, tdb_s: f64) -> DVec3 {
        let mut place_m = self.barycentric_m(tdb_s) - observer_m;
        // Speeds are below 1e-3 of light's: each step gains three digits.
        for _ in 0..3 {
            place_m = self.barycentric_m(tdb_s - place_m.length() / LIGHT_M_S) - observer_m;
        }
        place_m
    }
}
