//! Brightness of the planets and the Moon against their phase, as measured: A. Mallama and J. L. Hilton, "Computing apparent planetary magnitudes for The Astronomical Almanac",
//! Astronomy and Computing 25, 10, 2018; the Moon by C. W. Allen, "Astrophysical Quantities", 3rd edition, section 66, with the opposition surge of K. Krisciunas and B. E. Schaefer,
//! Publications of the Astronomical Society of the Pacific 103, 1033, 1991.
//!
//! A curve gives V(1, a): the V magnitude at one astronomical unit from the Sun and from the eye, at the phase angle a. Surfaces reflect by a law of their own; what a curve does to a
//! body is one factor on its light for the phase angle at which it is seen, so that its light is that of the curve and its shading that of the law.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::reflection::ReflectionLaw;
use crate::units::ASTRONOMICAL_UNIT_M;

/// V magnitude of the Sun at one astronomical unit.
const SUN_V: f64 = -26.74;
/// Factors on the light stay within these: beyond the measured phases curves and laws part.
const FACTORS: [f64; 2] = [1e-3, 30.0];

/// How the light of a body follows its phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum PhaseCurve {
    /// As its reflection law and its geometric albedo have it.
    #[default]
    Law,
    /// To 170 degrees.
    Mercury,
    /// To 179 degrees.
    Venus,
    /// To 170 degrees.
    Earth,
    /// To 150 degrees.
    Moon,
    /// In the mean over its rotation and its year.
    Mars,
    /// To 130 degrees.
    Jupiter,
    /// The globe without rings, to 150 degrees.
    Saturn,
    /// To 154 degrees, seen from above its equator.
    Uranus,
    /// To 133 degrees, as bright as since 2000.
    Neptune,
}

fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

impl PhaseCurve {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Law,
        Self::Mercury,
        Self::Venus,
        Self::Earth,
        Self::Moon,
        Self::Mars,
        Self::Jupiter,
        Self::Saturn,
        Self::Uranus,
        Self::Neptune,
    ];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Law => "law",
            Self::Mercury => "mercury",
            Self::Venus => "venus",
            Self::Earth => "earth",
            Self::Moon => "moon",
            Self::Mars => "mars",
            Self::Jupiter => "jupiter",
            Self::Saturn => "saturn",
            Self::Uranus => "uranus",
            Self::Neptune => "neptune",
        }
    }

    /// The curve of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|curve| curve.name() == name)
    }

    /// Phase angles that the curve is known to, degrees.
    fn known_to_deg(self) -> f64 {
        match self {
            Self::Law => 180.0,
            Self::Venus => 179.0,
            Self::Mercury | Self::Earth => 170.0,
            Self::Uranus => 154.0,
            Self::Moon | Self::Saturn | Self::Mars => 150.0,
            Self::Neptune => 133.0,
            Self::Jupiter => 130.0,
        }
    }

    /// V(1, a) at a phase angle, degrees; beyond what is known, as at the border. `None` for the law's own.
    pub fn magnitude(self, phase_deg: f64) -> Option<f64> {
        let a = phase_deg.clamp(0.0, self.known_to_deg());
        let magnitude = match self {
            Self::Law => return None,
            Self::Mercury => {
                polynomial(&[-0.613, 6.328e-2, -1.6336e-3, 3.3644e-5, -3.4265e-7, 1.6893e-9, -3.0334e-12], a)
            }
            Self::Venus if a <= 163.7 => polynomial(&[-4.384, -1.044e-3, 3.687e-4, -2.814e-6, 8.938e-9], a),
            Self::Venus => polynomial(&[236.058_28, -2.819_14, 8.390_34e-3], a),
            Self::Earth => polynomial(&[-3.99, -1.060e-3, 2.054e-4], a),
            // -12.73 at 384,400 km; at full phase it is brighter by a third than the line has it.
            Self::Moon => {
                let surge = if a < 7.0 { -2.5 * (1.35 - 0.05 * a).log10() } else { 0.0 };
                let at_one = -12.73 + 5.0 * (ASTRONOMICAL_UNIT_M / 3.844e8).log10();
                at_one + 0.026 * a + 4e-9 * a.powi(4) + surge
            }
            Self::Mars if a <= 50.0 => polynomial(&[-1.601, 2.267e-2, -1.302e-4], a),
            Self::Mars => polynomial(&[-0.367, -2.573e-2, 3.445e-4], a),
            Self::Jupiter if a <= 12.0 => polynomial(&[-9.395, -3.7e-4, 6.16e-4], a),
            Self::Jupiter => {
                let share = polynomial(&[1.0, -1.507, -0.363, -0.062, 2.809, -1.876], a / 180.0);
                -9.428 - 2.5 * share.log10()
            }
            Self::Saturn if a <= 6.5 => polynomial(&[-8.95, -3.7e-4, 6.16e-4], a),
            Self::Saturn => polynomial(&[-8.94, 2.446e-4, 2.672e-4, -1.505e-6, 4.767e-9], a),
            Self::Uranus => polynomial(&[-7.110, 6.587e-3, 1.045e-4], a),
            Self::Neptune => polynomial(&[-7.00, 7.944e-3, 9.617e-5], a),
        };
        Some(magnitude)
    }

    /// Factor on the light of a sphere of `radius_m` with a law and the luminance of its geometric albedo, by which it is that of the curve.
    pub fn factor(self, law: ReflectionLaw, geometric_albedo: f64, radius_m: f64, phase_rad: f64) -> f64 {
        let phase_rad = phase_rad.min(self.known_to_deg().to_radians());
        let Some(magnitude) = self.magnitude(phase_rad.to_degrees()) else { return 1.0 };
        let of_law = geometric_albedo * (radius_m / ASTRONOMICAL_UNIT_M).powi(2) * law.phase_function(phase_rad);
        let of_curve = 10_f64.powf(-0.4 * (magnitude - SUN_V));
        let [least, most] = FACTORS;
        (of_curve / of_law).clamp(least, most)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_curves_and_a_law_changes_nothing() {
        for curve in PhaseCurve::ALL {
            assert_eq!(PhaseCurve::from_name(curve.name()), Some(curve));
        }
        assert_eq!(PhaseCurve::from_name("pluto"), None);
        assert_eq!(PhaseCurve::Law.factor(ReflectionLaw::Lambert, 0.3, 1e6, 1.0), 1.0);
    }

    #[test]
    fn the_light_is_that_of_the_curve_at_every_phase() {
        for curve in PhaseCurve::ALL.into_iter().filter(|curve| *curve != PhaseCurve::Law) {
            let (albedo, radius_m) = (0.3, 6e6);
            for phase_deg in [0.0, 1.0, 10.0, 45.0, 90.0, 120.0] {
                let phase_rad = f64::to_radians(phase_deg);
                for law in ReflectionLaw::ALL {
                    let of_law = albedo * (radius_m / ASTRONOMICAL_UNIT_M).powi(2) * law.phase_function(phase_rad);
                    let factor = curve.factor(law, albedo, radius_m, phase_rad);
                    let magnitude = SUN_V - 2.5 * (of_law * factor).log10();
                    let clamped = FACTORS.contains(&factor);
                    assert!(
                        clamped || (magnitude - curve.magnitude(phase_deg).unwrap()).abs() < 1e-9,
                        "{curve:?} {phase_deg}"
                    );
                }
            }
            assert!(curve.factor(ReflectionLaw::Lambert, albedo, radius_m, std::f64::consts::PI).is_finite());
        }
    }

    #[test]
    fn pieces_of_curves_meet() {
        for (curve, border_deg) in [
            (PhaseCurve::Venus, 163.7),
            (PhaseCurve::Mars, 50.0),
            (PhaseCurve::Jupiter, 12.0),
            (PhaseCurve::Saturn, 6.5),
            (PhaseCurve::Moon, 7.0),
        ] {
            let [before, after] = [-1e-6, 1e-6].map(|by| curve.magnitude(border_deg + by).unwrap());
            assert!((before - after).abs() < 0.05, "{curve:?} {before} {after}");
        }
    }
}
