//! Adaptation of the exposure over time: the exposure value approaches the metered one by 1 - exp(-dt/tau), which does not
//! depend on how the time is cut into frames. Exposure values are EV at ISO 100, times seconds.

use crate::plan::settings::{ExposureMode, ExposureSettings};

/// Closer than this to the metered value the exposure counts as adapted, EV.
const CONVERGED_EV: f64 = 0.01;

/// The state of one eye that looks at all views.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Adaptation {
    /// What the eye is adapted to.
    current: Option<f64>,
    /// What the last frame asked for.
    metered: Option<f64>,
}

impl Adaptation {
    /// The exposure for a frame that comes `dt_s` after the one before; `None` for the fully adapted value: before the first
    /// frame, without a time constant, and where the exposure is manual.
    pub(super) fn advance(&mut self, dt_s: f64, settings: &ExposureSettings) -> Option<f64> {
        let adapts = settings.mode == ExposureMode::Auto && settings.adaptation_s > 0.0;
        let (Some(current), Some(metered), true) = (self.current, self.metered, adapts) else {
            self.current = None;
            return None;
        };
        let share = -(-dt_s.max(0.0) / settings.adaptation_s).exp_m1();
        self.current = Some(current + (metered - current) * share);
        self.current
    }

    /// Takes note of a frame: the exposure it had and the one it asks for. A value that is not finite (a frame without any
    /// light that counts) leaves the goal where it was.
    pub(super) fn observe(&mut self, exposure_ev100: f64, metered_ev100: f64) {
        if metered_ev100.is_finite() {
            self.metered = Some(metered_ev100);
        }
        if exposure_ev100.is_finite() {
            self.current = Some(exposure_ev100);
        }
    }

    /// Whether another frame of the same scene would have the same exposure.
    pub(super) fn converged(&self) -> bool {
        match (self.current, self.metered) {
            (Some(current), Some(metered)) => (metered - current).abs() <= CONVERGED_EV,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(adaptation_s: f64) -> ExposureSettings {
        ExposureSettings { adaptation_s, ..ExposureSettings::default() }
    }

    #[test]
    fn adaptation_does_not_depend_on_the_frame_rate() {
        let after = |frames: u32| {
            let mut eye = Adaptation::default();
            assert_eq!(eye.advance(0.0, &settings(0.5)), None, "the first frame is fully adapted");
            eye.observe(-3.0, 5.0);
            assert!(!eye.converged());
            let mut ev = f64::NAN;
            for _ in 0..frames {
                ev = eye.advance(0.75 / f64::from(frames), &settings(0.5)).unwrap();
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
    fn a_jump_from_night_to_the_sun_converges_and_nan_is_survived() {
        let mut eye = Adaptation::default();
        eye.observe(-20.0, 24.0);
        let mut frames = 0;
        while !eye.converged() {
            let ev = eye.advance(1.0 / 60.0, &settings(0.5)).unwrap();
            eye.observe(ev, if frames == 10 { f64::NAN } else { 24.0 });
            frames += 1;
            assert!(frames < 10_000 && ev.is_finite());
        }
        // ln(44 / 0.01) time constants of 30 frames each.
        assert_eq!(frames, 252);
    }

    #[test]
    fn no_time_constant_and_manual_exposure_ask_for_the_renderers_own_value() {
        let mut eye = Adaptation::default();
        eye.observe(1.0, 2.0);
        assert_eq!(eye.advance(0.1, &settings(0.0)), None);
        eye.observe(1.0, 2.0);
        let manual = ExposureSettings { mode: ExposureMode::Manual, ..settings(0.5) };
        assert_eq!(eye.advance(0.1, &manual), None);
        assert!(eye.converged());
    }
}
