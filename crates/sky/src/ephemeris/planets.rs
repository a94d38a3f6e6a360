//! The Sun and the planets by VSOP87 (P. Bretagnon and G. Francou, "Planetary theories in rectangular and spherical
//! variables", Astronomy and Astrophysics 202, 309, 1988), with all terms. Uranus and Neptune, whose orbits were less
//! well known then, are corrected to DE440 from 1800 to 2200; outside these years the correction keeps its value at the
//! limit.

use std::sync::LazyLock;

use glam::DVec3;
use serde::Deserialize;
use vsop87::{RectangularCoordinates, vsop87a, vsop87e};

use super::{ICRS_FROM_VSOP, julian_date, table};
use crate::{solar_system::SolarBody, units::ASTRONOMICAL_UNIT_M};

/// Range of the correction, Julian dates.
const CORRECTED_JD: [f64; 2] = [2_378_496.5, 2_524_593.5];

/// A Chebyshev coefficient, 1e-9 AU.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Coefficient {
    planet: SolarBody,
    order: i32,
    x: f64,
    y: f64,
    z: f64,
}

#[allow(clippy::expect_used, reason = "the file is part of the program, and a test reads it")]
static CORRECTIONS: LazyLock<Vec<Coefficient>> =
    LazyLock::new(|| table(include_str!("outer.csv")).expect("the corrections of planets"));

fn icrs_m(place: &RectangularCoordinates) -> DVec3 {
    ICRS_FROM_VSOP.mul_vec3(DVec3::new(place.x, place.y, place.z)) * ASTRONOMICAL_UNIT_M
}

fn correction_m(planet: SolarBody, jd: f64) -> DVec3 {
    let [first, last] = CORRECTED_JD;
    let angle = ((2.0 * jd - first - last) / (last - first)).clamp(-1.0, 1.0).acos();
    let of_planet = CORRECTIONS.iter().filter(|coefficient| coefficient.planet == planet);
    let sum: DVec3 = of_planet
        .map(|Coefficient { order, x, y, z, .. }| DVec3::new(*x, *y, *z) * (f64::from(*order) * angle).cos())
        .sum();
    sum * (1e-9 * ASTRONOMICAL_UNIT_M)
}

/// Position of the Sun relative to the barycentre, ICRS axes, m; `tdb_s` is TDB, s since J2000.0.
pub(super) fn sun_m(tdb_s: f64) -> DVec3 {
    icrs_m(&vsop87e::sun(julian_date(tdb_s)))
}

/// Position of a planet relative to the Sun, with the same axes and units; zero for the Sun and for moons, which other
/// modules place.
pub(super) fn heliocentric_m(planet: SolarBody, tdb_s: f64) -> DVec3 {
    let jd = julian_date(tdb_s);
    let place = match planet {
        SolarBody::Sun
        | SolarBody::Moon
        | SolarBody::Io
        | SolarBody::Europa
        | SolarBody::Ganymede
        | SolarBody::Callisto
        | SolarBody::Titan => return DVec3::ZERO,
        SolarBody::Mercury => vsop87a::mercury(jd),
        SolarBody::Venus => vsop87a::venus(jd),
        SolarBody::Earth => vsop87a::earth(jd),
        SolarBody::Mars => vsop87a::mars(jd),
        SolarBody::Jupiter => vsop87a::jupiter(jd),
        SolarBody::Saturn => vsop87a::saturn(jd),
        SolarBody::Uranus => vsop87a::uranus(jd),
        SolarBody::Neptune => vsop87a::neptune(jd),
    };
    icrs_m(&place) + correction_m(planet, jd)
}
