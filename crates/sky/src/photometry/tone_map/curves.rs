//! The curves of the tone-mapping operators. `x` is linear light over display white.
//!
//! - `srgb` and `calibrated` clip at white and apply the transfer curve of IEC 61966-2-1. They are exact below white;
//!   anything brighter is white.
//! - `filmic` rolls off highlights: the formula by Jim Hejl and Richard Burgess-Dawson (published by J. Hable,
//!   "Filmic tonemapping operators", 2010) that fits the film curve of H.-P. Duiker, "Filmic tonemapping for
//!   real-time rendering", SIGGRAPH 2010 courses. Per channel. **The fit includes the display's gamma of 2.2**: its
//!   result is already encoded and no transfer curve follows. One change: the published fit first subtracts 0.004,
//!   which turns everything below 0.4 % of white black. A sky is made of such stars, so nothing is subtracted here.
//! - `reinhard` rolls off the luminance so that a chosen one becomes white: equation 4 of E. Reinhard, M. Stark, P.
//!   Shirley and J. Ferwerda, "Photographic tone reproduction for digital images", SIGGRAPH 2002.
//! - `aces` is the rational fit of K. Narkowicz ("ACES filmic tone mapping curve", 2015) to the reference and output
//!   transforms of the Academy Color Encoding System. Per channel, linear.
//!
//! Display values (encoded) of grey; Reinhard's at white = 16, `calibrated` at display white = peak, black = 0:
//!
//! | luminance / white | 0.004 | 0.1 | 0.18 | 1 | 4 | 16 | 64 |
//! |---|---|---|---|---|---|---|---|
//! | `filmic` | 0.031 | 0.384 | 0.513 | 0.842 | 0.954 | 0.988 | 0.997 |
//! | `srgb`, `calibrated` | 0.051 | 0.349 | 0.461 | 1 | 1 | 1 | 1 |
//! | `reinhard` | 0.050 | 0.333 | 0.427 | 0.737 | 0.913 | 1 | 1 |
//! | `aces` | 0.015 | 0.390 | 0.553 | 0.908 | 0.988 | 1 | 1 |

/// The filmic curve: encoded display value of a channel over white, x (6.2 x + 0.5) / (x (6.2 x + 1.7) + 0.06). NaN
/// gives NaN, infinity gives 1.
pub fn filmic(x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    // Divided by x^2 to avoid infinity over infinity.
    (6.2 + 0.5 / x) / (6.2 + 1.7 / x + 0.06 / (x * x))
}

/// Factor of Reinhard's operator on a colour of luminance `y` over white, which maps `white` to 1: (1 + y / white^2)
/// / (1 + y). With infinite `white` the operator has no white point.
pub fn reinhard_scale(y: f64, white: f64) -> f64 {
    (1.0 + y / (white * white)) / (1.0 + y)
}

/// Narkowicz's fit: linear display light of a channel over white, x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14),
/// clipped at 1, which it reaches at 7.24. NaN gives NaN, infinity gives 1.
pub fn aces(x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    let value = (2.51 + 0.03 / x) / (2.43 + 0.59 / x + 0.14 / (x * x));
    if value > 1.0 { 1.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::tone_map::{linear_from_srgb, srgb_from_linear};

    #[test]
    fn curves_have_the_values_of_their_table() {
        let inputs = [0.004, 0.1, 0.18, 1.0, 4.0, 16.0, 64.0];
        let clipped = |x: f64| srgb_from_linear(x.min(1.0));
        let rolled = |x: f64| clipped(x * reinhard_scale(x, 16.0));
        for (name, values, table) in [
            ("filmic", inputs.map(filmic), [0.0315, 0.384, 0.513, 0.842, 0.954, 0.988, 0.997]),
            ("srgb", inputs.map(clipped), [0.0507, 0.349, 0.461, 1.0, 1.0, 1.0, 1.0]),
            ("reinhard", inputs.map(rolled), [0.0505, 0.3335, 0.427, 0.737, 0.913, 1.0, 1.0]),
            ("aces", inputs.map(|x| clipped(aces(x))), [0.0145, 0.390, 0.5535, 0.908, 0.988, 1.0, 1.0]),
        ] {
            for ((x, value), display) in inputs.into_iter().zip(values).zip(table) {
                assert!((value - display).abs() < 6e-4, "{name}({x}) = {value}");
            }
        }
    }

    #[test]
    fn curves_have_their_published_form() {
        for x in [0.003, 0.1, 0.9, 3.0, 7.0] {
            let published: f64 = x * (6.2 * x + 0.5) / (x * (6.2 * x + 1.7) + 0.06);
            assert!((filmic(x) - published).abs() < 1e-15);
            let published: f64 = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
            assert!((aces(x) - published).abs() < 1e-15);
            // Without a white point Reinhard's operator is x / (1 + x).
            assert!((x * reinhard_scale(x, f64::INFINITY) - x / (1.0 + x)).abs() < 1e-15);
        }
        assert!((16.0 * reinhard_scale(16.0, 16.0) - 1.0).abs() < 1e-15);
        assert!(aces(7.23) < 1.0 && aces(7.25) == 1.0);
    }

    #[test]
    fn filmic_is_already_encoded() {
        // If the result were linear light, it would be far too bright. Decoded with a gamma of 2.2, it is near the
        // input at middle grey.
        assert!((filmic(0.18).powf(2.2) / 0.18 - 1.0).abs() < 0.3);
        assert!(filmic(0.18) / 0.18 > 2.5);
        assert!(linear_from_srgb(filmic(0.18)) < 0.25);
    }
}
