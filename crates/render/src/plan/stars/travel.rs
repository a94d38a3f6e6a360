//! Effect of motion on the light of stars: bounds per chunk, and the light of single stars.
//!
//! The factor on a star's light depends on its temperature and its Doppler factor only (`crate::relativity`). The 2048 possible temperatures of stars
//! are a geometric progression, so a Doppler factor corresponds to a number of steps. One table, the logarithm of luminance by step, is therefore
//! sufficient for every speed. The shader reads the same table.

use std::sync::LazyLock;

use super::cull::VisibleChunk;
use crate::plan::{certificate::Approximation, settings::AccuracySettings};
use crate::{
    catalogue::{
        chunks::StarSet,
        packed::{MAX_TEMPERATURE_K, MIN_TEMPERATURE_K, TEMPERATURE_STEPS, temperature_of_step_k},
        spectra::Spectrum,
    },
    photometry::blackbody::Blackbody,
    relativity::{MAX_SPEED_C, Motion, doppler_factor},
};

/// Steps of the table below and above the temperatures of stars; [`MAX_SPEED_C`] needs 1914 of them.
pub const SHIFTED_STEPS: u32 = 1920;
/// Entries of the table.
pub const TABLE_STEPS: usize = (TEMPERATURE_STEPS + 2 * SHIFTED_STEPS) as usize;
/// Margin for the table's interpolation and the shader's arithmetic: more than [`TABLE_ERROR`].
const SLACK: f64 = 1.0 + 2e-3;
/// Bound of the relative error of a star's light, from interpolation in the table and f32 arithmetic.
pub const TABLE_ERROR: f64 = 2e-4;

/// Temperature steps per unit of the natural logarithm.
pub fn steps_per_e_fold() -> f64 {
    f64::from(TEMPERATURE_STEPS - 1) / (MAX_TEMPERATURE_K / MIN_TEMPERATURE_K).ln()
}

/// Temperature of a step, K. The step may be fractional; the first step is -[`SHIFTED_STEPS`].
fn temperature_of_shifted_step_k(step: f64) -> f64 {
    MIN_TEMPERATURE_K * (step / steps_per_e_fold()).exp()
}

/// Black bodies at every step from -[`SHIFTED_STEPS`].
struct Table {
    /// Colours with Y = 1, linear Rec. 709.
    colours: Vec<[f32; 3]>,
    /// Logarithms of the luminances, cd/m^2.
    ln_luminance: Vec<f64>,
    /// Step above which a blue shift reduces the light (near 16000 K).
    turning: f64,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let black_body = |index: usize| {
        let step = index as i64 - i64::from(SHIFTED_STEPS);
        // Use the stored colours for the temperatures of stars.
        let kelvin = u32::try_from(step)
            .ok()
            .filter(|step| *step < TEMPERATURE_STEPS)
            .map_or_else(|| temperature_of_shifted_step_k(step as f64), temperature_of_step_k);
        let Blackbody { colour, ln_luminance } = Blackbody::new(kelvin);
        (colour.map(|channel| channel as f32), ln_luminance)
    };
    let (colours, ln_luminance): (Vec<_>, Vec<_>) = (0..TABLE_STEPS).map(black_body).unzip();
    // Light in motion is proportional to exp(ln Y - 2 ln T) along the table.
    let light = |index: usize| ln_luminance[index] - 2.0 * index as f64 / steps_per_e_fold();
    let turning = (0..TABLE_STEPS).max_by(|a, b| light(*a).total_cmp(&light(*b)));
    let turning = turning.map_or(0.0, |index| index as f64 - f64::from(SHIFTED_STEPS));
    Table { colours, ln_luminance, turning }
});

/// Index of a step in the table; beyond the table, that of its end.
fn index_of(step: i32) -> usize {
    (step + SHIFTED_STEPS as i32).clamp(0, TABLE_STEPS as i32 - 1) as usize
}

/// Colour with Y = 1 of a step, linear Rec. 709; the first step is -[`SHIFTED_STEPS`]. Beyond the table, the colour at its end.
pub fn colour_of_step(step: i32) -> [f32; 3] {
    TABLE.colours[index_of(step)]
}

/// Logarithm of the luminance of a black body at a step, cd/m^2; the first step is -[`SHIFTED_STEPS`]. Beyond the table, the value at its end.
pub fn ln_luminance_of_step(step: i32) -> f64 {
    TABLE.ln_luminance[index_of(step)]
}

/// Colour with Y = 1 of a star's temperature step, shifted by a Doppler factor.
pub fn colour_of(step: u32, doppler: f64) -> [f32; 3] {
    colour_of_step(step as i32 + (doppler.ln() * steps_per_e_fold()).round() as i32)
}

/// Logarithm of the luminance at a step, interpolated linearly; the first step is -[`SHIFTED_STEPS`]. Beyond the table, the value at its end.
fn ln_luminance_at(step: f64) -> f64 {
    let table = &TABLE.ln_luminance;
    let place = (step + f64::from(SHIFTED_STEPS)).clamp(0.0, (TABLE_STEPS - 1) as f64);
    let below = (place as usize).min(TABLE_STEPS - 2);
    table[below] + (place - below as f64) * (table[below + 1] - table[below])
}

/// Factor on a star's light, from its temperature step and the Doppler factor.
pub fn light_factor(step: u32, doppler: f64) -> f64 {
    let step = f64::from(step);
    let e_folds = doppler.ln();
    (ln_luminance_at(step + e_folds * steps_per_e_fold()) - ln_luminance_at(step) - 2.0 * e_folds).exp()
}

/// The greatest factor for stars between two temperature steps and two Doppler factors.
pub fn greatest_factor(steps: [u32; 2], dopplers: [f64; 2]) -> f64 {
    // For a Doppler factor above 1 the coolest star gains the most light; below 1 the hottest star loses the least. In both cases, light increases
    // with the Doppler factor up to the turning point and decreases beyond it.
    let greatest_at = |step: u32| {
        let turning = ((TABLE.turning - f64::from(step)) / steps_per_e_fold()).exp();
        [dopplers[0], dopplers[1], turning.clamp(dopplers[0], dopplers[1])]
            .map(|doppler| light_factor(step, doppler))
            .into_iter()
            .fold(0.0, f64::max)
    };
    greatest_at(steps[0]).max(greatest_at(steps[1])) * SLACK
}

/// Bounds of the light of a chunk for a moving camera, relative to one at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boost {
    /// Bound for every single star.
    pub of_a_star: f64,
    /// Bound for all stars together.
    pub of_all: f64,
    /// Illuminance at 1 pc of the brightest star, boosted, lx.
    pub brightest_lx: f64,
}

/// Bounds for stars of a spectrum whose brightest star has `brightest_lx` at 1 pc, between two Doppler factors.
pub fn boost(spectrum: &Spectrum, brightest_lx: f64, dopplers: [f64; 2]) -> Boost {
    let mut bound = Boost { of_a_star: 0.0, of_all: 0.0, brightest_lx: 0.0 };
    let (mut light_lx, mut boosted_lx) = (0.0, 0.0);
    for (steps, lx) in spectrum.classes() {
        let factor = greatest_factor(steps, dopplers);
        bound.of_a_star = factor.max(bound.of_a_star);
        bound.brightest_lx = bound.brightest_lx.max(factor * lx.min(brightest_lx));
        light_lx += lx;
        boosted_lx += factor * lx;
    }
    bound.of_all = if light_lx > 0.0 { boosted_lx / light_lx } else { 0.0 };
    bound
}

/// Greatest error of a star's light that the discrete temperatures cause, relative to the light for the moving camera or for one at rest, whichever
/// is greater. It is computed for the coolest and the hottest star of the scene and all directions.
pub fn temperature_step_error(steps: [u32; 2], motion: &Motion) -> f64 {
    let half_step = 0.5 / steps_per_e_fold();
    let mut worst = 0.0_f64;
    for step in [steps[0], steps[1]] {
        for index in 0..=200 {
            let doppler = doppler_factor(motion.beta.min(MAX_SPEED_C), -1.0 + f64::from(index) / 100.0);
            let factor = light_factor(step, doppler);
            // Derivative of ln(factor) with respect to ln T.
            let slope =
                |step: f64| (ln_luminance_at(step + 1.0) - ln_luminance_at(step - 1.0)) / 2.0 * steps_per_e_fold();
            let shifted = f64::from(step) + doppler.ln() * steps_per_e_fold();
            let error = (slope(shifted) - slope(f64::from(step))).abs() * half_step;
            worst = worst.max(error * factor.min(1.0));
        }
    }
    worst
}

/// Approximations of a frame that shows `visible` with a moving camera.
pub fn certificate(
    set: &StarSet,
    visible: &[VisibleChunk],
    motion: &Motion,
    budget: &AccuracySettings,
) -> Vec<Approximation> {
    let spectra = set.spectra();
    let classes = visible.iter().flat_map(|chunk| spectra[chunk.chunk].classes());
    let Some(steps) = classes.map(|(steps, _)| steps).reduce(|[a, b], [c, d]: [u32; 2]| [a.min(c), b.max(d)]) else {
        return Vec::new();
    };
    vec![
        Approximation::new(
            "a star's light for a moving camera, from a table",
            TABLE_ERROR,
            "relative",
            Some(budget.flux),
        ),
        Approximation::new(
            "a star's light for a moving camera, from a temperature in 11 bits",
            temperature_step_error(steps, motion),
            "relative to the greater of its light for a moving camera and for one at rest",
            None,
        ),
        // Differences between directions behind the camera, including errors, are multiplied by the inverse of the Doppler factor.
        Approximation::new(
            "a star's direction for a moving camera, in f32",
            1e-6 / motion.doppler_behind(),
            "rad",
            None,
        ),
    ]
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::{
        catalogue::packed::{PackedStar, temperature_of_step_k},
        relativity::illuminance_factor,
    };

    #[test]
    fn the_table_covers_the_greatest_speed() {
        let greatest = Motion::new(DVec3::X * MAX_SPEED_C).unwrap().doppler_behind();
        let needed = -greatest.ln() * steps_per_e_fold();
        println!("steps needed at {MAX_SPEED_C} c: {needed:.1}");
        assert!(needed < f64::from(SHIFTED_STEPS) - 1.0);
        for step in [0, 1, 1000, 2047] {
            assert!((temperature_of_shifted_step_k(f64::from(step)) / temperature_of_step_k(step) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn factors_from_the_table_are_exact_within_the_bound() {
        let mut worst = 0.0_f64;
        for step in (0..TEMPERATURE_STEPS).step_by(61) {
            for power in -100..=100 {
                let doppler = 141.42_f64.powf(f64::from(power) / 100.0);
                let exact = illuminance_factor(temperature_of_step_k(step), doppler);
                let error = (light_factor(step, doppler) - exact).abs() / exact.max(1e-9);
                worst = worst.max(error);
            }
        }
        println!("light from the table against the exact one: {worst:.1e}");
        assert!(worst < TABLE_ERROR, "{worst}");
        // For a camera at rest, the light of a star is exactly unchanged.
        assert_eq!(light_factor(1000, 1.0), 1.0);
    }

    #[test]
    fn bounds_hold_for_every_star_and_direction() {
        for dopplers in [[0.007, 141.0], [0.2, 0.5], [0.9, 1.1], [1.5, 1.7], [3.0, 14.0], [1.0, 1.0]] {
            for steps in [[0, 63], [640, 703], [1000, 1000], [1984, 2047], [0, 2047]] {
                let bound = greatest_factor(steps, dopplers);
                let mut found = 0.0_f64;
                for step in (steps[0]..=steps[1]).step_by(31).chain([steps[1]]) {
                    for part in 0..=200 {
                        let doppler: f64 = dopplers[0] * (dopplers[1] / dopplers[0]).powf(f64::from(part) / 200.0);
                        found = found.max(illuminance_factor(temperature_of_step_k(step), doppler));
                    }
                }
                assert!(found <= bound, "{steps:?} {dopplers:?}: {found} above {bound}");
                assert!(found >= 0.99 * bound, "{steps:?} {dopplers:?}: {found} far below {bound}");
            }
        }
    }

    #[test]
    fn a_few_cool_stars_do_not_spoil_the_bound_of_the_others() {
        let star = |lx: f64, kelvin: f64| PackedStar::new(Vec3::X, lx, kelvin);
        let stars: Vec<PackedStar> = (0..99).map(|_| star(1.0, 6000.0)).chain([star(1e-6, 1000.0)]).collect();
        let dopplers = [7.0, 7.0];
        let exact: f64 =
            stars.iter().map(|s| s.illuminance_at_1_pc_lx() * light_factor(s.temperature_step(), 7.0)).sum();
        let bound = boost(&Spectrum::of(&stars), 1.0, dopplers);
        assert!(bound.of_all * 99.0 >= exact && bound.of_all * 99.0 < 1.5 * exact, "{bound:?} {exact}");
        assert!(bound.of_a_star >= illuminance_factor(1000.0, 7.0) && bound.of_a_star > 1e4);
        // The cool star is now the brightest.
        let brightest = 1e-6 * illuminance_factor(1000.0, 7.0);
        assert!(bound.brightest_lx > 0.99 * brightest && bound.brightest_lx < 2.0 * brightest, "{bound:?}");
        assert_eq!(boost(&Spectrum::default(), 1.0, dopplers).of_all, 0.0);
    }
}
