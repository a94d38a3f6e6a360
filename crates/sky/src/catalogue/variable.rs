//! Variable stars of the built-in table with an ephemeris: their apparent V magnitude follows from epoch, period and an idealised light curve.
//!
//! Elements: General Catalogue of Variable Stars 5.1 (Samus et al. 2017), except
//! - Algol: a linear fit to the minima that K. Nagai published in the Variable Star Bulletin of VSOLJ, 2008 to 2015; the elements of the General
//!   Catalogue, from 1983, are four hours early in 2022;
//! - beta Lyrae, whose period grows by 19 s per year: Rucinski et al. 2019 (AJ 156, 12), valid for decades around 2018;
//! - the range of Mira variables, which differs from one period to the next: mean maxima and minima (Campbell 1955, *Studies of Long Period
//!   Variables*, AAVSO).
//!
//! Irregular and semiregular variables (R CrB, Betelgeuse) have no ephemeris and keep the brightness of the table. Times are heliocentric: they
//! differ by up to 8.3 minutes from those of an observer on the Earth.

use std::f64::consts::{PI, TAU};

use crate::units::{DAY_S, J2000_JD, JULIAN_YEAR_S};

/// Magnitudes are rounded to multiples of this step, so that stars are updated only after a visible change.
const STEP_MAG: f64 = 0.02;

/// Shape of a light curve as a function of phase, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightCurve {
    /// Constant light with two eclipses, each of which lasts for a share of the period (types EA). The magnitude follows a raised cosine to the power
    /// of 1.5, which is within 0.1 mag of Algol's curve (Stebbins 1910, ApJ 32, 185).
    Eclipses {
        /// Magnitude in the middle of the secondary eclipse, at half the period.
        secondary: f64,
        /// Length of an eclipse as a share of the period.
        share: f64,
    },
    /// Continuously varying light: the square of the cosine of the phase angle (types EB).
    Ellipsoids {
        /// Magnitude at the secondary minimum, at half the period.
        secondary: f64,
    },
    /// A cosine whose rise and fall take different shares of the period (Cepheids and Mira variables).
    Pulse {
        /// Share of the period from minimum to maximum.
        rise: f64,
    },
}

/// A variable star with an ephemeris.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VariableStar {
    /// Number in the Bright Star Catalogue.
    pub hr: u16,
    /// V magnitude at maximum and at the (primary) minimum.
    pub range: [f64; 2],
    /// Julian date of a maximum for [`LightCurve::Pulse`], otherwise of a primary minimum.
    pub epoch_jd: f64,
    /// Period, days.
    pub period_d: f64,
    /// Shape of the curve.
    pub curve: LightCurve,
}

const fn variable(hr: u16, range: [f64; 2], epoch_jd: f64, period_d: f64, curve: LightCurve) -> VariableStar {
    VariableStar { hr, range, epoch_jd, period_d, curve }
}

/// Number of variable stars with an ephemeris.
pub const COUNT: usize = 10;

/// The variable stars with an ephemeris.
pub const VARIABLE_STARS: [VariableStar; COUNT] = {
    use LightCurve::{Eclipses, Ellipsoids, Pulse};
    [
        // Algol.
        variable(936, [2.12, 3.39], 2_445_641.492, 2.867_342, Eclipses { secondary: 2.18, share: 0.14 }),
        // Lambda Tauri.
        variable(1239, [3.37, 3.91], 2_421_506.850_6, 3.952_947_8, Eclipses { secondary: 3.54, share: 0.15 }),
        // Sheliak, beta Lyrae.
        variable(7106, [3.25, 4.36], 2_458_347.011_9, 12.943_79, Ellipsoids { secondary: 3.85 }),
        // Delta Cephei.
        variable(8571, [3.48, 4.37], 2_455_479.905, 5.366_208, Pulse { rise: 0.25 }),
        // Eta Aquilae.
        variable(7570, [3.48, 4.33], 2_450_323.31, 7.176_915, Pulse { rise: 0.32 }),
        // Mekbuda, zeta Geminorum.
        variable(2650, [3.62, 4.18], 2_443_805.927, 10.150_73, Pulse { rise: 0.5 }),
        // Mira.
        variable(681, [3.4, 9.3], 2_444_839.0, 331.96, Pulse { rise: 0.38 }),
        // Chi Cygni.
        variable(7564, [5.2, 13.4], 2_442_140.0, 408.05, Pulse { rise: 0.41 }),
        // R Leonis.
        variable(3882, [5.8, 10.0], 2_444_164.0, 309.95, Pulse { rise: 0.43 }),
        // R Aquilae.
        variable(7243, [6.1, 11.5], 2_455_337.0, 269.84, Pulse { rise: 0.43 }),
    ]
};

impl VariableStar {
    /// Apparent V magnitude at a Julian date.
    pub fn magnitude(&self, jd: f64) -> f64 {
        let phase = ((jd - self.epoch_jd) / self.period_d).rem_euclid(1.0);
        let [maximum, minimum] = self.range;
        // Distance of a phase from the nearest whole phase.
        let from_whole = |phase: f64| phase.min(1.0 - phase);
        match self.curve {
            LightCurve::Eclipses { secondary, share } => {
                let dip = |phase: f64, depth: f64| {
                    let of_half = 2.0 * from_whole(phase) / share;
                    if of_half < 1.0 { depth * (0.5 * (1.0 + (PI * of_half).cos())).powf(1.5) } else { 0.0 }
                };
                maximum + dip(phase, minimum - maximum) + dip((phase + 0.5).fract(), secondary - maximum)
            }
            LightCurve::Ellipsoids { secondary } => {
                let cosine = (TAU * phase).cos();
                maximum + cosine * cosine * (if cosine > 0.0 { minimum } else { secondary } - maximum)
            }
            LightCurve::Pulse { rise } => {
                let fall = 1.0 - rise;
                let angle = if phase < fall { phase / fall } else { (1.0 - phase) / rise };
                maximum + 0.5 * (minimum - maximum) * (1.0 - (PI * angle).cos())
            }
        }
    }
}

/// Apparent V magnitudes of all variable stars, in steps of 0.02, at a time in Julian years after J2000.0.
pub fn magnitudes(years: f64) -> [f64; COUNT] {
    steps(years).map(|step| f64::from(step) * STEP_MAG)
}

/// The same magnitudes in units of the step; the result changes only if a magnitude changes.
pub fn steps(years: f64) -> [i16; COUNT] {
    let jd = J2000_JD + years * (JULIAN_YEAR_S / DAY_S);
    VARIABLE_STARS.map(|star| (star.magnitude(jd) / STEP_MAG).round() as i16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star(hr: u16) -> VariableStar {
        VARIABLE_STARS.into_iter().find(|star| star.hr == hr).unwrap_or_else(|| panic!("HR {hr} is missing"))
    }

    /// Julian date of the faintest or brightest moment within half a period of `jd`.
    fn extreme(star: &VariableStar, jd: f64, sign: f64) -> f64 {
        let places = (-50_000..=50_000).map(|step| jd + star.period_d * f64::from(step) / 100_000.0);
        let key = |jd: &f64| sign * star.magnitude(*jd);
        places.min_by(|a, b| key(a).total_cmp(&key(b))).unwrap_or(jd)
    }

    #[test]
    fn algol_is_faintest_when_observers_were_told() {
        let algol = star(936);
        // Minima in UTC: from the calculator of Sky & Telescope (2022-09-18 01:31), and from Imako's table, which was made from the same fit
        // (2016-01-24 10:17 and 2016-12-13 10:31). The position of the Earth in its orbit accounts for up to 8.3 minutes.
        for published_jd in [2_459_840.563_2, 2_457_411.928_5, 2_457_735.938_2] {
            let off_min = (extreme(&algol, published_jd, -1.0) - published_jd) * 1440.0;
            assert!(off_min.abs() < 15.0, "{published_jd}: {off_min} min");
            assert!((algol.magnitude(published_jd) - 3.39).abs() < 0.02);
        }
        // The elements from 1983 are wrong by hours for the eclipse in 2022.
        let of_1983 = VariableStar { epoch_jd: 2_445_641.513_5, period_d: 2.867_304_3, ..algol };
        let off_h = (extreme(&of_1983, 2_459_840.563_2, -1.0) - 2_459_840.563_2) * 24.0;
        assert!(off_h < -3.0, "{off_h} h");
    }

    #[test]
    fn algol_s_eclipse_has_the_measured_shape() {
        let algol = star(936);
        // Hours from the minimum, and increase in magnitude relative to the light outside the eclipse, in units of the depth; from Stebbins 1910.
        for (hours, depth) in
            [(0.0, 1.0), (0.5, 0.95), (1.0, 0.817), (1.5, 0.649), (2.0, 0.498), (3.0, 0.248), (4.9, 0.0)]
        {
            let found = (algol.magnitude(algol.epoch_jd + hours / 24.0) - 2.12) / 1.27;
            assert!((found - depth).abs() < 0.1 / 1.27, "{hours} h: {found}, not {depth}");
        }
        assert_eq!(algol.magnitude(algol.epoch_jd + 0.2 * algol.period_d), 2.12);
        assert!((algol.magnitude(algol.epoch_jd + 0.5 * algol.period_d) - 2.18).abs() < 1e-9);
    }

    #[test]
    fn every_star_has_its_published_range_and_the_rise_of_its_type() {
        for star in VARIABLE_STARS {
            let [maximum, minimum] = star.range;
            let [brightest, faintest] = [1.0, -1.0].map(|sign| extreme(&star, 2_460_000.0, sign));
            assert!((star.magnitude(brightest) - maximum).abs() < 1e-4, "HR {}", star.hr);
            assert!((star.magnitude(faintest) - minimum).abs() < 1e-4, "HR {}", star.hr);
            for jd in [brightest, faintest] {
                let after = star.magnitude(jd + star.period_d);
                assert!((after - star.magnitude(jd)).abs() < 1e-6, "HR {}: one period later", star.hr);
            }
        }
        // Delta Cephei, 3.48 to 4.37, rises in a quarter of its period.
        let cepheid = star(8571);
        let rise_d = (cepheid.epoch_jd - extreme(&cepheid, cepheid.epoch_jd - 1.3, -1.0)).rem_euclid(cepheid.period_d);
        assert!((rise_d / 5.366 - 0.25).abs() < 1e-3, "{rise_d}");
        // Beta Lyrae has unequal minima.
        let sheliak = star(7106);
        for (phase, magnitude) in [(0.0, 4.36), (0.25, 3.25), (0.5, 3.85), (0.75, 3.25)] {
            let found = sheliak.magnitude(sheliak.epoch_jd + phase * sheliak.period_d);
            assert!((found - magnitude).abs() < 1e-6, "{phase}: {found}");
        }
    }

    #[test]
    fn steps_change_only_with_a_magnitude() {
        let day = DAY_S / JULIAN_YEAR_S;
        let years = (2_459_840.563_2 - J2000_JD) * day;
        assert!((169..=170).contains(&steps(years)[0]), "Algol in eclipse, 3.39: {}", steps(years)[0]);
        assert_eq!(steps(years), steps(years + 1e-5 * day));
        assert_eq!(steps(years + 0.4 * day)[0], 106, "2.12");
        for (exact, rounded) in VARIABLE_STARS.iter().zip(magnitudes(years)) {
            assert!((exact.magnitude(2_459_840.563_2) - rounded).abs() <= 0.5 * STEP_MAG + 1e-9);
        }
    }
}
