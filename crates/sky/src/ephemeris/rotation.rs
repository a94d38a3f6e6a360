//! Orientation of the Sun, the planets and their largest moons: poles and prime meridians of B. A. Archinal et al.,
//! "Report of the IAU Working Group on Cartographic Coordinates and Rotational Elements: 2015", Celestial Mechanics
//! and Dynamical Astronomy 130, 22, 2018. Terms below 0.1 degrees with separate arguments are left out, except for
//! the Moon, whose terms are complete.

use glam::DQuat;

use super::julian_centuries;
use crate::{solar_system::SolarBody, units::DAY_S};

/// Pole and prime meridian, degrees.
struct Elements {
    pole_ra: f64,
    pole_dec: f64,
    meridian: f64,
}

/// Arguments E1 to E13 of the Moon: at J2000.0 and per day, degrees.
const MOON_ARGUMENTS: [[f64; 2]; 13] = [
    [125.045, -0.052_992_1],
    [250.089, -0.105_984_2],
    [260.008, 13.012_000_9],
    [176.625, 13.340_715_4],
    [357.529, 0.985_600_3],
    [311.589, 26.405_708_4],
    [134.963, 13.064_993_0],
    [276.617, 0.328_714_6],
    [34.226, 1.748_487_7],
    [15.134, -0.158_976_3],
    [119.743, 0.003_609_6],
    [239.961, 0.164_357_3],
    [25.053, 12.959_008_8],
];
/// Coefficients of the sines in the pole's right ascension, of the cosines in its declination, and of the sines in
/// the meridian, degrees.
const MOON_TERMS: [[f64; 3]; 13] = [
    [-3.8787, 1.5419, 3.5610],
    [-0.1204, 0.0239, 0.1208],
    [0.0700, -0.0278, -0.0642],
    [-0.0172, 0.0068, 0.0158],
    [0.0, 0.0, 0.0252],
    [0.0072, -0.0029, -0.0066],
    [0.0, 0.0009, -0.0047],
    [0.0, 0.0, -0.0046],
    [0.0, 0.0, 0.0028],
    [-0.0052, 0.0008, 0.0052],
    [0.0, 0.0, 0.0040],
    [0.0, 0.0, 0.0019],
    [0.0043, -0.0009, -0.0044],
];

fn moon(d: f64, t: f64) -> Elements {
    let mut elements = Elements {
        pole_ra: 269.9949 + 0.0031 * t,
        pole_dec: 66.5392 + 0.0130 * t,
        meridian: 38.3213 + 13.176_358_15 * d - 1.4e-12 * d * d,
    };
    for ([at_start, per_day], [ra, dec, meridian]) in MOON_ARGUMENTS.iter().zip(MOON_TERMS) {
        let (sin, cos) = (at_start + per_day * d).to_radians().sin_cos();
        elements.pole_ra += ra * sin;
        elements.pole_dec += dec * cos;
        elements.meridian += meridian * sin;
    }
    elements
}

/// Arguments J4 to J7 of Jupiter's moons: at J2000.0 and per century, degrees. The terms of J3 and J8 are below 0.1
/// and 0.01 degrees.
const JOVIAN_ARGUMENTS: [[f64; 2]; 4] = [[355.80, 1191.3], [119.90, 262.1], [229.80, 64.3], [352.25, 2382.6]];

/// A moon of Jupiter: pole and meridian without periodic terms, and coefficients of the terms as in [`MOON_TERMS`].
fn jovian(d: f64, t: f64, pole: [f64; 2], meridian: [f64; 2], terms: [[f64; 3]; 4]) -> Elements {
    let mut elements = Elements {
        pole_ra: pole[0] - 0.009 * t,
        pole_dec: pole[1] + 0.003 * t,
        meridian: meridian[0] + meridian[1] * d,
    };
    for ([at_start, per_century], [ra, dec, meridian]) in JOVIAN_ARGUMENTS.iter().zip(terms) {
        let (sin, cos) = (at_start + per_century * t).to_radians().sin_cos();
        elements.pole_ra += ra * sin;
        elements.pole_dec += dec * cos;
        elements.meridian += meridian * sin;
    }
    elements
}

fn elements(body: SolarBody, d: f64, t: f64) -> Elements {
    let make = |pole_ra: f64, pole_dec: f64, meridian: f64| Elements { pole_ra, pole_dec, meridian };
    let slow = |at_start: f64| (at_start + 0.504_261_5 * t).to_radians();
    match body {
        SolarBody::Sun => make(286.13, 63.87, 84.176 + 14.184_4 * d),
        SolarBody::Mercury => make(281.0103 - 0.0328 * t, 61.4155 - 0.0049 * t, 329.5988 + 6.138_510_8 * d),
        SolarBody::Venus => make(272.76, 67.16, 160.20 - 1.481_368_8 * d),
        SolarBody::Earth => make(-0.641 * t, 90.0 - 0.557 * t, 190.147 + 360.985_623_5 * d),
        SolarBody::Moon => moon(d, t),
        SolarBody::Mars => make(
            317.269_202 - 0.109_275_47 * t + 0.419_057 * slow(79.398_797).sin(),
            54.432_516 - 0.058_271_05 * t + 1.591_274 * slow(166.325_722).cos(),
            176.049_863 + 350.891_982_443_297 * d + 0.584_542 * slow(95.391_654).sin(),
        ),
        SolarBody::Jupiter => make(268.056_595 - 0.006_499 * t, 64.495_303 + 0.002_413 * t, 284.95 + 870.536 * d),
        SolarBody::Saturn => make(40.589 - 0.036 * t, 83.537 - 0.004 * t, 38.90 + 810.793_902_4 * d),
        SolarBody::Uranus => make(257.311, -15.175, 203.81 - 501.160_092_8 * d),
        SolarBody::Neptune => {
            let (sin, cos) = (357.85 + 52.316 * t).to_radians().sin_cos();
            make(299.36 + 0.70 * sin, 43.46 - 0.51 * cos, 249.978 + 541.139_775_7 * d - 0.48 * sin)
        }
        SolarBody::Io => {
            let terms = [[0.024, 0.011, -0.022], [0.0; 3], [0.0; 3], [0.0; 3]];
            jovian(d, t, [268.05, 64.50], [200.39, 203.488_953_8], terms)
        }
        SolarBody::Europa => {
            let terms =
                [[1.086, 0.468, -0.980], [0.060, 0.026, -0.054], [0.015, 0.007, -0.014], [0.009, 0.002, -0.008]];
            jovian(d, t, [268.08, 64.51], [36.022, 101.374_723_5], terms)
        }
        SolarBody::Ganymede => {
            let terms = [[-0.037, -0.016, 0.033], [0.431, 0.186, -0.389], [0.091, 0.039, -0.082], [0.0; 3]];
            jovian(d, t, [268.20, 64.57], [44.064, 50.317_608_1], terms)
        }
        SolarBody::Callisto => {
            let terms = [[0.0; 3], [-0.068, -0.029, 0.061], [0.590, 0.254, -0.533], [0.0; 3]];
            jovian(d, t, [268.72, 64.83], [259.51, 21.571_071_5], terms)
        }
        SolarBody::Titan => make(39.4827, 83.4279, 186.5855 + 22.576_976_8 * d),
    }
}

impl SolarBody {
    /// Rotation from the body's axes (z to its north pole, x to its prime meridian) to ICRS at a time.
    pub fn icrs_from_body(self, tdb_s: f64) -> DQuat {
        let Elements { pole_ra, pole_dec, meridian } = elements(self, tdb_s / DAY_S, julian_centuries(tdb_s));
        let [node, inclination, meridian] =
            [pole_ra + 90.0, 90.0 - pole_dec, meridian.rem_euclid(360.0)].map(f64::to_radians);
        DQuat::from_rotation_z(node) * DQuat::from_rotation_x(inclination) * DQuat::from_rotation_z(meridian)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::coordinates::lon_lat_from_direction;

    /// Seconds since J2000.0 of a Julian date.
    fn tdb_s(jd: f64) -> f64 {
        (jd - crate::units::J2000_JD) * DAY_S
    }

    /// Longitude (east positive) and latitude of the centre of a disc seen from the Earth's centre, degrees.
    fn middle_deg(body: SolarBody, jd: f64) -> [f64; 2] {
        let now_s = tdb_s(jd);
        let earth_m = SolarBody::Earth.barycentric_m(now_s);
        let seen_m = body.astrometric_m(earth_m, now_s);
        let left_s = now_s - seen_m.length() / crate::units::LIGHT_M_S;
        let (longitude, latitude) = lon_lat_from_direction(body.icrs_from_body(left_s).inverse() * -seen_m);
        [longitude.to_degrees(), latitude.to_degrees()]
    }

    #[test]
    fn sub_earth_points_match_published_ones() {
        // J. Meeus, "Astronomical Algorithms", examples 53.a (the Moon's librations, 1992-04-12) and 42.a (Mars, 1992-11-09).
        let [longitude, latitude] = middle_deg(SolarBody::Moon, 2_448_724.5);
        assert!((longitude - 360.0 + 1.23).abs() < 0.05 && (latitude - 4.20).abs() < 0.05, "{longitude} {latitude}");
        let [longitude, latitude] = middle_deg(SolarBody::Mars, 2_448_935.500_683);
        assert!((360.0 - longitude - 111.55).abs() < 0.4 && (latitude - 12.44).abs() < 0.4, "{longitude} {latitude}");
    }

    #[test]
    fn the_earths_rotation_matches_sidereal_time() {
        // Greenwich sidereal time of 2000-01-01T12:00 UT1: 280.461 degrees.
        let greenwich = SolarBody::Earth.icrs_from_body(64.0) * DVec3::X;
        let (longitude, latitude) = lon_lat_from_direction(greenwich);
        assert!((longitude.to_degrees() - 280.46).abs() < 0.3 && latitude.abs() < 1e-3, "{}", longitude.to_degrees());
    }

    #[test]
    fn moons_turn_one_face_to_their_planet() {
        // Limits in degrees. First, the mean position of the planet, which is not zero because craters define the
        // meridians. Second, the libration in longitude, about twice the eccentricity. Third, the libration in
        // latitude, which is the tilt of the axis to the orbit.
        let most_deg = [
            (SolarBody::Moon, [0.5, 8.5, 7.3]),
            (SolarBody::Io, [0.6, 0.7, 0.1]),
            (SolarBody::Europa, [1.8, 1.4, 0.05]),
            (SolarBody::Ganymede, [2.7, 0.5, 0.05]),
            (SolarBody::Callisto, [1.1, 1.1, 0.05]),
            (SolarBody::Titan, [2.4, 3.8, 0.6]),
        ];
        let steps = 80;
        for (moon, allowed) in most_deg {
            let (mut longitudes, mut latitude_most) = (Vec::new(), 0.0_f64);
            for step in -steps / 2..steps / 2 {
                let tdb_s = f64::from(step) * 401.7 * DAY_S;
                let to_planet_m =
                    moon.planet().map_or(DVec3::ZERO, |planet| planet.barycentric_m(tdb_s)) - moon.barycentric_m(tdb_s);
                let (longitude, latitude) = lon_lat_from_direction(moon.icrs_from_body(tdb_s).inverse() * to_planet_m);
                longitudes.push((longitude.to_degrees() + 180.0).rem_euclid(360.0) - 180.0);
                latitude_most = latitude_most.max(latitude.abs().to_degrees());
            }
            let mean = longitudes.iter().sum::<f64>() / longitudes.len() as f64;
            let libration = longitudes.iter().map(|longitude| (longitude - mean).abs()).fold(0.0, f64::max);
            let found = [mean.abs(), libration, latitude_most];
            println!("{}: {found:.2?} degrees", moon.name());
            assert!(found.iter().zip(allowed).all(|(found, most)| *found < most), "{moon:?}: {found:?}");
        }
    }
}
