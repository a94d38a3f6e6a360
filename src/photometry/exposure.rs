//! Exposure: which luminance is shown white, and how the choice follows the scene.
//!
//! Exposure is given as EV100, the exposure value at ISO 100. It is a base-2 logarithm of luminance, so one step is a
//! factor of two, and adaptation is exponential in it, as the eye's is roughly. Two standards tie it to luminance:
//!
//! - a reflected-light meter calibrated to K = 12.5 cd s/(m^2 ISO) reads L = 2^EV100 * 12.5 / 100 off a scene of mean
//!   luminance L (ISO 2720);
//! - a saturation-based sensor of speed 100 clips at H = 78/100 lx s (ISO 12232), which behind a lens of 65 %
//!   transmission is L = 78 / (100 * 0.65) * 2^EV100 = 1.2 * 2^EV100: display white.
//!
//! A scene of even luminance is therefore shown at 0.125 / 1.2 = 10.4 % of white.
//!
//! Units: cd/m^2, seconds, EV100.

use thiserror::Error;

/// Luminance of display white at EV100 = 0, cd/m^2.
pub const WHITE_LUMINANCE_AT_EV0_CD_M2: f64 = 1.2;

/// Reflected-light meter calibration constant K, cd s/(m^2 ISO).
pub const METER_CALIBRATION: f64 = 12.5;

/// Luminance that is shown as display white, cd/m^2.
pub fn white_luminance_cd_m2(ev100: f64) -> f64 {
    WHITE_LUMINANCE_AT_EV0_CD_M2 * ev100.exp2()
}

/// What a meter reads off a scene of mean luminance `mean_cd_m2`. Darkness (0) gives minus infinity, a negative mean
/// NaN: [`AutoExposure::target_ev100`] is the one for measured means.
pub fn ev100_from_mean_luminance(mean_cd_m2: f64) -> f64 {
    (mean_cd_m2 * 100.0 / METER_CALIBRATION).log2()
}

/// Why an [`AutoExposure`] cannot be made.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum AutoExposureError {
    /// The time constant is negative or not a number.
    #[error("adaptation time constant of {0} s: need 0 or more")]
    TimeConstant(f64),
    /// The limits are not finite, or in the wrong order.
    #[error("exposure limits from {min_ev100} to {max_ev100} EV: need finite numbers in ascending order")]
    Limits {
        /// Lowest EV100 asked for.
        min_ev100: f64,
        /// Highest EV100 asked for.
        max_ev100: f64,
    },
}

/// Automatic exposure: a target from the mean luminance, and the way there.
///
/// Adaptation covers a share 1 - exp(-dt / tau) of the way in each step. Two steps of dt cover what one of 2 dt does,
/// so the result depends on elapsed time and not on the frame rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutoExposure {
    tau_s: f64,
    min_ev100: f64,
    max_ev100: f64,
}

impl AutoExposure {
    /// Time constant `tau_s` in seconds (0: immediate; infinite: never), and the limits that no result leaves.
    pub fn new(tau_s: f64, min_ev100: f64, max_ev100: f64) -> Result<Self, AutoExposureError> {
        if tau_s.is_nan() || tau_s < 0.0 {
            return Err(AutoExposureError::TimeConstant(tau_s));
        }
        if !(min_ev100.is_finite() && max_ev100.is_finite() && min_ev100 <= max_ev100) {
            return Err(AutoExposureError::Limits { min_ev100, max_ev100 });
        }
        Ok(Self { tau_s, min_ev100, max_ev100 })
    }

    /// Exposure for a measured mean luminance, within the limits. Darkness gives the lowest, an infinite mean the
    /// highest. None if there is no measurement to follow: NaN, or a negative mean.
    pub fn target_ev100(&self, mean_cd_m2: f64) -> Option<f64> {
        let ev100 = ev100_from_mean_luminance(mean_cd_m2);
        (!ev100.is_nan()).then(|| ev100.clamp(self.min_ev100, self.max_ev100))
    }

    /// Exposure after `dt_s` seconds on the way from `current_ev100` to the target of `mean_cd_m2`; always finite and
    /// within the limits.
    ///
    /// Without a target the exposure stays. A current value that is NaN is no place to start from: the target is taken
    /// at once, or without one the middle of the limits. Time that is negative or NaN has not passed.
    pub fn step(&self, current_ev100: f64, mean_cd_m2: f64, dt_s: f64) -> f64 {
        let target = self.target_ev100(mean_cd_m2);
        if current_ev100.is_nan() {
            return target.unwrap_or(0.5 * (self.min_ev100 + self.max_ev100));
        }
        let current = current_ev100.clamp(self.min_ev100, self.max_ev100);
        let Some(target) = target else { return current };
        (current + (target - current) * self.share_of_the_way(dt_s)).clamp(self.min_ev100, self.max_ev100)
    }

    /// 1 - exp(-dt / tau), between 0 and 1.
    fn share_of_the_way(&self, dt_s: f64) -> f64 {
        if dt_s.is_nan() || dt_s <= 0.0 || self.tau_s.is_infinite() {
            0.0
        } else if self.tau_s == 0.0 {
            1.0
        } else {
            -(-dt_s / self.tau_s).exp_m1()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NIGHT_CD_M2: f64 = 2e-4;
    const SUN_CD_M2: f64 = 1.6e9;

    fn eye() -> AutoExposure {
        AutoExposure::new(0.5, -16.0, 36.0).unwrap()
    }

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
    fn adaptation_covers_its_share_whatever_the_frame_rate() {
        let (start, mean) = (-10.0, 100.0);
        let target = ev100_from_mean_luminance(mean);
        let after_tau = eye().step(start, mean, 0.5);
        assert!(((after_tau - start) / (target - start) - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        for frames in [7, 90, 1000] {
            let paced = (0..frames).fold(start, |ev, _| eye().step(ev, mean, 0.5 / f64::from(frames)));
            assert!((paced - after_tau).abs() < 1e-9, "{frames} frames: {paced} instead of {after_tau}");
        }
        let at_once = AutoExposure::new(0.0, -16.0, 36.0).unwrap();
        for arrived in [eye().step(start, mean, f64::INFINITY), at_once.step(start, mean, 1e-9)] {
            assert!((arrived - target).abs() < 1e-12, "{arrived} instead of {target}");
        }
        assert_eq!(AutoExposure::new(f64::INFINITY, -16.0, 36.0).unwrap().step(start, mean, 1e9), start);
    }

    #[test]
    fn a_jump_from_night_to_the_sun_and_back_stays_between_its_ends() {
        let night = ev100_from_mean_luminance(NIGHT_CD_M2);
        let sun = ev100_from_mean_luminance(SUN_CD_M2);
        let mut ev = night;
        for (mean, direction) in [(SUN_CD_M2, 1.0), (NIGHT_CD_M2, -1.0)] {
            for _ in 0..3000 {
                let next = eye().step(ev, mean, 1.0 / 60.0);
                assert!((next - ev) * direction >= 0.0 && (night..=sun).contains(&next), "{ev} to {next}");
                ev = next;
            }
            assert!((ev - if direction > 0.0 { sun } else { night }).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_measured_wrongly_moves_the_exposure_out_of_bounds() {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, 1e-320, 1.0, f64::MAX];
        for current in odd {
            for mean in odd {
                for dt in odd {
                    let next = eye().step(current, mean, dt);
                    assert!((-16.0..=36.0).contains(&next), "step({current}, {mean}, {dt}) = {next}");
                }
            }
        }
        assert_eq!(eye().step(3.0, f64::NAN, 1.0), 3.0);
        assert_eq!(eye().step(3.0, -1.0, 1.0), 3.0);
        assert_eq!(eye().step(3.0, 1.0, f64::NAN), 3.0);
        assert_eq!(eye().step(3.0, 1.0, -1.0), 3.0);
        assert_eq!(eye().step(f64::NAN, 0.125, 1e-3), 0.0);
        assert_eq!(eye().target_ev100(0.0), Some(-16.0));
        assert_eq!(eye().target_ev100(f64::INFINITY), Some(36.0));
        assert_eq!(eye().target_ev100(f64::NAN), None);
    }

    #[test]
    fn impossible_settings_are_refused() {
        for tau in [-1.0, f64::NAN] {
            assert!(matches!(AutoExposure::new(tau, 0.0, 1.0), Err(AutoExposureError::TimeConstant(_))));
        }
        for (low, high) in [(1.0, 0.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert!(matches!(AutoExposure::new(1.0, low, high), Err(AutoExposureError::Limits { .. })));
        }
    }
}
