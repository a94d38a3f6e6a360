//! Exposure: which luminance is shown white.
//!
//! Exposure is given as EV100, the exposure value at ISO 100. It is a base-2 logarithm of luminance, so one step is a
//! factor of two. Two standards tie it to luminance:
//!
//! - a reflected-light meter calibrated to K = 12.5 cd s/(m^2 ISO) reads L = 2^EV100 * 12.5 / 100 off a scene of mean
//!   luminance L (ISO 2720);
//! - a saturation-based sensor of speed 100 clips at H = 78/100 lx s (ISO 12232), which behind a lens of 65 %
//!   transmission is L = 78 / (100 * 0.65) * 2^EV100 = 1.2 * 2^EV100: display white.
//!
//! A scene of even luminance is therefore shown at 0.125 / 1.2 = 10.4 % of white.
//!
//! Units: cd/m^2, EV100.

/// Luminance of display white at EV100 = 0, cd/m^2.
pub const WHITE_LUMINANCE_AT_EV0_CD_M2: f64 = 1.2;

/// Reflected-light meter calibration constant K, cd s/(m^2 ISO).
pub const METER_CALIBRATION: f64 = 12.5;

/// Luminance that is shown as display white, cd/m^2.
pub fn white_luminance_cd_m2(ev100: f64) -> f64 {
    WHITE_LUMINANCE_AT_EV0_CD_M2 * ev100.exp2()
}

/// What a meter reads off a scene of mean luminance `mean_cd_m2`. Darkness (0) gives minus infinity, a negative mean
/// NaN: [`metered_ev100`] is the one for measured means.
pub fn ev100_from_mean_luminance(mean_cd_m2: f64) -> f64 {
    (mean_cd_m2 * 100.0 / METER_CALIBRATION).log2()
}

/// The automatic exposure of a mean luminance: metered, compensated (positive darkens) and within limits. Darkness and a
/// mean that is not a number give the lowest, an infinite mean the highest.
pub fn metered_ev100(mean_cd_m2: f64, compensation_ev: f64, min_ev100: f64, max_ev100: f64) -> f64 {
    if mean_cd_m2 > 0.0 {
        (ev100_from_mean_luminance(mean_cd_m2) + compensation_ev).clamp(min_ev100, max_ev100)
    } else {
        min_ev100
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_values_are_the_published_ones() {
        assert_eq!(white_luminance_cd_m2(0.0), 1.2);
        assert!((white_luminance_cd_m2(-3.0) - 0.15).abs() < 1e-15);
        // 4096 cd/m^2 is a sunlit landscape: EV 15 by the rule "sunny 16". 0.125 cd/m^2 is EV 0.
        assert!((ev100_from_mean_luminance(4096.0) - 15.0).abs() < 1e-12);
        assert!(ev100_from_mean_luminance(0.125).abs() < 1e-12);
        let mean_over_white = 100.0 / white_luminance_cd_m2(ev100_from_mean_luminance(100.0));
        assert!((mean_over_white - 0.125 / 1.2).abs() < 1e-12);
    }

    #[test]
    fn the_metered_exposure_is_compensated_and_never_leaves_its_limits() {
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
