//! Exposure: the luminance that is displayed as white.
//!
//! Exposure is given as EV100, the exposure value at ISO 100. It is a base-2 logarithm of luminance, so one step is a
//! factor of two. Two standards relate it to luminance:
//!
//! - a reflected-light meter calibrated to K = 12.5 cd s/(m^2 ISO) reads L = 2^EV100 * 12.5 / 100 from a scene of
//!   mean luminance L (ISO 2720);
//! - a saturation-based sensor of speed 100 clips at H = 78/100 lx s (ISO 12232), which behind a lens of 65 %
//!   transmission is L = 78 / (100 * 0.65) * 2^EV100 = 1.2 * 2^EV100: display white.
//!
//! A scene of uniform luminance is therefore displayed at 0.125 / 1.2 = 10.4 % of white: [`STANDARD_KEY`]. Another
//! share of white, the key, is equivalent to a compensation ([`key_compensation_ev`]).
//!
//! The mean of a night sky is not suitable: it is a thousandth of the luminance of the stars' pixels if the sky is
//! dark, and it changes with the catalogue. Its exposure is chosen so that stars of a certain magnitude are just
//! visible ([`limiting_ev100`]).
//!
//! Units: cd/m^2, EV100, lx, sr, magnitudes.

use super::kernel::BSPLINE_PEAK;

/// Luminance of display white at EV100 = 0, cd/m^2.
pub const WHITE_LUMINANCE_AT_EV0_CD_M2: f64 = 1.2;

/// Reflected-light meter calibration constant K, cd s/(m^2 ISO).
pub const METER_CALIBRATION: f64 = 12.5;

/// Share of display white at which the standards place the mean.
pub const STANDARD_KEY: f64 = METER_CALIBRATION / 100.0 / WHITE_LUMINANCE_AT_EV0_CD_M2;

/// Compensation to be added to the exposure value so that the mean is displayed at `key` of display white (above 0):
/// 0 for the standards' key, negative (brighter) for a higher one.
pub fn key_compensation_ev(key: f64) -> f64 {
    (STANDARD_KEY / key).log2()
}

/// Mean luminance of pixels, cd/m^2, weighted by solid angle; each pixel is given by its luminance and its solid angle,
/// sr. Pixels that are not finite are ignored; if none is left, the mean is 0.
pub fn mean_luminance_cd_m2(pixels: impl IntoIterator<Item = [f64; 2]>) -> f64 {
    let (mut light_lx, mut solid_angle_sr) = (0.0, 0.0);
    for [luminance_cd_m2, pixel_sr] in pixels {
        if luminance_cd_m2.is_finite() {
            light_lx += luminance_cd_m2 * pixel_sr;
            solid_angle_sr += pixel_sr;
        }
    }
    if solid_angle_sr > 0.0 { light_lx / solid_angle_sr } else { 0.0 }
}

/// Luminance that is displayed as white, cd/m^2.
pub fn white_luminance_cd_m2(ev100: f64) -> f64 {
    WHITE_LUMINANCE_AT_EV0_CD_M2 * ev100.exp2()
}

/// EV100 that a meter reads from a scene of mean luminance `mean_cd_m2`. Darkness (0) gives minus infinity, a
/// negative mean NaN; use [`metered_ev100`] for measured means.
pub fn ev100_from_mean_luminance(mean_cd_m2: f64) -> f64 {
    (mean_cd_m2 * 100.0 / METER_CALIBRATION).log2()
}

/// Automatic exposure for a mean luminance: metered, compensated (positive darkens) and clamped to limits. Darkness
/// and a mean that is NaN give the lowest, an infinite mean the highest.
pub fn metered_ev100(mean_cd_m2: f64, compensation_ev: f64, min_ev100: f64, max_ev100: f64) -> f64 {
    if mean_cd_m2 > 0.0 {
        (ev100_from_mean_luminance(mean_cd_m2) + compensation_ev).clamp(min_ev100, max_ev100)
    } else {
        min_ev100
    }
}

/// Exposure at which the peak of a star of `illuminance_lx`, drawn with the B-spline into pixels of `pixel_sr`, is
/// displayed at `share` of display white.
pub fn limiting_ev100(illuminance_lx: f64, pixel_sr: f64, share: f64) -> f64 {
    (BSPLINE_PEAK * illuminance_lx / (WHITE_LUMINANCE_AT_EV0_CD_M2 * pixel_sr * share)).log2()
}

/// Illuminance of the star whose peak is displayed at `share` of display white at an exposure, lx: the
/// inverse of [`limiting_ev100`].
pub fn limiting_illuminance_lx(ev100: f64, pixel_sr: f64, share: f64) -> f64 {
    white_luminance_cd_m2(ev100) * pixel_sr * share / BSPLINE_PEAK
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limiting_exposure_matches_the_worked_example_and_has_an_inverse() {
        use crate::units::illuminance_lx_from_magnitude;
        // A dome of 1024 pixels, 7.63e-6 sr each on average; filmic displays 0.01095 of white as code 20. By hand: V
        // = 6.5 is 6.4e-9 lx, its peak 3.7e-4 cd/m^2, white 0.034 cd/m^2.
        let lx = illuminance_lx_from_magnitude(6.5);
        let ev100 = limiting_ev100(lx, 7.63e-6, 0.010_95);
        assert!((ev100 + 5.16).abs() < 0.02, "{ev100}");
        assert!((limiting_illuminance_lx(ev100, 7.63e-6, 0.010_95) / lx - 1.0).abs() < 1e-12);
        // A sixteenth of the pixel is four stops; five magnitudes are a factor of a hundred.
        assert!((limiting_ev100(lx, 7.63e-6 / 16.0, 0.010_95) - ev100 - 4.0).abs() < 1e-12);
        let five_brighter = limiting_ev100(illuminance_lx_from_magnitude(1.5), 7.63e-6, 0.010_95);
        assert!((five_brighter - ev100 - 100_f64.log2()).abs() < 1e-9);
    }

    #[test]
    fn exposure_values_match_published_ones() {
        assert_eq!(white_luminance_cd_m2(0.0), 1.2);
        assert!((white_luminance_cd_m2(-3.0) - 0.15).abs() < 1e-15);
        // 4096 cd/m^2 is a sunlit landscape: EV 15 by the rule "sunny 16". 0.125 cd/m^2 is EV 0.
        assert!((ev100_from_mean_luminance(4096.0) - 15.0).abs() < 1e-12);
        assert!(ev100_from_mean_luminance(0.125).abs() < 1e-12);
        let mean_over_white = 100.0 / white_luminance_cd_m2(ev100_from_mean_luminance(100.0));
        assert!((mean_over_white - 0.125 / 1.2).abs() < 1e-12);
    }

    #[test]
    fn the_key_is_the_share_of_white_of_the_displayed_mean() {
        assert_eq!(key_compensation_ev(STANDARD_KEY), 0.0);
        for key in [1e-6, 0.05, 0.18, 1.0] {
            let ev100 = metered_ev100(37.0, key_compensation_ev(key), -20.0, 50.0);
            assert!((37.0 / white_luminance_cd_m2(ev100) / key - 1.0).abs() < 1e-12, "{key}");
        }
    }

    #[test]
    fn pixels_that_are_not_finite_are_ignored_by_the_mean() {
        let pixels = [[3.0, 0.1], [5.0, 0.3], [1.0, 0.6]];
        let mean = mean_luminance_cd_m2(pixels);
        assert!((mean - 2.4).abs() < 1e-12);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(mean_luminance_cd_m2(pixels.into_iter().chain([[bad, 0.5]])), mean);
            assert_eq!(mean_luminance_cd_m2([[bad, 0.5]]), 0.0);
        }
        // Counted as a dark pixel it would lower the mean by a third.
        assert!((mean_luminance_cd_m2(pixels.into_iter().chain([[0.0, 0.5]])) / mean - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_metered_exposure_is_compensated_and_clamped() {
        assert_eq!(metered_ev100(0.125, 0.0, -20.0, 24.0), 0.0);
        assert_eq!(metered_ev100(0.125, 4.5, -20.0, 24.0), 4.5);
        assert_eq!(metered_ev100(1.6e9, 0.0, -20.0, 24.0), 24.0);
        for (mean, expected) in
            [(0.0, -20.0), (-1.0, -20.0), (f64::NAN, -20.0), (1e-320, -20.0), (f64::INFINITY, 24.0), (f64::MAX, 24.0)]
        {
            assert_eq!(metered_ev100(mean, 1.0, -20.0, 24.0), expected, "{mean}");
        }
    }
}
