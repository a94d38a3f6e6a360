//! Light scattered by a clear atmosphere, by day and in twilight, from the Sun or the Moon.
//!
//! Air of molecules, aerosol and ozone surrounds a spherical Earth. Light scattered once is integrated along the line
//! of sight, outside the Earth's shadow. Light scattered more than once is treated as isotropic at each point and
//! summed as a geometric series of its first term (S. Hillaire, "A scalable and production ready sky and atmosphere
//! rendering technique", Computer Graphics Forum 39, 2020), scaled in twilight to the measured zenith
//! ([`measured_over_model`]). Optical depths are those of the extinction ([`super::atmosphere`]). Above the observer
//! the density of molecules falls by a factor of e per 8 km; below the observer it rises to the density at sea level,
//! so that a high observer sees the dense air below the horizon. Refraction, clouds, polarisation, and light reflected
//! by the ground are left out.
//!
//! Tables hold the light from a source of 1 lx; they depend on its altitude alone. They reach down to the lowest line
//! of sight that misses the Earth. [`night`] is the light of the sky without a source.
//!
//! Units: rad, km, optical depths, cd/m^2 per lx.

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use glam::DVec3;
use rayon::prelude::*;

use super::{atmosphere::measured_over_model, rec709};

mod night;

/// Radius of the Earth and height of the top of the atmosphere, km.
const EARTH_KM: f64 = 6371.0;
const TOP_KM: f64 = 100.0;
/// Scale height of molecules, km.
pub(super) const MOLECULES_KM: f64 = 8.0;
/// Scale height of aerosol, km.
pub(super) const AEROSOL_KM: f64 = 1.5;
/// The ozone layer, a triangular profile: height of its centre and half its width, km.
const OZONE_KM: [f64; 2] = [25.0, 15.0];
/// Single-scattering albedo of aerosol.
const AEROSOL_ALBEDO: f64 = 0.9;
/// Asymmetry of its phase function (W. M. Cornette and J. G. Shanks, Applied Optics 31, 3152, 1992).
pub const ASYMMETRY: f64 = 0.76;
/// Numbers of steps along a line of sight, along a line that collects light to be scattered again, and along a line to
/// the source.
const STEPS: usize = 40;
const STEPS_OF_MANY: usize = 24;
const LIGHT_STEPS: usize = 60;
/// Nodes of the table of light that arrives from a source: heights, and altitudes of the source.
const ARRIVING: [usize; 2] = [64, 128];
/// Nodes of the table of multiply scattered light, and number of directions in its integral.
const MANY: [usize; 2] = [16, 48];
const MANY_DIRECTIONS: [usize; 2] = [8, 6];
/// Smaller values are neglected, per sr.
const DARKEST: f64 = 1e-16;
/// Sines of the altitudes between which a source lights any air.
const SOURCE_SINES: [f64; 2] = [-0.42, 1.0];
/// Nodes of a table of the sky: altitudes, and azimuths from the source.
pub const TABLE_NODES: [usize; 2] = [40, 24];
/// Altitudes of a source within this interval share a table, rad.
const SHARED_RAD: f64 = 3e-4;
/// Number of tables that are kept.
const KEPT: usize = 4;

/// Optical depths above a position on the ground, by channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depths {
    /// Depths of molecules, which scatter.
    pub molecules: [f64; 3],
    /// Depths of aerosol.
    pub aerosol: [f64; 3],
    /// Depths of the whole layer of ozone, which absorbs. They include the part of the layer below the position.
    pub ozone: [f64; 3],
    /// Height of the position above the sea, km.
    pub height_km: f64,
    /// Scale height of molecules below the position, km.
    pub molecules_below_km: f64,
    /// Greatest density of aerosol below the position, relative to that at the position; at least 1.
    pub most_haze_below: f64,
}

/// The sky's luminance for a source of 1 lx at one altitude, cd/m^2.
///
/// Node (i, j) is at altitude l + (pi / 2 - l) (i / (n - 1))^2, with the lowest altitude l, and at azimuth pi (j / (m -
/// 1))^2 from the source.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyTable {
    /// Altitude of the first nodes, rad: [`lowest_rad`].
    pub lowest_rad: f64,
    /// Light scattered by molecules, and multiply scattered light.
    pub smooth: Vec<[f64; 3]>,
    /// Light scattered once by aerosol, for a phase function of 1.
    pub aerosol: Vec<[f64; 3]>,
}

/// Scattered light of one kind of air, with its tables.
pub struct SkyLight {
    depths: Depths,
    arriving: Vec<[f64; 3]>,
    many: Vec<[f64; 3]>,
    night: Vec<[f64; 3]>,
    kept: Mutex<Vec<(i64, Arc<SkyTable>)>>,
}

impl std::fmt::Debug for SkyLight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SkyLight").field("depths", &self.depths).finish_non_exhaustive()
    }
}

impl PartialEq for SkyLight {
    fn eq(&self, other: &Self) -> bool {
        self.depths == other.depths
    }
}

type Rgb = [f64; 3];

fn each(value: impl Fn(usize) -> f64) -> Rgb {
    [value(0), value(1), value(2)]
}

/// Phase function of molecules, per sr.
pub fn molecules_per_sr(cosine: f64) -> f64 {
    3.0 / (16.0 * PI) * (1.0 + cosine * cosine)
}

/// Phase function of aerosol, per sr.
pub fn aerosol_per_sr(cosine: f64) -> f64 {
    let g2 = ASYMMETRY * ASYMMETRY;
    let denominator = (1.0 + g2 - 2.0 * ASYMMETRY * cosine).max(1e-9).powf(1.5);
    3.0 / (8.0 * PI) * (1.0 - g2) * (1.0 + cosine * cosine) / ((2.0 + g2) * denominator)
}

/// Optical properties of the air at a point, per km.
struct Medium {
    molecules: Rgb,
    aerosol: Rgb,
    extinction: Rgb,
}

impl Depths {
    fn medium(&self, height_km: f64) -> Medium {
        let above_km = height_km - self.height_km;
        // A line of sight below the horizon of a high position passes denser air than the air at the position.
        let scale_km = if above_km < 0.0 { self.molecules_below_km } else { MOLECULES_KM };
        let thin = (-above_km / scale_km).exp() / MOLECULES_KM;
        let hazy = (-above_km / AEROSOL_KM).exp().min(self.most_haze_below) / AEROSOL_KM;
        let [middle, half] = OZONE_KM;
        let ozone = (1.0 - (height_km - middle).abs() / half).max(0.0) / half;
        let molecules = self.molecules.map(|depth| depth * thin);
        let aerosol = self.aerosol.map(|depth| depth * hazy);
        let extinction = each(|c| molecules[c] + aerosol[c] + self.ozone[c] * ozone);
        Medium { molecules, aerosol: aerosol.map(|scatters| AEROSOL_ALBEDO * scatters), extinction }
    }
}

/// Share of the ozone that is above a height, km.
pub(super) fn ozone_share_above(height_km: f64) -> f64 {
    let [middle, half] = OZONE_KM;
    // Height relative to the centre, in half widths.
    let place = ((height_km - middle) / half).clamp(-1.0, 1.0);
    let outer = 0.5 * (1.0 - place.abs()).powi(2);
    if place < 0.0 { 1.0 - outer } else { outer }
}

/// Distance to a sphere along a line that starts at a radius with a sine of altitude, km; the farther intersection.
fn to_sphere_km(radius_km: f64, sine: f64, sphere_km: f64) -> f64 {
    let along = radius_km * sine;
    -along + (along * along + sphere_km * sphere_km - radius_km * radius_km).max(0.0).sqrt()
}

/// Distances up to `whole_km` at which a line from a radius crosses the edge of the Earth's shadow, a cylinder; km,
/// in order.
fn shadow_edges_km(radius_km: f64, towards: DVec3, source: DVec3, whole_km: f64) -> Vec<f64> {
    let across = |vector: DVec3| vector - source * vector.dot(source);
    let (from, step) = (across(DVec3::Y * radius_km), across(towards));
    let (a, half_b, c) = (step.length_squared(), from.dot(step), from.length_squared() - EARTH_KM * EARTH_KM);
    let root = half_b * half_b - a * c;
    if a < 1e-12 || root <= 0.0 {
        return Vec::new();
    }
    let behind = |distance_km: &f64| (DVec3::Y * radius_km + towards * *distance_km).dot(source) < 0.0;
    let edges = [(-half_b - root.sqrt()) / a, (-half_b + root.sqrt()) / a];
    edges
        .into_iter()
        .filter(|distance_km| *distance_km > 0.0 && *distance_km < whole_km && behind(distance_km))
        .collect()
}

/// Lowest altitude at which a line of sight from a height misses the Earth, rad: straight lines, without refraction.
pub fn lowest_rad(height_km: f64) -> f64 {
    -(EARTH_KM / (EARTH_KM + height_km.max(0.0))).acos()
}

/// Altitude of a row of a table, rad.
fn altitude_of_row(lowest_rad: f64, row: usize) -> f64 {
    lowest_rad + (FRAC_PI_2 - lowest_rad) * (row as f64 / (TABLE_NODES[0] - 1) as f64).powi(2)
}

/// Position of an altitude among the rows of a table.
fn row_of_altitude(lowest_rad: f64, altitude_rad: f64) -> f64 {
    let part = (altitude_rad - lowest_rad) / (FRAC_PI_2 - lowest_rad);
    part.clamp(0.0, 1.0).sqrt() * (TABLE_NODES[0] - 1) as f64
}

/// Whether the Earth hides the direction at a sine of altitude, seen from a radius.
fn meets_earth(radius_km: f64, sine: f64) -> bool {
    sine < 0.0 && radius_km * radius_km * (1.0 - sine * sine) < EARTH_KM * EARTH_KM
}

/// Bilinear interpolation in a table; `at` in nodes.
fn between(table: &[Rgb], [rows, columns]: [usize; 2], position: [f64; 2]) -> Rgb {
    let [row, column] = [position[0].clamp(0.0, (rows - 1) as f64), position[1].clamp(0.0, (columns - 1) as f64)];
    let (r0, c0) = ((row as usize).min(rows - 2), (column as usize).min(columns - 2));
    let (dr, dc) = (row - r0 as f64, column - c0 as f64);
    let node = |r: usize, c: usize| &table[r * columns + c];
    each(|k| {
        let upper = node(r0, c0)[k] * (1.0 - dc) + node(r0, c0 + 1)[k] * dc;
        let lower = node(r0 + 1, c0)[k] * (1.0 - dc) + node(r0 + 1, c0 + 1)[k] * dc;
        upper * (1.0 - dr) + lower * dr
    })
}

/// Height of a node; nodes are denser near the ground.
fn height_of(part: f64) -> f64 {
    TOP_KM * part * part
}

/// Sine at which light arrives, for a node of a table that begins at the horizon of the height; nodes are denser near
/// the horizon.
fn sine_of(height_km: f64, part: f64) -> f64 {
    let radius = EARTH_KM + height_km;
    let lowest = -(1.0 - (EARTH_KM / radius).powi(2)).max(0.0).sqrt();
    lowest + (1.0 - lowest) * part * part * part
}

impl SkyLight {
    /// Computes the tables of some air.
    pub fn new(depths: Depths) -> Self {
        let [heights, sines] = ARRIVING;
        let fraction = |index: usize, count: usize| index as f64 / (count - 1) as f64;
        let arriving = (0..heights * sines)
            .into_par_iter()
            .map(|node| {
                let height_km = height_of(fraction(node / sines, heights));
                let sine = sine_of(height_km, fraction(node % sines, sines));
                let whole = to_sphere_km(EARTH_KM + height_km, sine, EARTH_KM + TOP_KM);
                let mut depth = [0.0; 3];
                let mut before_km = 0.0;
                for step in 1..=LIGHT_STEPS {
                    let end_km = whole * (step as f64 / LIGHT_STEPS as f64).powi(2);
                    let middle_km = 0.5 * (before_km + end_km);
                    let medium = depths.medium(height_along(height_km, sine, middle_km));
                    (0..3).for_each(|c| depth[c] += medium.extinction[c] * (end_km - before_km));
                    before_km = end_km;
                }
                depth.map(|depth| (-depth).exp())
            })
            .collect();
        let night = night::profile(&depths);
        let mut sky = Self { depths, arriving, many: Vec::new(), night, kept: Mutex::default() };
        let [heights, sines] = MANY;
        let [lowest, highest] = SOURCE_SINES;
        sky.many = (0..heights * sines)
            .into_par_iter()
            .map(|node| {
                let height_km = height_of(fraction(node / sines, heights));
                sky.scattered_many_times(height_km, lowest + (highest - lowest) * fraction(node % sines, sines))
            })
            .collect();
        sky
    }

    /// Lowest altitude at which there is sky, rad.
    pub fn lowest_rad(&self) -> f64 {
        lowest_rad(self.depths.height_km)
    }

    /// Luminance of the night sky relative to its zenith, at the altitudes of the rows of a [`SkyTable`].
    pub fn night(&self) -> &[[f64; 3]] {
        &self.night
    }

    /// Luminance of the night sky at an altitude, rad, relative to its zenith.
    pub fn night_at(&self, altitude_rad: f64) -> [f64; 3] {
        let place = row_of_altitude(self.lowest_rad(), altitude_rad);
        let low = (place as usize).min(TABLE_NODES[0] - 2);
        let part = place - low as f64;
        each(|c| self.night[low][c] * (1.0 - part) + self.night[low + 1][c] * part)
    }

    /// Share of the light of a source that arrives at a height, for the sine of the altitude of the source there.
    fn arriving(&self, height_km: f64, sine: f64) -> Rgb {
        let radius = EARTH_KM + height_km;
        if meets_earth(radius, sine) {
            return [0.0; 3];
        }
        let lowest = -(1.0 - (EARTH_KM / radius).powi(2)).max(0.0).sqrt();
        let part = ((sine - lowest) / (1.0 - lowest)).max(0.0).cbrt();
        let [rows, columns] = ARRIVING;
        let position = [(height_km / TOP_KM).max(0.0).sqrt() * (rows - 1) as f64, part * (columns - 1) as f64];
        between(&self.arriving, ARRIVING, position)
    }

    /// Isotropic light of all orders except the first at a point, per sr, for 1 lx of the source outside the air.
    fn many_at(&self, height_km: f64, sine: f64) -> Rgb {
        let [rows, columns] = MANY;
        let [lowest, highest] = SOURCE_SINES;
        if sine <= lowest {
            return [0.0; 3];
        }
        let row = (height_km / TOP_KM).max(0.0).sqrt() * (rows - 1) as f64;
        let column = (sine - lowest) / (highest - lowest) * (columns - 1) as f64;
        // The table holds logarithms: at dusk the light falls by a factor for each degree.
        if self.many.is_empty() { [0.0; 3] } else { between(&self.many, MANY, [row, column]).map(f64::exp) }
    }

    /// Entry for [`Self::many_at`]: the logarithm of the mean over all directions of the light that was scattered
    /// once, and of all further orders.
    fn scattered_many_times(&self, height_km: f64, source_sine: f64) -> Rgb {
        let [rings, around] = MANY_DIRECTIONS;
        let source = DVec3::new((1.0 - source_sine * source_sine).max(0.0).sqrt(), source_sine, 0.0);
        let (mut once, mut again) = ([0.0; 3], [0.0; 3]);
        for ring in 0..rings {
            let sine = -1.0 + 2.0 * (ring as f64 + 0.5) / rings as f64;
            let across = (1.0 - sine * sine).sqrt();
            for step in 0..around {
                let (sin, cos) = ((step as f64 + 0.5) / around as f64 * TAU).sin_cos();
                let towards = DVec3::new(across * cos, sine, across * sin);
                let Seen { evenly, share, .. } = self.along(height_km, towards, source, Orders::Once);
                let part = 1.0 / (rings * around) as f64;
                (0..3).for_each(|c| {
                    once[c] += part * evenly[c];
                    again[c] += part * share[c];
                });
            }
        }
        each(|c| (once[c] / (1.0 - again[c]).max(0.05)).max(DARKEST).ln())
    }

    /// Light seen along a line from a height, for a source of 1 lx at infinity; axes with y up.
    fn along(&self, height_km: f64, towards: DVec3, source: DVec3, orders: Orders) -> Seen {
        let radius = EARTH_KM + height_km;
        let whole = if meets_earth(radius, towards.y) {
            let along = radius * towards.y;
            -along - (along * along + EARTH_KM * EARTH_KM - radius * radius).max(0.0).sqrt()
        } else {
            to_sphere_km(radius, towards.y, EARTH_KM + TOP_KM)
        };
        let mut seen = Seen::default();
        let mut open = [1.0; 3];
        let steps = if orders == Orders::All { STEPS } else { STEPS_OF_MANY };
        // Steps end at the edges of the shadow, so that no step is partly in it.
        let ends: Vec<f64> =
            [0.0].into_iter().chain(shadow_edges_km(radius, towards, source, whole)).chain([whole]).collect();
        let steps = ends.windows(2).flat_map(|part| {
            let end = move |step: usize| part[0] + (part[1] - part[0]) * (step as f64 / steps as f64).powi(2);
            (0..steps).map(move |step| [end(step), end(step + 1)])
        });
        for [before_km, end_km] in steps {
            let length_km = end_km - before_km;
            let place = DVec3::Y * radius + towards * (0.5 * (before_km + end_km));
            let (place_km, up) = (place.length(), place.normalize());
            let height = (place_km - EARTH_KM).max(0.0);
            let medium = self.depths.medium(height);
            let sine = up.dot(source);
            let lit = self.arriving(height, sine);
            let many = if orders == Orders::All { self.many_at(height, sine) } else { [0.0; 3] };
            for c in 0..3 {
                let passed = (-medium.extinction[c] * length_km).exp();
                // Length of the step, km, weighted by the share of its light that is visible; the air is uniform within
                // a step.
                let seen_km = open[c]
                    * if medium.extinction[c] > 1e-12 { (1.0 - passed) / medium.extinction[c] } else { length_km };
                let scatters = medium.molecules[c] + medium.aerosol[c];
                seen.molecules[c] += seen_km * medium.molecules[c] * lit[c];
                seen.aerosol[c] += seen_km * medium.aerosol[c] * lit[c];
                seen.many[c] += seen_km * scatters * many[c];
                seen.evenly[c] += seen_km * scatters * lit[c] / (4.0 * PI);
                seen.share[c] += seen_km * scatters;
                open[c] *= passed;
            }
        }
        seen
    }

    /// Light of a source of 1 lx at an altitude that arrives at the ground from a direction at another altitude and
    /// an azimuth from the source, computed without a table, cd/m^2.
    pub fn luminance(&self, source_rad: f64, altitude_rad: f64, azimuth_rad: f64) -> Rgb {
        let towards = direction(altitude_rad, azimuth_rad);
        let source = direction(source_rad, 0.0);
        let seen = self.along(self.depths.height_km, towards, source, Orders::All);
        let (cosine, [once, many]) = (towards.dot(source), measured_over_model(source_rad));
        each(|c| {
            once * (seen.molecules[c] * molecules_per_sr(cosine) + seen.aerosol[c] * aerosol_per_sr(cosine))
                + many * seen.many[c]
        })
    }

    /// The table for a source at an altitude, rad; it is dark for a source far below the horizon.
    pub fn table(&self, source_rad: f64) -> Arc<SkyTable> {
        let number = (source_rad / SHARED_RAD).round() as i64;
        if let Some(found) = self.kept_table(number) {
            return found;
        }
        // No lock is held meanwhile: see `crate::once`.
        let table = Arc::new(self.made(number as f64 * SHARED_RAD));
        if let Some(found) = self.kept_table(number) {
            return found;
        }
        let mut kept = self.kept();
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push((number, Arc::clone(&table)));
        table
    }

    fn kept(&self) -> MutexGuard<'_, Vec<(i64, Arc<SkyTable>)>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the kept table of a number, and moves it to the end of the list, where the most recent one is.
    fn kept_table(&self, number: i64) -> Option<Arc<SkyTable>> {
        let mut kept = self.kept();
        let index = kept.iter().position(|(key, _)| *key == number)?;
        let found = kept.remove(index);
        let table = Arc::clone(&found.1);
        kept.push(found);
        Some(table)
    }

    fn made(&self, source_rad: f64) -> SkyTable {
        let [altitudes, azimuths] = TABLE_NODES;
        let (source, lowest_rad) = (direction(source_rad, 0.0), self.lowest_rad());
        let [once, many] = measured_over_model(source_rad);
        let node = |index: usize| {
            let azimuth_rad = PI * ((index % azimuths) as f64 / (azimuths - 1) as f64).powi(2);
            let towards = direction(altitude_of_row(lowest_rad, index / azimuths), azimuth_rad);
            let seen = self.along(self.depths.height_km, towards, source, Orders::All);
            let of_molecules = molecules_per_sr(towards.dot(source));
            let smooth = each(|c| once * seen.molecules[c] * of_molecules + many * seen.many[c]);
            (smooth, seen.aerosol.map(|light| once * light))
        };
        let (smooth, aerosol) = (0..altitudes * azimuths).into_par_iter().map(node).unzip();
        SkyTable { lowest_rad, smooth, aerosol }
    }
}

impl Default for SkyTable {
    fn default() -> Self {
        let dark = vec![[0.0; 3]; TABLE_NODES[0] * TABLE_NODES[1]];
        Self { lowest_rad: 0.0, smooth: dark.clone(), aerosol: dark }
    }
}

impl SkyTable {
    /// Upper bound of the luminance for 1 lx of the source, with isotropic scattering by aerosol, cd/m^2.
    pub fn brightest_cd_m2(&self) -> f64 {
        let nodes = self.smooth.iter().zip(&self.aerosol);
        nodes.map(|(smooth, aerosol)| rec709::luminance(each(|c| smooth[c] + aerosol[c]))).fold(0.0, f64::max)
    }

    /// Returns the table for sources at all azimuths at an altitude, rad, from this table for one of them. The result
    /// is scaled so that a level surface gets 1 lx, and does not depend on azimuth.
    pub fn all_around(&self, source_rad: f64) -> Self {
        let even = self.even(source_rad);
        let level_lx = even.level_lx_of_even();
        // A dark sky cannot be scaled.
        let scale = if level_lx > 0.0 { 1.0 / level_lx } else { 0.0 };
        Self { smooth: even.smooth.into_iter().map(|rgb| rgb.map(|channel| channel * scale)).collect(), ..even }
    }

    /// Illuminance of a level surface by this sky, lx, for a source of 1 lx at an altitude, rad. The direct light of
    /// the source is not included.
    pub fn level_lx(&self, source_rad: f64) -> f64 {
        self.even(source_rad).level_lx_of_even()
    }

    /// Mean over all azimuths.
    fn even(&self, source_rad: f64) -> Self {
        let [altitudes, azimuths] = TABLE_NODES;
        let source = direction(source_rad, 0.0);
        let row = |row: usize| {
            let altitude_rad = altitude_of_row(self.lowest_rad, row);
            let of_azimuth = |step: usize| {
                let azimuth_rad = PI * (step as f64 + 0.5) / azimuths as f64;
                self.luminance(altitude_rad, azimuth_rad, direction(altitude_rad, azimuth_rad).dot(source))
            };
            let sum = (0..azimuths).map(of_azimuth).fold([0.0; 3], |sum, value| each(|c| sum[c] + value[c]));
            sum.map(|channel| channel / azimuths as f64)
        };
        let smooth = (0..altitudes).flat_map(|altitude| std::iter::repeat_n(row(altitude), azimuths)).collect();
        Self { lowest_rad: self.lowest_rad, smooth, ..Self::default() }
    }

    /// Illuminance of a level surface by a sky that does not depend on azimuth, lx.
    fn level_lx_of_even(&self) -> f64 {
        let steps = 200;
        let step_rad = FRAC_PI_2 / f64::from(steps);
        let ring = |step: i32| {
            let altitude_rad = (f64::from(step) + 0.5) * step_rad;
            let (sine, cosine) = altitude_rad.sin_cos();
            TAU * sine * cosine * step_rad * rec709::luminance(self.luminance(altitude_rad, 0.0, 0.0))
        };
        (0..steps).map(ring).sum()
    }

    /// Luminance at an altitude and an azimuth from the source, rad, and the cosine of the angle from
    /// it; cd/m^2 per lx.
    pub fn luminance(&self, altitude_rad: f64, azimuth_rad: f64, cosine: f64) -> [f64; 3] {
        let place = |part: f64, count: usize| part.clamp(0.0, 1.0).sqrt() * (count - 1) as f64;
        let position = [
            row_of_altitude(self.lowest_rad, altitude_rad),
            place(azimuth_rad.rem_euclid(TAU).min((-azimuth_rad).rem_euclid(TAU)) / PI, TABLE_NODES[1]),
        ];
        let (smooth, aerosol) =
            (between(&self.smooth, TABLE_NODES, position), between(&self.aerosol, TABLE_NODES, position));
        each(|c| smooth[c] + aerosol[c] * aerosol_per_sr(cosine))
    }
}

/// Orders of scattering that are summed along a line.
#[derive(Clone, Copy, PartialEq)]
enum Orders {
    Once,
    All,
}

/// Integrals along a line.
#[derive(Default)]
struct Seen {
    /// Without their phase functions.
    molecules: Rgb,
    aerosol: Rgb,
    many: Rgb,
    /// Scattered once, as if isotropically.
    evenly: Rgb,
    /// Share of isotropic light along the line that is scattered.
    share: Rgb,
}

/// Axes: x towards the source's azimuth, y up.
fn direction(altitude_rad: f64, azimuth_rad: f64) -> DVec3 {
    let (sin, cos) = altitude_rad.sin_cos();
    DVec3::new(cos * azimuth_rad.cos(), sin, cos * azimuth_rad.sin())
}

fn height_along(height_km: f64, sine: f64, distance_km: f64) -> f64 {
    let radius = EARTH_KM + height_km;
    (radius * radius + distance_km * distance_km + 2.0 * radius * distance_km * sine).max(0.0).sqrt() - EARTH_KM
}

#[cfg(test)]
mod tests;
