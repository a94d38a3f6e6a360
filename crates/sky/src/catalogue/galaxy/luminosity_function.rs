//! The luminosity function of the stars near the Sun, and their temperatures.
//!
//! The local luminosity function gives the number of stars per cubic parsec and magnitude as a function of absolute V magnitude. Its sources are the
//! nearby stars of Wielen, Jahreiss and Krueger 1983 and, for the luminous end, the summary in Allen's *Astrophysical Quantities*. It is split into
//! main sequence and evolved stars (subgiants, giants, and the red clump as a separate Gaussian). White dwarfs are left out. The figures are rounded
//! within their scatter, such that the star counts of the model over the whole sky agree with the real ones. Temperatures follow the main sequence of
//! Pecaut and Mamajek 2013 (rounded); for evolved stars, a red giant branch from 5300 K at its foot to 3300 K at its tip, with scatter.

use super::structure::{POPULATIONS, Population};
use crate::photometry::blackbody::rec709_in_gamut;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

/// Brightest absolute V magnitude of the model.
pub const BRIGHTEST: f64 = -8.0;
/// Faintest absolute V magnitude of the model.
const FAINTEST: f64 = 19.0;
/// Steps per magnitude in the tables.
const STEPS_PER_MAG: usize = 20;
const STEPS: usize = (FAINTEST - BRIGHTEST) as usize * STEPS_PER_MAG;

/// Main sequence with supergiants: absolute magnitude, log10 of stars per pc^3 and magnitude.
const MAIN_SEQUENCE: [(f64, f64); 20] = [
    (-8.0, -10.5),
    (-7.0, -9.2),
    (-6.0, -8.2),
    (-5.0, -7.25),
    (-4.0, -6.55),
    (-3.0, -5.9),
    (-2.0, -5.3),
    (-1.0, -4.75),
    (0.0, -4.2),
    (1.0, -3.8),
    (2.0, -3.42),
    (3.0, -3.0),
    (4.0, -2.8),
    (5.0, -2.55),
    (7.0, -2.5),
    (9.0, -2.35),
    (12.0, -1.9),
    (13.0, -1.95),
    (16.0, -2.0),
    (19.0, -2.6),
];

/// Subgiants and red giants without the clump: absolute magnitude, log10 of stars per pc^3 and magnitude.
const RED_GIANT_BRANCH: [(f64, f64); 9] = [
    (-4.0, -9.0),
    (-3.0, -7.6),
    (-2.0, -6.2),
    (-1.0, -5.1),
    (0.0, -4.6),
    (1.0, -4.3),
    (3.0, -3.85),
    (4.0, -4.1),
    (5.0, -6.0),
];

/// The red clump: stars per cubic parsec, mean and standard deviation of the absolute V magnitude.
const CLUMP: (f64, f64, f64) = (0.85e-4, 0.8, 0.25);

/// Density of the thick disc and the halo near the Sun as a share of the old disc's (Juric et al. 2008: 12 % and 0.5
/// %; Bland-Hawthorn and Gerhard 2016: 4 % and less).
const THICK_DISC_SHARE: f64 = 0.07;
const HALO_SHARE: f64 = 0.0015;

/// Main sequence: absolute V magnitude and temperature in kelvin.
const MAIN_SEQUENCE_K: [(f64, f64); 19] = [
    (-6.0, 42_000.0),
    (-4.1, 31_500.0),
    (-2.5, 20_500.0),
    (-1.0, 15_500.0),
    (0.0, 12_200.0),
    (0.6, 10_500.0),
    (1.1, 9_700.0),
    (1.9, 8_100.0),
    (2.5, 7_250.0),
    (3.4, 6_550.0),
    (4.45, 5_930.0),
    (5.76, 5_270.0),
    (7.2, 4_450.0),
    (8.8, 3_850.0),
    (10.3, 3_550.0),
    (12.8, 3_200.0),
    (14.2, 3_050.0),
    (16.5, 2_800.0),
    (19.0, 2_400.0),
];

/// Evolved stars: absolute V magnitude and temperature in kelvin.
const EVOLVED_K: [(f64, f64); 8] = [
    (-4.0, 3_300.0),
    (-2.5, 3_450.0),
    (-1.0, 3_800.0),
    (0.0, 4_350.0),
    (0.8, 4_750.0),
    (2.0, 4_850.0),
    (3.2, 5_050.0),
    (5.0, 5_300.0),
];

/// Of the stars of the young "main sequence" that are brighter than this absolute magnitude, the share [`SUPERGIANT_SHARE`] are supergiants. Their
/// temperatures are between the two limits (distributed uniformly in the logarithm).
const SUPERGIANTS_FROM: f64 = -3.5;
const SUPERGIANT_SHARE: f64 = 0.5;
const SUPERGIANT_K: (f64, f64) = (3_500.0, 25_000.0);

/// Scatter of the natural logarithm of the temperature.
const MAIN_SEQUENCE_SCATTER: f64 = 0.03;
const EVOLVED_SCATTER: f64 = 0.04;

/// The luminosity function of one population, tabulated as its integral.
#[derive(Clone, Debug)]
pub struct LuminosityFunction {
    population: Population,
    /// Stars per pc^3 brighter than `BRIGHTEST + i / STEPS_PER_MAG`.
    cumulative: Vec<f64>,
    /// Share of evolved stars in the step from `i` to `i + 1`.
    evolved_share: Vec<f32>,
    /// Light of the stars fainter than `BRIGHTEST + i / STEPS_PER_MAG`: R, G, B per pc^3, in units of a star of
    /// absolute magnitude 0.
    fainter_light: Vec<[f64; 3]>,
}

impl LuminosityFunction {
    /// Returns the functions of all populations, in the order of [`Population::ALL`].
    pub fn all() -> [Self; POPULATIONS] {
        Population::ALL.map(Self::new)
    }

    fn new(population: Population) -> Self {
        let mut cumulative = vec![0.0];
        let mut evolved_share = Vec::with_capacity(STEPS);
        let mut total = 0.0;
        for step in 0..STEPS {
            let magnitude = BRIGHTEST + (step as f64 + 0.5) / STEPS_PER_MAG as f64;
            let (main_sequence, evolved) = stars_per_pc3_mag(population, magnitude);
            let both = main_sequence + evolved;
            total += both / STEPS_PER_MAG as f64;
            cumulative.push(total);
            evolved_share.push(if both > 0.0 { (evolved / both) as f32 } else { 0.0 });
        }
        let mut fainter_light = vec![[0.0; 3]; STEPS + 1];
        for step in (0..STEPS).rev() {
            let magnitude = BRIGHTEST + (step as f64 + 0.5) / STEPS_PER_MAG as f64;
            let light = (cumulative[step + 1] - cumulative[step]) * 10f64.powf(-0.4 * magnitude);
            let colour = mean_colour(population, magnitude, f64::from(evolved_share[step]));
            fainter_light[step] = [0, 1, 2].map(|c| fainter_light[step + 1][c] + light * colour[c]);
        }
        Self { population, cumulative, evolved_share, fainter_light }
    }

    /// Returns the stars per cubic parsec with an absolute magnitude below `magnitude` (any real number).
    #[inline]
    pub fn brighter_than(&self, magnitude: f64) -> f64 {
        let position = (magnitude - BRIGHTEST) * STEPS_PER_MAG as f64;
        if position <= 0.0 {
            return 0.0;
        }
        let step = position as usize;
        if step >= STEPS {
            return self.cumulative[STEPS];
        }
        let below = self.cumulative[step];
        below + (self.cumulative[step + 1] - below) * (position - step as f64)
    }

    /// Light of the stars with an absolute magnitude of at least `magnitude` (any real number), linear Rec. 709 per
    /// pc^3. A luminance of 1 is one star of absolute magnitude 0.
    #[inline]
    pub fn light_fainter_than(&self, magnitude: f64) -> [f64; 3] {
        let position = ((magnitude - BRIGHTEST) * STEPS_PER_MAG as f64).max(0.0);
        let step = position as usize;
        if step >= STEPS {
            return [0.0; 3];
        }
        let ([r, g, b], [to_r, to_g, to_b]) = (self.fainter_light[step], self.fainter_light[step + 1]);
        let share = position - step as f64;
        [r + (to_r - r) * share, g + (to_g - g) * share, b + (to_b - b) * share]
    }

    /// Inverse of [`brighter_than`](Self::brighter_than): the absolute magnitude with `stars_per_pc3` brighter stars.
    #[inline]
    pub fn magnitude_at(&self, stars_per_pc3: f64) -> f64 {
        let step = self.cumulative.partition_point(|&c| c <= stars_per_pc3).clamp(1, STEPS) - 1;
        let (below, above) = (self.cumulative[step], self.cumulative[step + 1]);
        let fraction = if above > below { ((stars_per_pc3 - below) / (above - below)).clamp(0.0, 1.0) } else { 0.0 };
        BRIGHTEST + (step as f64 + fraction) / STEPS_PER_MAG as f64
    }

    /// Draws the temperature in kelvin of a star of this population and absolute magnitude.
    pub fn draw_temperature_k(&self, magnitude: f64, rng: &mut impl Rng) -> f32 {
        let step = (((magnitude - BRIGHTEST) * STEPS_PER_MAG as f64) as usize).min(STEPS - 1);
        let choice: f32 = rng.random();
        let deviate: f64 = StandardNormal.sample(rng);
        let temperature_k = if choice < self.evolved_share[step] {
            hotter(self.population) * interpolate(&EVOLVED_K, magnitude) * (EVOLVED_SCATTER * deviate).exp()
        } else if magnitude < SUPERGIANTS_FROM && rng.random::<f64>() < SUPERGIANT_SHARE {
            SUPERGIANT_K.0 * (SUPERGIANT_K.1 / SUPERGIANT_K.0).powf(rng.random())
        } else {
            interpolate(&MAIN_SEQUENCE_K, magnitude) * (MAIN_SEQUENCE_SCATTER * deviate).exp()
        };
        temperature_k as f32
    }
}

/// Mean colour of the stars of a population at an absolute magnitude, linear Rec. 709 of luminance 1, without the
/// scatter of their temperatures.
fn mean_colour(population: Population, magnitude: f64, evolved_share: f64) -> [f64; 3] {
    let supergiants = if magnitude < SUPERGIANTS_FROM { (1.0 - evolved_share) * SUPERGIANT_SHARE } else { 0.0 };
    let mut sum = [0.0; 3];
    let mut add = |share: f64, temperature_k: f64| {
        let colour = rec709_in_gamut(temperature_k);
        sum.iter_mut().zip(colour).for_each(|(sum, c)| *sum += share * c);
    };
    add(evolved_share, hotter(population) * interpolate(&EVOLVED_K, magnitude));
    add(1.0 - evolved_share - supergiants, interpolate(&MAIN_SEQUENCE_K, magnitude));
    const PARTS: u32 = 5;
    for part in 0..PARTS {
        let fraction = (f64::from(part) + 0.5) / f64::from(PARTS);
        add(supergiants / f64::from(PARTS), SUPERGIANT_K.0 * (SUPERGIANT_K.1 / SUPERGIANT_K.0).powf(fraction));
    }
    sum
}

/// Factor for the temperature of a giant: giants with fewer metals are hotter.
fn hotter(population: Population) -> f64 {
    if matches!(population, Population::ThickDisc | Population::Halo) { 1.04 } else { 1.0 }
}

/// Numbers of main-sequence and of evolved stars of a population per cubic parsec and magnitude, at relative density 1.
fn stars_per_pc3_mag(population: Population, magnitude: f64) -> (f64, f64) {
    let main_sequence = 10f64.powf(interpolate(&MAIN_SEQUENCE, magnitude));
    let branch = if magnitude < RED_GIANT_BRANCH[0].0 || magnitude > RED_GIANT_BRANCH[RED_GIANT_BRANCH.len() - 1].0 {
        0.0
    } else {
        10f64.powf(interpolate(&RED_GIANT_BRANCH, magnitude))
    };
    let (stars, mean, deviation) = CLUMP;
    let clump =
        stars * (-0.5 * ((magnitude - mean) / deviation).powi(2)).exp() / (deviation * std::f64::consts::TAU.sqrt());
    let evolved = branch + clump;

    // The thin disc has three layers; stars pass gradually from one to the next with luminosity.
    let young = 1.0 - rise(1.0, 3.0, magnitude);
    let old = rise(3.0, 5.0, magnitude);
    // A population without young stars has a main sequence only below its turn-off.
    let below_turn_off = rise(3.3, 4.5, magnitude);
    match population {
        Population::YoungDisc => (main_sequence * young, 0.0),
        Population::IntermediateDisc => (main_sequence * (1.0 - young - old).max(0.0), 0.0),
        Population::OldDisc => (main_sequence * old, evolved),
        Population::ThickDisc => (THICK_DISC_SHARE * main_sequence * below_turn_off, THICK_DISC_SHARE * evolved),
        Population::Bulge => (main_sequence * below_turn_off, evolved),
        Population::Halo => (HALO_SHARE * main_sequence * below_turn_off, HALO_SHARE * evolved),
    }
}

/// Returns 0 below `from`, 1 above `to`, and interpolates linearly between them.
fn rise(from: f64, to: f64, x: f64) -> f64 {
    ((x - from) / (to - from)).clamp(0.0, 1.0)
}

/// Piecewise linear function through `points` (in ascending order), constant outside of them.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let above = points.partition_point(|p| p.0 <= x);
    if above == 0 {
        return points[0].1;
    }
    let Some(&(x1, y1)) = points.get(above) else { return points[above - 1].1 };
    let (x0, y0) = points[above - 1];
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_local_density_matches_the_nearby_stars() {
        // About 0.1 stars per cubic parsec near the Sun, of which one in some 300 is a giant with M_V < 3.
        let functions = LuminosityFunction::all();
        let all: f64 = functions
            .iter()
            .zip(Population::ALL)
            .filter(|(_, p)| *p != Population::Bulge)
            .map(|(f, _)| f.brighter_than(99.0))
            .sum();
        assert!((0.06..0.15).contains(&all), "{all} per pc^3");
        let giants: f64 =
            (0..220).map(|i| stars_per_pc3_mag(Population::OldDisc, -8.0 + 0.05 * f64::from(i)).1 * 0.05).sum();
        assert!((2e-4..8e-4).contains(&giants), "{giants} per pc^3");
    }

    #[test]
    fn the_layers_of_the_thin_disc_add_up() {
        for i in 0..270 {
            let magnitude = BRIGHTEST + 0.1 * f64::from(i);
            let sum: f64 = [Population::YoungDisc, Population::IntermediateDisc, Population::OldDisc]
                .iter()
                .map(|&p| stars_per_pc3_mag(p, magnitude).0)
                .sum();
            let expected = 10f64.powf(interpolate(&MAIN_SEQUENCE, magnitude));
            assert!((sum / expected - 1.0).abs() < 1e-12, "at {magnitude}");
        }
    }

    #[test]
    fn the_inverse_returns_the_magnitude() {
        for function in LuminosityFunction::all() {
            for i in 1..260 {
                let magnitude = BRIGHTEST + 0.1 * f64::from(i) + 0.013;
                let stars = function.brighter_than(magnitude);
                let back = function.magnitude_at(stars);
                // If there are no stars between them, several magnitudes have the same count.
                assert!((function.brighter_than(back) - stars).abs() <= 1e-12 * stars, "{magnitude} -> {back}");
            }
            assert_eq!(function.brighter_than(f64::NEG_INFINITY), 0.0);
            assert_eq!(function.brighter_than(99.0), function.brighter_than(f64::INFINITY));
        }
    }

    #[test]
    fn temperatures_follow_the_hertzsprung_russell_diagram() {
        let [young, _, old, ..] = LuminosityFunction::all();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut mean = |function: &LuminosityFunction, magnitude: f64| {
            (0..2000).map(|_| f64::from(function.draw_temperature_k(magnitude, &mut rng))).sum::<f64>() / 2000.0
        };
        let a0 = mean(&young, 0.6);
        assert!((9_500.0..11_500.0).contains(&a0), "Vega's luminosity: {a0} K");
        let sun = mean(&old, 4.83);
        assert!((5_500.0..6_000.0).contains(&sun), "the Sun's luminosity: {sun} K");
        let clump = mean(&old, 0.8);
        assert!((4_500.0..5_000.0).contains(&clump), "clump: {clump} K");
        let dwarf = mean(&old, 14.0);
        assert!((2_900.0..3_300.0).contains(&dwarf), "M dwarf: {dwarf} K");
    }
}
