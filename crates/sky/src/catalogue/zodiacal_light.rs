//! The zodiacal light and the gegenschein: sunlight that dust between the planets scatters, as seen from the Earth.
//!
//! Source: C. Leinert et al., "The 1997 reference of diffuse night sky brightness", A&A Supplement 127, 1998, Table 17 (500 nm, after A. C.
//! Levasseur-Regourd and R. Dumont 1980). The table is symmetric about the Sun and about the ecliptic. Annual variations of a few percent and the
//! inclination of the plane of the dust are not modelled.

use std::{
    f64::consts::PI,
    sync::{Arc, LazyLock, OnceLock},
};

use glam::{DMat3, DVec3};

use super::{diffuse::DiffuseSky, healpix::s10_cd_m2};
use crate::{
    coordinates::lon_lat_from_direction, ephemeris::icrs_from_ecliptic, once, photometry::blackbody::rec709_in_gamut,
};

/// Latitudes of the columns, degrees.
const LATITUDES: [f64; 11] = [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 45.0, 60.0, 75.0, 90.0];
/// Longitudes of the rows from the Sun, degrees.
const LONGITUDES: [f64; 19] = [
    0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0, 135.0, 150.0, 165.0,
    180.0,
];
/// Brightness in stars of the Sun's colour and V = 10 per square degree. 0: not measured, closer than 15 degrees to the Sun.
const TABLE: [[f64; 11]; 19] = [
    [0.0, 0.0, 0.0, 3140.0, 1610.0, 985.0, 640.0, 275.0, 150.0, 100.0, 77.0],
    [0.0, 0.0, 0.0, 2940.0, 1540.0, 945.0, 625.0, 271.0, 150.0, 100.0, 77.0],
    [0.0, 0.0, 4740.0, 2470.0, 1370.0, 865.0, 590.0, 264.0, 148.0, 100.0, 77.0],
    [11500.0, 6780.0, 3440.0, 1860.0, 1110.0, 755.0, 525.0, 251.0, 146.0, 100.0, 77.0],
    [6400.0, 4480.0, 2410.0, 1410.0, 910.0, 635.0, 454.0, 237.0, 141.0, 99.0, 77.0],
    [3840.0, 2830.0, 1730.0, 1100.0, 749.0, 545.0, 410.0, 223.0, 136.0, 97.0, 77.0],
    [2480.0, 1870.0, 1220.0, 845.0, 615.0, 467.0, 365.0, 207.0, 131.0, 95.0, 77.0],
    [1650.0, 1270.0, 910.0, 680.0, 510.0, 397.0, 320.0, 193.0, 125.0, 93.0, 77.0],
    [1180.0, 940.0, 700.0, 530.0, 416.0, 338.0, 282.0, 179.0, 120.0, 92.0, 77.0],
    [910.0, 730.0, 555.0, 442.0, 356.0, 292.0, 250.0, 166.0, 116.0, 90.0, 77.0],
    [505.0, 442.0, 352.0, 292.0, 243.0, 209.0, 183.0, 134.0, 104.0, 86.0, 77.0],
    [338.0, 317.0, 269.0, 227.0, 196.0, 172.0, 151.0, 116.0, 93.0, 82.0, 77.0],
    [259.0, 251.0, 225.0, 193.0, 166.0, 147.0, 132.0, 104.0, 86.0, 79.0, 77.0],
    [212.0, 210.0, 197.0, 170.0, 150.0, 133.0, 119.0, 96.0, 82.0, 77.0, 77.0],
    [188.0, 186.0, 177.0, 154.0, 138.0, 125.0, 113.0, 90.0, 77.0, 74.0, 77.0],
    [179.0, 178.0, 166.0, 147.0, 134.0, 122.0, 110.0, 90.0, 77.0, 73.0, 77.0],
    [179.0, 178.0, 165.0, 148.0, 137.0, 127.0, 116.0, 96.0, 79.0, 72.0, 77.0],
    [196.0, 192.0, 179.0, 165.0, 151.0, 141.0, 131.0, 104.0, 82.0, 72.0, 77.0],
    [230.0, 212.0, 195.0, 178.0, 163.0, 148.0, 134.0, 105.0, 83.0, 72.0, 77.0],
];
/// Smallest number of the table: this light is everywhere, and the brightness of the sky away from the ecliptic includes it.
const DARKEST_S10: f64 = 72.0;
/// Where the table is empty, the light follows this power of the distance from the Sun, with elliptical contours of this ratio of latitude to
/// longitude. Both values follow from the measured values at the border.
const INNER_POWER: f64 = -2.3;
const INNER_RATIO: f64 = 0.569;
/// Longitude below which the light of the inner part no longer increases, degrees.
const INNERMOST_DEG: f64 = 5.0;
/// Size of the texels of the map, rad.
const TEXEL_RAD: f64 = 0.015;

/// Natural logarithm of the table, with the empty cells filled.
static LOGARITHMS: LazyLock<[[f64; 11]; 19]> = LazyLock::new(|| {
    let mut filled = TABLE;
    for (row, longitude) in filled.iter_mut().zip(LONGITUDES) {
        for (value, latitude) in row.iter_mut().zip(LATITUDES) {
            if *value == 0.0 {
                let out = longitude.hypot(latitude / INNER_RATIO).max(INNERMOST_DEG);
                *value = TABLE[3][0] * (out / LONGITUDES[3]).powf(INNER_POWER);
            }
            *value = value.ln();
        }
    }
    filled
});

/// The light in axes whose x points to the Sun's ecliptic longitude and whose z is the pole of the ecliptic.
static WHOLE: OnceLock<Arc<DiffuseSky>> = OnceLock::new();
/// The same light without the part that is everywhere.
static ABOVE_DARKEST: OnceLock<Arc<DiffuseSky>> = OnceLock::new();

/// Brightness at an ecliptic longitude from the Sun and a latitude, rad, in stars of the Sun's colour and V = 10 per square degree. The logarithm is
/// interpolated with continuous first derivatives.
pub fn brightness_s10(longitude_rad: f64, latitude_rad: f64) -> f64 {
    let longitude = (longitude_rad.rem_euclid(2.0 * PI) - PI).abs();
    let longitude_deg = 180.0 - longitude.to_degrees();
    let of_row = |row: &[f64; 11]| hermite(&LATITUDES, row, latitude_rad.abs().to_degrees());
    hermite(&LONGITUDES, &LOGARITHMS.each_ref().map(of_row), longitude_deg).exp()
}

/// Cubic interpolation through the values at the nodes; the slope at a node is that of the parabola through three nodes. The slope is 0 at both ends,
/// because the light is symmetric about them.
fn hermite(nodes: &[f64], values: &[f64], at: f64) -> f64 {
    let last = nodes.len() - 1;
    let at = at.clamp(nodes[0], nodes[last]);
    let i = nodes.partition_point(|node| *node <= at).clamp(1, last) - 1;
    let slope = |k: usize| {
        if k == 0 || k == last {
            return 0.0;
        }
        let (before, after) = (nodes[k] - nodes[k - 1], nodes[k + 1] - nodes[k]);
        let (rise, next) = ((values[k] - values[k - 1]) / before, (values[k + 1] - values[k]) / after);
        (rise * after + next * before) / (before + after)
    };
    let width = nodes[i + 1] - nodes[i];
    let t = (at - nodes[i]) / width;
    let (t2, t3) = (t * t, t * t * t);
    values[i] * (2.0 * t3 - 3.0 * t2 + 1.0)
        + values[i + 1] * (3.0 * t2 - 2.0 * t3)
        + width * (slope(i) * (t3 - 2.0 * t2 + t) + slope(i + 1) * (t3 - t2))
}

fn map(without_s10: f64) -> DiffuseSky {
    let colour = rec709_in_gamut(5772.0);
    DiffuseSky::new(TEXEL_RAD, |towards| {
        let (longitude, latitude) = lon_lat_from_direction(towards);
        let cd_m2 = (brightness_s10(longitude, latitude) - without_s10).max(0.0) * s10_cd_m2();
        colour.map(|channel| channel * cd_m2)
    })
}

/// The zodiacal light at one time.
#[derive(Clone, Debug)]
pub struct ZodiacalLight {
    /// Luminance, cd/m^2, in axes whose x points to the Sun's ecliptic longitude and whose z is the pole of the ecliptic.
    pub sky: Arc<DiffuseSky>,
    /// Rotation from ICRS axes to those of the sky.
    pub sky_from_icrs: DMat3,
}

impl ZodiacalLight {
    /// Creates the light for the direction of the Sun, ICRS. If `above_darkest` is true, leaves out the part that is everywhere, because the
    /// luminance of a night sky already includes it.
    pub fn new(to_sun: DVec3, above_darkest: bool) -> Self {
        let pole = icrs_from_ecliptic() * DVec3::Z;
        let x = (to_sun - pole * to_sun.dot(pole)).normalize_or(icrs_from_ecliptic() * DVec3::X);
        let sky_from_icrs = DMat3::from_cols(x, pole.cross(x), pole).transpose();
        let (cell, without_s10) = if above_darkest { (&ABOVE_DARKEST, DARKEST_S10) } else { (&WHOLE, 0.0) };
        let sky = Arc::clone(once::get_or_make(cell, || Arc::new(map(without_s10))));
        Self { sky, sky_from_icrs }
    }

    /// Luminance towards a direction, ICRS, linear Rec. 709, cd/m^2.
    pub fn luminance_cd_m2(&self, towards: DVec3) -> [f64; 3] {
        self.sky.luminance_cd_m2(self.sky_from_icrs * towards)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::rec709::luminance;

    #[test]
    fn brightness_equals_the_table_and_is_smooth_between() {
        for (row, longitude) in TABLE.iter().zip(LONGITUDES) {
            for (value, latitude) in row.iter().zip(LATITUDES).filter(|(value, _)| **value > 0.0) {
                for (side, hemisphere) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)] {
                    let found =
                        brightness_s10(side * f64::to_radians(longitude), hemisphere * f64::to_radians(latitude));
                    assert!((found / value - 1.0).abs() < 1e-9, "{longitude} {latitude}: {found}, not {value}");
                }
            }
        }
        // There is neither a step nor a new maximum between the nodes.
        let mut before = brightness_s10(f64::to_radians(5.0), 0.0);
        for step in 51..=1350 {
            let next = brightness_s10(f64::to_radians(0.1 * f64::from(step)), 0.0);
            assert!(next <= before * 1.001 && next > 0.9 * before, "{step}: {before} {next}");
            before = next;
        }
        // The gegenschein is brighter than the sky 40 degrees from it.
        assert!(brightness_s10(PI, 0.0) > 1.25 * brightness_s10(f64::to_radians(140.0), 0.0));
    }

    #[test]
    fn the_map_turns_with_the_sun_and_has_the_brightness_of_the_table() {
        for to_sun in [DVec3::X, DVec3::new(-0.3, 0.8, 0.35).normalize()] {
            let light = ZodiacalLight::new(to_sun, false);
            let pole = icrs_from_ecliptic() * DVec3::Z;
            let x = light.sky_from_icrs.transpose() * DVec3::X;
            assert!(x.dot(pole).abs() < 1e-12 && x.dot(to_sun) > 0.9);
            // The table has 132 S10 at 90 degrees east and 30 degrees from the ecliptic, and 230 S10 at 180 degrees.
            let east = pole.cross(x);
            let place = east * f64::to_radians(30.0).cos() + pole * f64::to_radians(30.0).sin();
            for (towards, s10) in [(place, 132.0), (-x, 230.0), (pole, 77.0), (-pole, 77.0)] {
                let found = luminance(light.luminance_cd_m2(towards)) / s10_cd_m2();
                assert!((found / s10 - 1.0).abs() < 0.01, "{towards}: {found}, not {s10}");
                let above = luminance(ZodiacalLight::new(to_sun, true).luminance_cd_m2(towards)) / s10_cd_m2();
                assert!((above - (s10 - DARKEST_S10)).abs() < 0.01 * s10, "{towards}: {above}");
            }
        }
    }
}
