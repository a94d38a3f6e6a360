//! Adaptation of the exposure over time: the exposure value approaches the metered one by 1 - exp(-dt/tau), independently
//! of the frame rate. Exposure values are EV at ISO 100, times seconds.

use super::settings::ExposureSettings;

/// Difference from the metered value below which the exposure counts as adapted, EV.
const CONVERGED_EV: f64 = 0.01;
/// Number of time constants after which the eye counts as adapted to a new picture; 1 - exp(-5) is 99.3 %.
const ADAPTED_AFTER: f64 = 5.0;

/// Adaptation of one eye that looks at all views.
#[derive(Clone, Copy, Debug, Default)]
pub struct Adaptation {
    /// Exposure to which the eye is adapted.
    current: Option<f64>,
    /// Exposure requested by the last frame.
    metered: Option<f64>,
}

impl Adaptation {
    /// Whether the exposure follows the values that frames request, with a delay.
    pub fn adapts(settings: &ExposureSettings) -> bool {
        matches!(settings, ExposureSettings::Auto(auto) if auto.adaptation_s > 0.0)
    }

    /// Returns the exposure for a frame `dt_s` after the last observed one. `None` means the fully adapted value; it applies before the first frame,
    /// without a time constant, and with manual exposure.
    ///
    /// `new_for_s`: how long the scene has differed from that of the last frame. If this frame shows another scene, this is the time since the last
    /// frame was begun, otherwise 0. The exposure that a new picture requires is known only after it has been rendered. If the eye has looked at the
    /// new picture long enough, it is fully adapted to it (`None`). Shortly after the last frame, as in a stream, the eye approaches the last known
    /// metered value instead. This value is one frame old, or two if this frame is planned before the last one is observed. Time is counted from the
    /// observed frame, so no adaptation is lost.
    pub fn exposure(&self, dt_s: f64, new_for_s: f64, settings: &ExposureSettings) -> Option<f64> {
        let ExposureSettings::Auto(auto) = settings else { return None };
        let tau_s = auto.adaptation_s;
        let adapts = tau_s > 0.0 && new_for_s < ADAPTED_AFTER * tau_s;
        let (Some(current), Some(metered), true) = (self.current, self.metered, adapts) else { return None };
        let share = -(-dt_s.max(0.0) / tau_s).exp_m1();
        Some(current + (metered - current) * share)
    }

    /// Records the exposure of a frame and the exposure that it requests. A value that is not finite (from a frame without significant light) is
    /// ignored.
    pub fn observe(&mut self, exposure_ev100: f64, metered_ev100: f64) {
        if metered_ev100.is_finite() {
            self.metered = Some(metered_ev100);
        }
        if exposure_ev100.is_finite() {
            self.current = Some(exposure_ev100);
        }
    }

    /// Whether another frame of the same scene would have the same exposure.
    pub fn converged(&self, settings: &ExposureSettings) -> bool {
        match (self.current, self.metered, settings) {
            (Some(current), Some(metered), ExposureSettings::Auto(_)) => (metered - current).abs() <= CONVERGED_EV,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::settings::ExposureValues;

    fn settings(adaptation_s: f64) -> ExposureSettings {
        ExposureValues { adaptation_s, ..ExposureValues::default() }.into()
    }

    #[test]
    fn adaptation_does_not_depend_on_the_frame_rate() {
        let after = |frames: u32| {
            let mut eye = Adaptation::default();
            assert_eq!(eye.exposure(0.0, 0.0, &settings(0.5)), None, "the first frame is fully adapted");
            eye.observe(-3.0, 5.0);
            assert!(!eye.converged(&settings(0.5)));
            let mut ev = f64::NAN;
            for _ in 0..frames {
                ev = eye.exposure(0.75 / f64::from(frames), 0.0, &settings(0.5)).unwrap();
                eye.observe(ev, 5.0);
            }
            ev
        };
        let expected = 5.0 - 8.0 * (-1.5_f64).exp();
        for frames in [1, 7, 1000] {
            assert!((after(frames) - expected).abs() < 1e-9, "{frames} frames: {} EV", after(frames));
        }
    }

    #[test]
    fn a_frame_planned_before_the_last_one_is_observed_continues_from_it() {
        let mut eye = Adaptation::default();
        eye.observe(-3.0, 5.0);
        let ahead = eye.exposure(0.3, 0.2, &settings(0.5)).unwrap();
        let last = eye.exposure(0.1, 0.1, &settings(0.5)).unwrap();
        eye.observe(last, 5.0);
        assert!((eye.exposure(0.2, 0.2, &settings(0.5)).unwrap() - ahead).abs() < 1e-12);
    }

    #[test]
    fn a_jump_from_night_to_the_sun_converges_and_nan_is_ignored() {
        let mut eye = Adaptation::default();
        eye.observe(-20.0, 24.0);
        let mut frames = 0;
        while !eye.converged(&settings(0.5)) {
            let ev = eye.exposure(1.0 / 60.0, 0.0, &settings(0.5)).unwrap();
            eye.observe(ev, if frames == 10 { f64::NAN } else { 24.0 });
            frames += 1;
            assert!(frames < 10_000 && ev.is_finite());
        }
        // The difference falls from 44 EV to 0.01 EV in ln(44 / 0.01) time constants of 30 frames each.
        assert_eq!(frames, 252);
    }

    #[test]
    fn without_time_constant_or_with_manual_exposure_the_renderer_decides() {
        let mut eye = Adaptation::default();
        eye.observe(1.0, 2.0);
        assert_eq!(eye.exposure(0.1, 0.0, &settings(0.0)), None);
        let manual = ExposureSettings::manual(-3.0);
        assert_eq!(eye.exposure(0.1, 0.0, &manual), None);
        assert!(eye.converged(&manual), "a manual exposure is constant");
    }

    #[test]
    fn time_with_a_new_picture_adapts_to_that_picture() {
        let mut eye = Adaptation::default();
        eye.observe(10.0, 10.0);
        let settings = settings(0.5);
        assert_eq!(eye.exposure(2.5, 2.5, &settings), None, "the eye had time to adapt to the new picture");
        assert_eq!(eye.exposure(2.4, 2.4, &settings), Some(10.0), "the eye is still adapting, from its last exposure");
        assert_eq!(eye.exposure(3600.0, 0.0, &settings), Some(10.0), "the eye is already adapted to the same picture");
        eye.observe(10.0, 2.0);
        let expected = 2.0 + 8.0 * (-0.2_f64).exp();
        assert!(
            (eye.exposure(0.1, 0.1, &settings).unwrap() - expected).abs() < 1e-12,
            "the exposure changes smoothly while the camera moves"
        );
    }
}
