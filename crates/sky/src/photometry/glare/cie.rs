//! The general disability glare of CIE 135/1: light scattered in an eye, from 0.1 to 100 degrees off the source, by
//! age and iris colour.
//!
//! ```text
//! 10 / t^3 + (5 / t^2 + 0.1 p / t) (1 + (A / 62.5)^4) + 0.0025 p   per sr, t in degrees, A in years
//! ```
//!
//! Below 0.1 degree, or the inner angle if that is larger, it is constant; above 100 degrees the formula is
//! extrapolated. It is absolute: its integral is the share of the light that the eye scatters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::normalised::{Normalised, Shape};

/// Smallest angle for which the formula is valid, degrees.
const VALID_FROM_DEG: f64 = 0.1;

/// Colour of the iris: light that passes through it adds to the glare.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EyeColour {
    /// Black iris.
    Black,
    /// Brown iris.
    #[default]
    Brown,
    /// Light iris.
    Light,
    /// Very light iris.
    VeryLight,
}

impl EyeColour {
    /// The factor p of the formula.
    pub fn pigmentation(self) -> f64 {
        match self {
            Self::Black => 0.0,
            Self::Brown => 0.5,
            Self::Light => 1.0,
            Self::VeryLight => 1.2,
        }
    }
}

/// Glare of CIE 135/1 for one eye; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cie {
    inner_rad: f64,
    /// 1 + (A / 62.5)^4.
    age_factor: f64,
    pigmentation: f64,
}

impl Cie {
    /// The glare of an eye of an age in years; constant within `inner_rad`, at most pi.
    pub fn new(inner_rad: f64, age_years: f64, eye: EyeColour) -> Self {
        Self {
            inner_rad: inner_rad.max(VALID_FROM_DEG.to_radians()),
            age_factor: 1.0 + (age_years / 62.5).powi(4),
            pigmentation: eye.pigmentation(),
        }
    }

    /// Share of the light that the eye scatters, over the whole sphere.
    pub fn scattered_share(self) -> f64 {
        Normalised::new(self).map_or(0.0, |kernel| kernel.integral())
    }
}

impl Shape for Cie {
    fn relative(&self, angle_rad: f64) -> f64 {
        let t = angle_rad.max(self.inner_rad).to_degrees();
        10.0 / t.powi(3) + (5.0 / (t * t) + 0.1 * self.pigmentation / t) * self.age_factor + 0.0025 * self.pigmentation
    }

    fn inner_rad(&self) -> f64 {
        self.inner_rad
    }

    fn kinks_rad(&self) -> Vec<f64> {
        vec![self.inner_rad]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::glare::{GlareKernel, normalised::tests::shares_are_integrals_of_the_density};

    fn between(age_years: f64, eye: EyeColour, from_deg: f64, to_deg: f64) -> f64 {
        let kernel = Normalised::new(Cie::new(0.1_f64.to_radians(), age_years, eye)).unwrap();
        (kernel.share_within(to_deg.to_radians()) - kernel.share_within(from_deg.to_radians())) * kernel.integral()
    }

    #[test]
    fn an_eye_at_age_35_scatters_28_per_cent_of_the_light() {
        let share = between(35.0, EyeColour::Brown, 0.1, 100.0);
        assert!((share - 0.28).abs() < 0.005, "{share}");
        // An old eye scatters more.
        assert!((between(80.0, EyeColour::Brown, 0.1, 100.0) - 0.28).abs() > 0.1);
    }

    #[test]
    fn the_formula_at_known_angles() {
        let eye = |colour| Cie::new(1e-9, 62.5, colour);
        let value = |cie: Cie, deg: f64| cie.relative(deg.to_radians());
        // By hand: 10 + 5 * 2, 10 / 1000 + 2 (0.05 + 0.005) + 0.00125, 10 / 8 + 2 * 1.25 + ...
        assert!((value(eye(EyeColour::Black), 1.0) - 20.0).abs() < 1e-12);
        assert!((value(eye(EyeColour::Brown), 10.0) - 0.12125).abs() < 1e-12);
        assert!((value(eye(EyeColour::Light), 2.0) - (1.25 + 2.5 + 0.1 + 0.0025)).abs() < 1e-12);
        assert!((value(eye(EyeColour::VeryLight), 100.0) - (1e-5 + 1e-3 + 0.0024 + 0.003)).abs() < 1e-12);
        // Constant below the formula's range, and within a larger inner angle.
        assert_eq!(value(eye(EyeColour::Brown), 0.0), value(eye(EyeColour::Brown), 0.1));
        let wide = Cie::new(5.0_f64.to_radians(), 35.0, EyeColour::Brown);
        assert_eq!((value(wide, 1.0), wide.inner_rad()), (value(wide, 5.0), 5.0_f64.to_radians()));
    }

    #[test]
    fn the_integral_over_the_sphere_is_one() {
        for age_years in [0.0, 35.0, 100.0] {
            let kernel = Normalised::new(Cie::new(0.1_f64.to_radians(), age_years, EyeColour::Brown)).unwrap();
            shares_are_integrals_of_the_density(&kernel);
        }
    }
}
