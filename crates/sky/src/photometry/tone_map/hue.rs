//! Preservation of the hue of light that is outside the display's range.
//!
//! An operator that clips or bends each channel separately turns bright orange into yellow and bright blue into cyan.
//! This step moves the colour straight towards white instead, only as far as the display's range requires, at the
//! luminance that the operator gives it. In the chromaticity diagram (x, y or u', v') this is the line from the
//! colour to white: the dominant wavelength is kept, the purity falls. Brighter light is whiter, until it is white at
//! the display's peak.

use super::luminance;

/// Returns the colour of luminance `y` (0 to 1) with the hue of linear `rgb` (no channel below 0). It keeps its
/// saturation unless a channel would exceed 1. Black has no hue and stays black.
pub fn at_luminance(rgb: [f64; 3], y: f64) -> [f64; 3] {
    let own = luminance(rgb);
    if own <= 0.0 || y <= 0.0 {
        return [0.0; 3];
    }
    let of_unit_luminance = rgb.map(|channel| channel / own);
    let most = of_unit_luminance.into_iter().fold(0.0, f64::max);
    let purity = if y * most > 1.0 { ((1.0 / y - 1.0) / (most - 1.0)).clamp(0.0, 1.0) } else { 1.0 };
    of_unit_luminance.map(|channel| y * (1.0 + purity * (channel - 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::rec709::uv_prime;

    /// Hue angle of a colour around white in u', v', rad.
    fn hue_rad(rgb: [f64; 3]) -> f64 {
        let ([u, v], [white_u, white_v]) = (uv_prime(rgb), uv_prime([1.0; 3]));
        (v - white_v).atan2(u - white_u)
    }

    #[test]
    fn hue_and_luminance_are_kept_within_the_displays_range() {
        for rgb in [[3.0, 0.9, 0.1], [0.1, 0.2, 5.0], [0.0, 2.0, 0.3], [4.0, 0.0, 4.0], [0.2, 0.1, 0.0]] {
            for y in [1e-6, 0.01, 0.2, 0.5, 0.9, 0.999] {
                let mapped = at_luminance(rgb, y);
                assert!(
                    mapped.iter().all(|channel| (0.0..=1.0 + 1e-12).contains(channel)),
                    "{rgb:?} at {y}: {mapped:?}"
                );
                // The luminance weights are rounded, but the matrices behind u', v' are not: white differs by 4e-5.
                assert!((hue_rad(mapped) - hue_rad(rgb)).abs() < 1e-3, "{rgb:?} at {y}: {mapped:?}");
                assert!((luminance(mapped) / y - 1.0).abs() < 1e-12);
            }
            assert_eq!(at_luminance(rgb, 1.0), [1.0; 3], "the brightest is white");
        }
        assert_eq!(at_luminance([0.0; 3], 0.5), [0.0; 3]);
        assert_eq!(at_luminance([1.0, 0.5, 0.2], 0.0), [0.0; 3]);
    }

    #[test]
    fn colours_within_the_displays_range_are_unchanged() {
        let rgb = [0.9, 0.4, 0.1];
        for (mapped, original) in at_luminance(rgb, luminance(rgb)).into_iter().zip(rgb) {
            assert!((mapped - original).abs() < 1e-15);
        }
        // The same colour, half as bright again: red reaches its limit, and the other channels compensate.
        let mapped = at_luminance(rgb, 1.5 * luminance(rgb));
        assert!((mapped[0] - 1.0).abs() < 1e-12 && mapped[1] > 0.6 && mapped[2] > 0.15, "{mapped:?}");
    }

    #[test]
    fn clipping_each_channel_changes_the_hue() {
        let turned = |rgb: [f64; 3]| (hue_rad(rgb.map(|channel| channel.min(1.0))) - hue_rad(rgb)).abs();
        assert!(turned([10.0, 3.0, 0.3]) > 0.3, "orange to yellow: {}", turned([10.0, 3.0, 0.3]));
        assert!(turned([0.2, 2.0, 9.0]) > 0.3, "blue to cyan: {}", turned([0.2, 2.0, 9.0]));
    }
}
