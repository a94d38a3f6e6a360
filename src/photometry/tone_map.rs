//! Tone mapping in f64: from luminance over display white to display values from 0 to 1.
//!
//! Input is linear Rec. 709 divided by the luminance of display white (`exposure`): 1 is white, more is brighter than
//! the display. Output is encoded for the display: what an 8-bit image stores, divided by 255.
//!
//! - `srgb` clips at white and applies the transfer curve of IEC 61966-2-1. It is exact below white: the picture shows
//!   the light that is there, and anything brighter is white.
//! - `filmic` rolls highlights off: the formula by Jim Hejl and Richard Burgess-Dawson (given by J. Hable, "Filmic
//!   tonemapping operators", 2010) that fits the film curve of H.-P. Duiker, "Filmic tonemapping for real-time rendering",
//!   SIGGRAPH 2010 courses. Per channel. **The fit includes the display's gamma of 2.2**: its result is encoded already
//!   and no transfer curve follows. One change: the published fit first subtracts 0.004, which turns all that is below
//!   0.4 % of white black. A sky is made of such stars, so nothing is subtracted here.
//!
//!   | luminance / white | 0.004 | 0.1 | 0.18 | 1 | 4 | 16 | 64 |
//!   |---|---|---|---|---|---|---|---|
//!   | display value | 0.031 | 0.384 | 0.513 | 0.842 | 0.954 | 0.988 | 0.997 |

use serde::{Deserialize, Serialize};

pub use super::rec709::luminance;

/// Display value of linear `value`: the sRGB transfer curve (IEC 61966-2-1). Not clipped; NaN gives NaN.
pub fn srgb_from_linear(value: f64) -> f64 {
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// Linear value of display `value`: the inverse of [`srgb_from_linear`], with the standard's own threshold.
pub fn linear_from_srgb(value: f64) -> f64 {
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// The filmic curve: display value, encoded, of a channel over white, x (6.2 x + 0.5) / (x (6.2 x + 1.7) + 0.06). NaN
/// gives NaN, infinity gives 1.
pub fn filmic(x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    // Divided by x^2, so that infinity over infinity does not arise.
    (6.2 + 0.5 / x) / (6.2 + 1.7 / x + 0.06 / (x * x))
}

/// A tone-mapping operator: how a channel over white becomes a display value.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToneMapOperator {
    /// Film-like roll-off of highlights: [`filmic`].
    #[default]
    Filmic,
    /// Clip at white, then [`srgb_from_linear`].
    Srgb,
}

impl ToneMapOperator {
    /// Every operator.
    pub const ALL: [Self; 2] = [Self::Filmic, Self::Srgb];

    /// Name in configurations and manifests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Filmic => "filmic",
            Self::Srgb => "srgb",
        }
    }

    /// Display RGB, encoded, each from 0 to 1, of linear Rec. 709 `rgb` in cd/m^2 where `white_cd_m2` is display white.
    /// Infinity gives 1, NaN gives NaN.
    pub fn display_rgb(self, rgb: [f64; 3], white_cd_m2: f64) -> [f64; 3] {
        rgb.map(|channel| {
            let value = channel / white_cd_m2;
            match self {
                Self::Filmic => filmic(value),
                Self::Srgb => srgb_from_linear(value.clamp(0.0, 1.0)),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_has_the_values_of_the_standard() {
        assert_eq!(srgb_from_linear(0.0), 0.0);
        assert!((srgb_from_linear(1.0) - 1.0).abs() < 1e-15);
        // Code 188 of 255 is half of white to the nearest code; 0.18 is 0.4614 (118).
        assert_eq!((255.0 * srgb_from_linear(0.5)).round(), 188.0);
        assert!((srgb_from_linear(0.18) - 0.461_356).abs() < 1e-6);
        assert!((linear_from_srgb(128.0 / 255.0) - 0.215_861).abs() < 1e-6);
        assert!((srgb_from_linear(0.001) - 0.012_92).abs() < 1e-15);
    }

    #[test]
    fn srgb_and_its_inverse_agree_and_eight_bit_codes_survive() {
        for code in 0..=255 {
            let value = f64::from(code) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(value)) - value).abs() < 1e-12, "code {code}");
        }
        // The two thresholds are rounded independently: at the joint the curves miss each other by 3e-8, no more.
        assert!((srgb_from_linear(0.003_130_8) - srgb_from_linear(0.003_130_800_001)).abs() < 5e-8);
    }

    #[test]
    fn filmic_has_the_form_and_the_values_of_its_table() {
        let table =
            [(0.004, 0.0315), (0.1, 0.384), (0.18, 0.513), (1.0, 0.842), (4.0, 0.954), (16.0, 0.988), (64.0, 0.997)];
        for (x, display) in table {
            let published: f64 = x * (6.2 * x + 0.5) / (x * (6.2 * x + 1.7) + 0.06);
            assert!((filmic(x) - published).abs() < 1e-15);
            assert!((filmic(x) - display).abs() < 6e-4, "filmic({x}) = {}", filmic(x));
        }
    }

    #[test]
    fn filmic_is_already_encoded() {
        // Read as linear light it would be far too bright; decoded with 2.2 it is near the input at middle grey.
        assert!((filmic(0.18).powf(2.2) / 0.18 - 1.0).abs() < 0.3);
        assert!(filmic(0.18) / 0.18 > 2.5);
    }

    #[test]
    fn operators_rise_from_black_to_one_and_never_leave_the_range() {
        for operator in ToneMapOperator::ALL {
            let show = |value: f64| operator.display_rgb([value; 3], 4.0)[0];
            let mut previous = show(0.0);
            assert_eq!(previous, 0.0);
            for step in -400..400 {
                let shown = show(10f64.powf(f64::from(step) / 40.0));
                assert!((previous..=1.0).contains(&shown), "{operator:?} {step}: {previous} to {shown}");
                previous = shown;
            }
            assert!((show(f64::INFINITY) - 1.0).abs() < 1e-15);
            assert_eq!(show(-1.0), 0.0);
            assert!(show(f64::NAN).is_nan());
        }
    }

    #[test]
    fn display_white_is_white_for_srgb_and_leaves_room_for_filmic() {
        let clipped = ToneMapOperator::Srgb.display_rgb([0.15, 0.075, 0.3], 0.15);
        for (shown, expected) in clipped.into_iter().zip([1.0, srgb_from_linear(0.5), 1.0]) {
            assert!((shown - expected).abs() < 1e-15, "{clipped:?}");
        }
        let [red, green, blue] = ToneMapOperator::Filmic.display_rgb([0.15, 0.075, 0.3], 0.15);
        assert!(green < red && red < blue && blue < 0.95, "{red} {green} {blue}");
    }
}
