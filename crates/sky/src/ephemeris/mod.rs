//! Positions of the Sun, the planets and their largest moons: VSOP87 for planets and ELP/MPP02 for the Moon, both
//! compared with JPL's DE440 (`docs/sky.md`), and fits of few terms for the moons of Jupiter and Saturn.
//!
//! Positions are geometric, without light time, on ICRS axes in m; times are TDB, s since J2000.0. TT is used as TDB:
//! they differ by at most 1.7 ms, in which the Moon moves by 0.001 arcsec.

mod kernels;
mod moon;
mod moons;
mod planets;
mod rotation;

use std::{fmt, str::FromStr};

use glam::{DMat3, DVec3};
use serde::{Deserialize, de::DeserializeOwned};

use crate::{
    solar_system::SolarBody,
    units::{ARCSECOND_RAD, DAY_S, J2000_JD, LIGHT_M_S},
};

pub use kernels::{KernelError, Kernels};

/// Source of a body's position: `mars`, or `spk:-82` for the body with NAIF number -82 in SPK kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(try_from = "String")]
pub enum Ephemeris {
    /// The theories of this module.
    Of(SolarBody),
    /// SPK kernels, by NAIF number.
    Spk(i32),
}

impl fmt::Display for Ephemeris {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Of(body) => f.write_str(body.name()),
            Self::Spk(number) => write!(f, "spk:{number}"),
        }
    }
}

impl FromStr for Ephemeris {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = text.strip_prefix("spk:").map(str::parse).transpose().map_err(|error| {
            format!("`{text}`: {error}; `spk:` must be followed by the NAIF number of a body, as in spk:-82")
        })?;
        let found = number.map(Self::Spk).or_else(|| SolarBody::from_name(text).map(Self::Of));
        found.ok_or_else(|| {
            format!("`{text}`: must be one of {}, or spk:NUMBER", SolarBody::ALL.map(SolarBody::name).join(", "))
        })
    }
}

impl TryFrom<String> for Ephemeris {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<SolarBody> for Ephemeris {
    fn from(body: SolarBody) -> Self {
        Self::Of(body)
    }
}

/// Rotation from the ecliptic and equinox of VSOP87 to the axes of FK5, which agree with ICRS within 0.03 arcsec (the
/// authors' `vsop87.doc`).
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
/// Obliquity of the inertial mean ecliptic of J2000.0 in ICRS and position of its equinox, rad (J. Chapront, M.
/// Chapront-Touze and G. Francou, Astronomy and Astrophysics 387, 700, 2002).
const LUNAR_OBLIQUITY: f64 = 84_381.411 * ARCSECOND_RAD;
const LUNAR_EQUINOX: f64 = -0.055_42 * ARCSECOND_RAD;

fn julian_date(tdb_s: f64) -> f64 {
    J2000_JD + tdb_s / DAY_S
}

fn julian_centuries(tdb_s: f64) -> f64 {
    tdb_s / (36_525.0 * DAY_S)
}

/// Parses the rows of a table that is compiled into the program.
fn table<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, csv::Error> {
    csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes()).deserialize().collect()
}

/// Rotation from the mean ecliptic and equinox of J2000.0 to ICRS.
pub fn icrs_from_ecliptic() -> DMat3 {
    ICRS_FROM_VSOP
}

impl SolarBody {
    /// Position of the body's centre relative to the barycentre of the Solar System, m. For planets with moons,
    /// except the Earth, it is the barycentre of their system, around which their moons are placed.
    pub fn barycentric_m(self, tdb_s: f64) -> DVec3 {
        let sun_m = planets::sun_m(tdb_s);
        match self {
            Self::Sun => sun_m,
            Self::Moon => sun_m + planets::heliocentric_m(Self::Earth, tdb_s) + moon::geocentric_m(tdb_s),
            Self::Io | Self::Europa | Self::Ganymede | Self::Callisto => {
                sun_m + planets::heliocentric_m(Self::Jupiter, tdb_s) + moons::planetocentric_m(self, tdb_s)
            }
            Self::Titan => sun_m + planets::heliocentric_m(Self::Saturn, tdb_s) + moons::planetocentric_m(self, tdb_s),
            planet => sun_m + planets::heliocentric_m(planet, tdb_s),
        }
    }

    /// Velocity, m/s, by central differences.
    pub fn velocity_m_s(self, tdb_s: f64) -> DVec3 {
        const STEP_S: f64 = 600.0;
        (self.barycentric_m(tdb_s + STEP_S) - self.barycentric_m(tdb_s - STEP_S)) / (2.0 * STEP_S)
    }

    /// Position of the body relative to `observer_m`, m, at the time when it emitted the light that arrives at `tdb_s`.
    pub fn astrometric_m(self, observer_m: DVec3, tdb_s: f64) -> DVec3 {
        astrometric_m(|at_s| self.barycentric_m(at_s), observer_m, tdb_s)
    }
}

/// Position of a body relative to `observer_m`, m, at the time when it emitted the light that arrives at `tdb_s`.
/// `barycentric_m` returns its position at a time.
pub fn astrometric_m(barycentric_m: impl Fn(f64) -> DVec3, observer_m: DVec3, tdb_s: f64) -> DVec3 {
    let now_m = barycentric_m(tdb_s) - observer_m;
    let before_s = now_m.length() / LIGHT_M_S;
    if before_s == 0.0 {
        return now_m;
    }
    let before_m = barycentric_m(tdb_s - before_s) - observer_m;
    // Bodies are slower than 5e-4 c, so the light time differs from `before_s` by less than this share. During the
    // difference, bodies move in straight lines.
    let left_s = before_m.length() / LIGHT_M_S - before_s;
    before_m + (before_m - now_m) * (left_s / before_s)
}
