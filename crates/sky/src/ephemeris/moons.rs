//! The largest moons of Jupiter and Saturn: equinoctial elements as sums of few periodic terms, fitted to JPL's
//! jup365 and to TASS 1.7 (`moons.csv`). From 1931 to 2068, at times outside the fit, Jupiter's moons have an error of
//! 55 km on average (0.02 arcsec) and 131 km at most. From 1800 to 2200, Titan has an error of 36 km on average and 84
//! km at most.

use std::sync::LazyLock;

use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;

use super::table;
use crate::{solar_system::SolarBody, units::DAY_S};

/// Equators of Jupiter and Saturn at J2000.0: right ascension of the node and inclination, rad, relative to the ICRS
/// equator.
const JUPITER_EQUATOR: [f64; 2] = [6.249_501_830_657_15, 0.445_094_736_497_665];
/// See [`JUPITER_EQUATOR`].
const SATURN_EQUATOR: [f64; 2] = [2.279_208_016_886_875, 0.112_800_629_556_393];

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Element {
    Distance,
    Motion,
    Longitude,
    Eccentricity,
    Inclination,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Term {
    moon: SolarBody,
    element: Element,
    amplitude: f64,
    phase: f64,
    frequency: f64,
}

#[allow(clippy::expect_used, reason = "the file is part of the program, and a test reads it")]
static TERMS: LazyLock<Vec<Term>> = LazyLock::new(|| table(include_str!("moons.csv")).expect("the terms of the moons"));

/// Equinoctial elements relative to the equator of a planet.
#[derive(Clone, Copy, Debug, Default)]
struct Elements {
    /// Semi-major axis, km.
    distance_km: f64,
    /// Mean longitude, rad.
    longitude_rad: f64,
    /// Eccentricity times the cosine and the sine of the longitude of the pericentre.
    eccentricity: DVec2,
    /// Sine of half the inclination times the cosine and the sine of the longitude of the node.
    inclination: DVec2,
}

impl Elements {
    fn new(moon: SolarBody, days: f64) -> Self {
        let mut elements = Self::default();
        for Term { element, amplitude, phase, frequency, .. } in TERMS.iter().filter(|term| term.moon == moon) {
            let (sin, cos) = (phase + frequency * days).sin_cos();
            match element {
                Element::Distance => elements.distance_km += amplitude * cos,
                Element::Motion => elements.longitude_rad += amplitude + frequency * days,
                Element::Longitude => elements.longitude_rad += amplitude * sin,
                Element::Eccentricity => elements.eccentricity += *amplitude * DVec2::new(cos, sin),
                Element::Inclination => elements.inclination += *amplitude * DVec2::new(cos, sin),
            }
        }
        elements
    }

    /// Position of these elements, km (R. A. Broucke and P. J. Cefola, "On the equinoctial orbit elements", Celestial
    /// Mechanics 5, 303, 1972, with the sine of half the inclination instead of its tangent).
    fn place_km(&self) -> DVec3 {
        let DVec2 { x: k, y: h } = self.eccentricity;
        let DVec2 { x: q, y: p } = self.inclination;
        // Solve Kepler's equation. Eccentricities are below 0.03: each Newton step from the mean longitude gains more
        // than three digits.
        let mut eccentric = self.longitude_rad;
        for _ in 0..4 {
            let (sin, cos) = eccentric.sin_cos();
            eccentric -= (eccentric - k * sin + h * cos - self.longitude_rad) / (1.0 - k * cos - h * sin);
        }
        let (sin, cos) = eccentric.sin_cos();
        let beta = 1.0 / (1.0 + (1.0 - k * k - h * h).sqrt());
        let x = (1.0 - h * h * beta) * cos + h * k * beta * sin - k;
        let y = (1.0 - k * k * beta) * sin + h * k * beta * cos - h;
        let root = (1.0 - p * p - q * q).sqrt();
        let towards_x = DVec3::new(1.0 - 2.0 * p * p, 2.0 * p * q, -2.0 * p * root);
        let towards_y = DVec3::new(2.0 * p * q, 1.0 - 2.0 * q * q, 2.0 * q * root);
        (x * towards_x + y * towards_y) * self.distance_km
    }
}

/// Position of a moon relative to its planet's centre, ICRS axes, m, without light time; `tdb_s` is TDB, s since
/// J2000.0. Zero for any body that is not one of these moons.
pub(super) fn planetocentric_m(moon: SolarBody, tdb_s: f64) -> DVec3 {
    let [node, inclination] = match moon.planet() {
        Some(SolarBody::Jupiter) => JUPITER_EQUATOR,
        Some(SolarBody::Saturn) => SATURN_EQUATOR,
        _ => return DVec3::ZERO,
    };
    let icrs_from_equator = DMat3::from_rotation_z(node) * DMat3::from_rotation_x(inclination);
    icrs_from_equator * Elements::new(moon, tdb_s / DAY_S).place_km() * 1e3
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::units::{ASTRONOMICAL_UNIT_M, J2000_JD};

    /// Positions from JPL's ephemeris jup365 (Horizons, geometric, relative to Jupiter's centre, ICRF), AU, at Julian
    /// dates of TDB.
    const OF_JPL: &str = include_str!("../../../../tests/data/jupiter_moons.csv");
    /// Positions from TASS 1.7, in the same form.
    const OF_TASS: &str = include_str!("../../../../tests/data/titan.csv");

    #[derive(Deserialize)]
    struct Row {
        jd: f64,
        moon: SolarBody,
        x: f64,
        y: f64,
        z: f64,
    }

    fn errors_km(expected: &str, turned_rad: f64) -> Vec<(SolarBody, f64)> {
        let error = |row: Row| {
            let place_m = planetocentric_m(row.moon, (row.jd - J2000_JD) * DAY_S);
            let expected_m = DVec3::new(row.x, row.y, row.z) * ASTRONOMICAL_UNIT_M;
            (row.moon, (DMat3::from_rotation_z(turned_rad) * place_m - expected_m).length() / 1e3)
        };
        table(expected).unwrap().into_iter().map(error).collect()
    }

    /// Root mean square and maximum of a moon's errors, km, and the number of errors.
    fn errors_of(moon: SolarBody, errors: &[(SolarBody, f64)]) -> [f64; 3] {
        let of_moon = errors.iter().filter(|(body, _)| *body == moon).map(|(_, km)| *km).collect::<Vec<_>>();
        let rms = (of_moon.iter().map(|km| km * km).sum::<f64>() / of_moon.len() as f64).sqrt();
        let most = of_moon.iter().copied().fold(0.0, f64::max);
        println!("{}: {} places, rms {rms:.0} km, at most {most:.0} km", moon.name(), of_moon.len());
        [rms, most, of_moon.len() as f64]
    }

    #[test]
    fn moons_of_jupiter_match_jpl_positions() {
        let errors = errors_km(OF_JPL, 0.0);
        for moon in [SolarBody::Io, SolarBody::Europa, SolarBody::Ganymede, SolarBody::Callisto] {
            let [rms, most, places] = errors_of(moon, &errors);
            assert!(places >= 40.0 && rms < 65.0 && most < 150.0, "{moon:?}");
        }
        // A rotation by a hundredth of a degree must fail.
        let turned = errors_km(OF_JPL, 1.7e-4);
        assert!(turned.iter().all(|(_, km)| km.is_finite()) && turned.iter().any(|(_, km)| *km > 250.0));
    }

    #[test]
    fn titan_matches_its_theory() {
        let [rms, most, places] = errors_of(SolarBody::Titan, &errors_km(OF_TASS, 0.0));
        assert!(places >= 40.0 && rms < 45.0 && most < 90.0);
        assert!(errors_of(SolarBody::Titan, &errors_km(OF_TASS, 1.7e-4))[0] > 70.0);
    }

    #[test]
    fn every_term_belongs_to_a_moon_with_a_planet() {
        for term in TERMS.iter() {
            assert!(term.moon.planet().is_some() && term.amplitude.is_finite(), "{term:?}");
        }
        assert_eq!(planetocentric_m(SolarBody::Mars, 0.0), DVec3::ZERO);
    }
}
