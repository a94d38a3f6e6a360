//! The light of the stars that are too faint to be drawn individually: the Milky Way.
//!
//! 1. **Model.** The light of all stars fainter than the drawn ones is integrated along every line of sight of
//!    `sightlines`: density times luminosity function, dimmed and reddened by the dust in front (A(612), A(549),
//!    A(465 nm) over A_V = 0.87, 1, 1.22 for R, G, B: Cardelli, Clayton and Mathis 1989 with R_V = 3.1).
//! 2. **Level.** Pioneer 10 and 11 measured the sky from beyond the zodiacal light (`background_starlight.csv`: every 10 degrees of longitude and 4
//!    to 10 of latitude, including the diffuse galactic light). A factor that varies smoothly over these cells fits the sum of the model and the
//!    drawn stars to the measurement. In this way the star clouds of Sagittarius, Scutum, Cygnus and Carina and the Great Rift appear at their
//!    positions, although the model has neither spiral arms nor clumps. The measurement is at 440 nm in units of solar-type stars; the background is
//!    brighter in V because it is redder than the Sun.
//! 3. **Lanes.** Detail finer than the sightlines (half a degree) comes from a screen of filaments whose strength depends on the dust. It is
//!    invented: real filaments look similar but are at other positions.
//! 4. **Neighbours.** The galaxies visible to the naked eye (`neighbours`).
//!
//! Luminances are those seen from the Sun, outside the atmosphere.

use std::{f64::consts::FRAC_1_SQRT_2, sync::LazyLock};

use glam::{DVec2, DVec3, DVec4, Vec4};
use rayon::prelude::*;

use super::{
    neighbours::Neighbours,
    noise::{LATTICE_NOISE_DEVIATION, lattice_noise},
    sampling::Sky,
    sightlines::{
        LATITUDES, LONGITUDES, SHELLS, corner_pc, distance_modulus_mag, distance_pc, latitude_rad, longitude_rad,
        plane_index,
    },
    structure::Place,
};
use crate::{
    catalogue::{diffuse::DiffuseSky, healpix::s10_cd_m2},
    coordinates::{galactic_from_icrs, lon_lat_from_direction},
    photometry::rec709,
    units::ILLUMINANCE_MAG_0_LX,
};

/// The measured sky excludes stars brighter than this, V magnitudes.
pub const MEASURED_FAINTER_THAN_MAG: f64 = 6.5;
/// Ratio of V to the measurement at 440 nm in solar-type stars: the mean B-V of the background is 0.80 (Toller 1981: 0.7 to 0.9), that of the Sun
/// 0.65.
const V_OVER_440_NM: f64 = 1.148_153_6;
/// Extinction of R, G and B relative to V.
const REDDENING: [f64; 3] = [0.87, 1.0, 1.22];
/// Size of the texels of the map, rad.
const TEXEL_RAD: f64 = 0.0035;
/// Smallest level factor: it applies where the drawn stars alone are as bright as the measured sky.
const LEAST_FACTOR: f64 = 0.1;
/// Number of corrections of the level. Several are needed because each factor is spread as widely as the measured cells.
const ROUNDS: usize = 6;
/// Each row gives the latitude up to which it applies (degrees), and the spread of a measured cell along longitude (degrees) and along latitude (in
/// units of the distance to the next cell). Far from the band, little remains except the error of the measurement, which is a tenth.
const SPREADS: [(f64, f64, f64); 3] = [(12.0, 4.2, 0.42), (45.0, 12.0, 0.7), (90.0, 25.0, 0.7)];
/// Number of longitudes in the table.
const TABLE_LONGITUDES: usize = 36;
/// Shell up to which dust forms lanes: 2 kpc.
const LANES_SHELL: usize = 64;
/// Filaments: largest size on the sky, number of sizes (each half of the previous one), weight of a size relative to the previous one, amount of
/// bending relative to the largest size, and standard deviation of the natural logarithm of the light behind thick dust.
const LANE_RAD: f64 = 0.11;
const LANE_SIZES: u32 = 5;
const LANE_WEIGHT: f64 = 0.66;
const LANE_BEND: f64 = 0.45;
const LANE_CONTRAST: f64 = 0.62;
const LANE_SEED: u64 = 71;

const ROWS: usize = LATITUDES + 1;
const CORNERS: usize = LONGITUDES * ROWS;

/// A row of the measured table: latitude, degrees, and luminance at each longitude, cd/m^2; NaN if not measured.
pub struct MeasuredRow {
    /// Galactic latitude, degrees.
    pub latitude_deg: f64,
    /// V luminance, cd/m^2.
    pub luminance_cd_m2: [f64; TABLE_LONGITUDES],
}

/// The measured sky, from south to north.
pub static MEASURED: LazyLock<Vec<MeasuredRow>> = LazyLock::new(|| {
    let rows = include_str!("background_starlight.csv").lines().filter(|line| !line.starts_with('#'));
    rows.map(|row| {
        let mut numbers = row.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN));
        let latitude_deg = numbers.next().unwrap_or(f64::NAN);
        let mut luminance_cd_m2 = [f64::NAN; TABLE_LONGITUDES];
        luminance_cd_m2
            .iter_mut()
            .zip(numbers)
            .for_each(|(luminance, s10)| *luminance = s10 * V_OVER_440_NM * s10_cd_m2());
        MeasuredRow { latitude_deg, luminance_cd_m2 }
    })
    .collect()
});

/// Values of the model at a corner of the sightlines.
#[derive(Clone, Copy, Default)]
struct Corner {
    /// Light of stars fainter than the drawn ones, R, G, B, cd/m^2.
    unresolved: [f64; 3],
    /// Luminance of the drawn stars that the measurement includes, cd/m^2.
    resolved: f64,
    /// Extinction up to 2 kpc, V magnitudes.
    dust_mag: f64,
}

/// Computes the light of the stars fainter than V = `fainter_than_mag`, and of the neighbouring galaxies.
pub fn unresolved_light(sky: &Sky, fainter_than_mag: f64) -> DiffuseSky {
    let corners = model(sky, fainter_than_mag.max(MEASURED_FAINTER_THAN_MAG));
    let level = Level::new(&corners);
    // Compute the light and the dust at the nodes of the spline.
    let nodes: Vec<[f32; 4]> = corners
        .iter()
        .zip(&level.factors)
        .map(|(corner, factor)| {
            let [r, g, b] = corner.unresolved.map(|c| (c * factor) as f32);
            [r, g, b, corner.dust_mag as f32]
        })
        .collect();
    let galactic = galactic_from_icrs();
    let neighbours = Neighbours::new();
    DiffuseSky::new(TEXEL_RAD, |towards| {
        let in_galaxy = galactic * towards;
        let [r, g, b, dust_mag] = spline(&nodes, in_galaxy);
        let through = lanes(in_galaxy, dust_mag);
        let beyond = neighbours.luminance_cd_m2(towards);
        let own = [r, g, b];
        // Far from the band nothing is dimmed.
        let dimmed = |c: usize| if through == 1.0 { own[c] } else { own[c] * through.powf(REDDENING[c]) };
        [0, 1, 2].map(|c| dimmed(c) + beyond[c])
    })
}

/// Integrates the light along every line of sight, by longitude, then latitude.
fn model(sky: &Sky, fainter_than_mag: f64) -> Vec<Corner> {
    let mut corners = vec![Corner::default(); CORNERS];
    corners.par_chunks_mut(ROWS).enumerate().for_each(|(longitude, column)| {
        let extinction = sky.sightlines().plane(longitude);
        for (latitude, corner) in column.iter_mut().enumerate() {
            // One step covers two shells; density and dust are taken at the boundary between them.
            for shell in (1..SHELLS).step_by(2) {
                let dust_mag = f64::from(extinction[plane_index(latitude, shell)]);
                let (near, far) = (distance_pc(shell - 1), distance_pc(shell + 1));
                let modulus_mag = distance_modulus_mag(shell);
                let p = corner_pc(longitude, latitude, shell);
                let densities = Place::from_sun(p.x, p.y, p.z).densities();
                // Volume of the step in cubic parsecs per sr, and the illuminance from a star of absolute magnitude 0 there.
                let volume = (far.powi(3) - near.powi(3)) / 3.0;
                let of_0_lx = |dust_mag: f64| ILLUMINANCE_MAG_0_LX * 10_f64.powf(-0.4 * (modulus_mag + dust_mag));
                let reddened = REDDENING.map(|ratio| of_0_lx(ratio * dust_mag));
                let dimmed = of_0_lx(dust_mag);
                for (function, density) in sky.functions().iter().zip(densities) {
                    let stars = volume * density;
                    if stars < 1e-9 {
                        continue;
                    }
                    let light = function.light_fainter_than(fainter_than_mag - modulus_mag - dust_mag);
                    let brighter = function.light_fainter_than(MEASURED_FAINTER_THAN_MAG - modulus_mag - dust_mag);
                    for c in 0..3 {
                        corner.unresolved[c] += stars * reddened[c] * light[c];
                    }
                    corner.resolved += stars * dimmed * (rec709::luminance(brighter) - rec709::luminance(light));
                }
            }
            corner.dust_mag = f64::from(extinction[plane_index(latitude, LANES_SHELL)]);
        }
    });
    corners
}

/// The level factor at every corner.
struct Level {
    factors: Vec<f64>,
}

/// Gaussian weights of the measured cells in both directions.
struct Cells {
    /// Weights by row of the table, then latitude.
    at_latitude: Vec<Vec<f64>>,
    /// The same, times the solid angle of each band of latitude; the weights of each row add up to 1.
    over_latitudes: Vec<Vec<f64>>,
    /// Weights by row of the table, then steps of longitude from the cell.
    by_step: Vec<Vec<f64>>,
}

impl Cells {
    fn new() -> Self {
        let middles: Vec<f64> = MEASURED.iter().map(|row| row.latitude_deg).collect();
        let gap = |j: usize| (middles[(j + 1).min(middles.len() - 1)] - middles[j.max(1) - 1]) / 2.0;
        let normal = |off: f64, sigma: f64| (-0.5 * (off / sigma).powi(2)).exp();
        let spread = |j: usize| SPREADS[SPREADS.partition_point(|(to, ..)| *to < middles[j].abs())];
        let at_latitude: Vec<Vec<f64>> = (0..middles.len())
            .map(|j| {
                // Beyond the last row the sky is treated as in that row.
                let clamped_deg = |i: usize| latitude_rad(i).to_degrees().clamp(middles[0], middles[middles.len() - 1]);
                (0..ROWS).map(|i| normal(clamped_deg(i) - middles[j], spread(j).2 * gap(j))).collect()
            })
            .collect();
        let band = |i: usize| {
            let edge = |i: usize, next: usize| 0.5 * (latitude_rad(i) + latitude_rad(next));
            edge(i, (i + 1).min(ROWS - 1)).sin() - edge(i, i.saturating_sub(1)).sin()
        };
        let over_latitudes = at_latitude
            .iter()
            .map(|weights| {
                let weighted: Vec<f64> = weights.iter().enumerate().map(|(i, weight)| weight * band(i)).collect();
                let sum: f64 = weighted.iter().sum();
                weighted.into_iter().map(|weight| weight / sum).collect()
            })
            .collect();
        let by_step = (0..middles.len())
            .map(|j| {
                let off = |step: usize| longitude_rad(step).to_degrees().min(360.0 - longitude_rad(step).to_degrees());
                (0..LONGITUDES).map(|step| normal(off(step), spread(j).1)).collect()
            })
            .collect();
        Self { at_latitude, over_latitudes, by_step }
    }

    fn along(&self, row: usize, cell: usize, longitude: usize) -> f64 {
        self.by_step[row][(longitude + LONGITUDES - cell * LONGITUDES / TABLE_LONGITUDES) % LONGITUDES]
    }

    /// Computes the mean of a quantity over the corners around each measured cell.
    fn means(&self, quantity: &(dyn Fn(usize) -> f64 + Sync)) -> Vec<[f64; TABLE_LONGITUDES]> {
        self.over_latitudes
            .par_iter()
            .enumerate()
            .map(|(j, weights)| {
                let norm: f64 = self.by_step[j].iter().sum();
                let rows: Vec<f64> = (0..LONGITUDES)
                    .map(|longitude| weights.iter().enumerate().map(|(i, w)| w * quantity(longitude * ROWS + i)).sum())
                    .collect();
                let mut means = [0.0; TABLE_LONGITUDES];
                for (cell, mean) in means.iter_mut().enumerate() {
                    *mean = rows.iter().enumerate().map(|(l, row)| row * self.along(j, cell, l)).sum::<f64>() / norm;
                }
                means
            })
            .collect()
    }

    /// Computes values at the corners from values at the measured cells: weighted means that ignore NaN.
    fn spread(&self, values: &[[f64; TABLE_LONGITUDES]]) -> Vec<f64> {
        let mut spread = vec![0.0; CORNERS];
        spread.par_chunks_mut(ROWS).enumerate().for_each(|(longitude, column)| {
            let of_rows: Vec<(f64, f64)> = values
                .iter()
                .enumerate()
                .map(|(j, row)| {
                    let cells = row.iter().enumerate().filter(|(_, value)| !value.is_nan());
                    let weighed = cells.map(|(cell, value)| (self.along(j, cell, longitude), value));
                    weighed.fold((0.0, 0.0), |(sum, total_weight), (weight, value)| {
                        (sum + weight * value, total_weight + weight)
                    })
                })
                .collect();
            for (i, value) in column.iter_mut().enumerate() {
                let weighed = self.at_latitude.iter().map(|weights| weights[i]).zip(&of_rows);
                let (sum, total_weight) = weighed.fold((0.0, 0.0), |(s, w), (weight, (sum, row_weight))| {
                    (s + weight * sum, w + weight * row_weight)
                });
                *value = sum / total_weight;
            }
        });
        spread
    }
}

impl Level {
    fn new(corners: &[Corner]) -> Self {
        let cells = Cells::new();
        let resolved = cells.means(&|corner| corners[corner].resolved);
        let mut logs = vec![[0.0; TABLE_LONGITUDES]; MEASURED.len()];
        let mut factors = vec![1.0; CORNERS];
        for _ in 0..ROUNDS {
            let unresolved = cells.means(&|corner| factors[corner] * rec709::luminance(corners[corner].unresolved));
            for (row, measured) in MEASURED.iter().enumerate() {
                for (cell, log) in logs[row].iter_mut().enumerate() {
                    let left = measured.luminance_cd_m2[cell] - resolved[row][cell];
                    // NaN if not measured.
                    let ratio = left / unresolved[row][cell];
                    *log = if ratio.is_nan() { f64::NAN } else { (*log + ratio.max(0.2).ln()).max(LEAST_FACTOR.ln()) };
                }
            }
            factors = cells.spread(&logs).into_iter().map(f64::exp).collect();
        }
        Self { factors }
    }
}

/// Fractional index of a latitude among those of the sightlines: inverse of [`latitude_rad`].
fn latitude_index(latitude_rad: f64) -> f64 {
    let wanted = (latitude_rad.abs() / std::f64::consts::FRAC_PI_2).min(1.0);
    // The function is convex: Newton's steps that start to the right of the root stay there.
    let mut u: f64 = 1.0;
    for _ in 0..8 {
        let (before, root) = (u, u.sqrt());
        u -= (u * (0.35 + 0.65 * u * root) - wanted) / (0.35 + 1.625 * u * root);
        if u == before {
            break;
        }
    }
    0.5 * LATITUDES as f64 * (1.0 + u.copysign(latitude_rad))
}

/// Evaluates the cubic B-spline over the corners towards a unit vector in galactic axes. It is smooth to the second
/// derivative and slightly wider than the distance between corners.
fn spline(nodes: &[[f32; 4]], towards: DVec3) -> [f64; 4] {
    let (l, b) = lon_lat_from_direction(towards);
    let place = DVec2::new(l / longitude_rad(1), latitude_index(b));
    let first = place.floor();
    let (across, up) = (spline_weights(place.x - first.x), spline_weights(place.y - first.y));
    let mut sum = DVec4::ZERO;
    for (i, weight) in across.iter().enumerate() {
        let longitude = (first.x as usize + i + LONGITUDES - 1) % LONGITUDES;
        for (j, other) in up.iter().enumerate() {
            let latitude = (first.y as usize + j).saturating_sub(1).min(LATITUDES);
            sum += weight * other * Vec4::from_array(nodes[longitude * ROWS + latitude]).as_dvec4();
        }
    }
    sum.to_array()
}

/// Weights of the cubic B-spline at a fraction of the distance between nodes, for the nodes around it.
#[inline]
fn spline_weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
        t * t * t / 6.0,
    ]
}

/// Relative transmission of the dust filaments, with mean 1, towards a unit vector for this amount of dust.
fn lanes(towards: DVec3, dust_mag: f64) -> f64 {
    let contrast = LANE_CONTRAST * dust_mag / (dust_mag + 1.5);
    if contrast < 0.03 {
        return 1.0;
    }
    let noise = |place: DVec3, seed: u64| lattice_noise(place.x, place.y, place.z, LANE_SEED + seed);
    let straight = towards / LANE_RAD;
    let mut place = straight + LANE_BEND * DVec3::new(noise(straight, 10), noise(straight, 11), noise(straight, 12));
    let (mut sum, mut weight, mut variance) = (0.0, 1.0, 0.0);
    for size in 0..LANE_SIZES {
        // Mix equal parts of filaments, which are sharp where the noise crosses 0, and of clouds.
        let own = noise(place, u64::from(size)) / LATTICE_NOISE_DEVIATION;
        sum += weight * FRAC_1_SQRT_2 * ((0.797 - own.abs()) / 0.604 + own);
        variance += weight * weight;
        weight *= LANE_WEIGHT;
        // Rotate the position, so that the lattices of successive sizes do not coincide.
        place =
            2.0 * DVec3::new(0.6 * place.x + 0.8 * place.y, 0.6 * place.y - 0.8 * place.x, place.z) + DVec3::splat(7.3);
    }
    let normal = sum / variance.sqrt();
    (-contrast * normal - 0.5 * contrast * contrast).exp()
}
