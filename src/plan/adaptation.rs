//! Adaptation of the exposure over time: the exposure value approaches the metered one by 1 - exp(-dt/tau), which does not
//! depend on how the time is cut into frames. Exposure values are EV at ISO 100, times seconds.

use super::settings::{ExposureMode, ExposureSettings};

/// Closer than this to the metered value the exposure counts as adapted, EV.
const CONVERGED_EV: f64 = 0.01;
/// After this many time constants in front of a new picture the eye counts as adapted to it; 1 - exp(-5) is 99.3 %.
const ADAPTED_AFTER: f64 = 5.0;

/// The state of one eye that looks at all views.
#[derive(Clone, Copy, Debug, Default)]
pub struct Adaptation {
    /// What the eye is adapted to.
    current: Option<f64>,
    /// What the last frame asked for.
    metered: Option<f64>,
}

impl Adaptation {
    /// The exposure for a frame that comes `dt_s` after the last one that was observed; `None` for the fully adapted value:
    /// before the first frame, without a time constant, and where the exposure is manual.
    ///
    /// `changed`: the frame shows something else than the last one did. What it asks for is known only when it is rendered,
    /// and no frame was rendered meanwhile: the eye has looked at the new picture for that time, and where it is long
    /// enough, it is adapted to it (`None`) and not to the picture before. Shortly after the last frame, as in a stream, the
    /// goal is the last one known, which lags by that frame.
    pub fn exposure(&self, dt_s: f64, changed: bool, settings: &ExposureSettings) -> Option<f64> {
        let tau_s = settings.adaptation_s;
        let adapts = settings.mode == ExposureMode::Auto && tau_s > 0.0 && !(changed && dt_s >= ADAPTED_AFTER * tau_s);
        let (Some(current), Some(metered), true) = (self.current, self.metered, adapts) else { return None };
        let share = -(-dt_s.max(0.0) / tau_s).exp_m1();
        Some(current + (metered - current) * share)
    }

    /// Takes note of a frame: the exposure it had and the one it asks for. A value that is not finite (a frame without any
    /// light that counts) leaves the goal where it was.
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
        match (self.current, self.metered, settings.mode) {
            (Some(current), Some(metered), ExposureMode::Auto) => (metered - current).abs() <= CONVERGED_EV,
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
            assert_eq!(eye.exposure(0.0, false, &settings(0.5)), None, "the first frame is fully adapted");
            eye.observe(-3.0, 5.0);
            assert!(!eye.converged(&settings(0.5)));
            let mut ev = f64::NAN;
            for _ in 0..frames {
                ev = eye.exposure(0.75 / f64::from(frames), false, &settings(0.5)).unwrap();
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
        while !eye.converged(&settings(0.5)) {
            let ev = eye.exposure(1.0 / 60.0, false, &settings(0.5)).unwrap();
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
        assert_eq!(eye.exposure(0.1, false, &settings(0.0)), None);
        let manual = ExposureSettings { mode: ExposureMode::Manual, ..settings(0.5) };
        assert_eq!(eye.exposure(0.1, false, &manual), None);
        assert!(eye.converged(&manual), "it has nothing to wait for");
    }

    #[test]
    fn time_in_front_of_a_new_picture_adapts_to_that_picture() {
        let mut eye = Adaptation::default();
        eye.observe(10.0, 10.0);
        let settings = settings(0.5);
        assert_eq!(eye.exposure(2.5, true, &settings), None, "the eye had the time to adapt to what it sees");
        assert_eq!(eye.exposure(2.4, true, &settings), Some(10.0), "it still adapts, and goes on from where it was");
        assert_eq!(eye.exposure(3600.0, false, &settings), Some(10.0), "the same picture is adapted to already");
        eye.observe(10.0, 2.0);
        let expected = 2.0 + 8.0 * (-0.2_f64).exp();
        assert!(
            (eye.exposure(0.1, true, &settings).unwrap() - expected).abs() < 1e-12,
            "smoothly while the camera moves"
        );
    }

    /// The Sun appears among the stars, and goes again: every frame is shown as its own light and the exposure that it reports ask for,
    /// the exposure goes one way and is the same at the same time for every frame rate.
    #[test]
    fn from_night_to_the_sun_and_back_no_frame_is_bad() {
        use crate::{
            frame::{Renderer, Wanted},
            gpu::{Gpu, GpuOptions},
            photometry::exposure::white_luminance_cd_m2,
            plan::settings::RenderSettings,
            verify::scenes::{rig, snapshot, spiral, star},
            view::ViewKind,
        };
        let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
        let rig = rig([("sky", ViewKind::Equirectangular { size: [64, 32] })]).unwrap();
        let stars = || spiral(400).enumerate().map(|(i, d)| star(d, (i % 7) as f32));
        let night = snapshot(stars().collect());
        let day = snapshot(stars().chain([star(glam::DVec3::new(0.2, 0.1, -1.0), -26.7)]).collect());
        let settings = RenderSettings::default();
        let wanted = [Wanted { display: true, hdr: true, ..Wanted::default() }];
        // Exposures at every tenth of a second from the first frame with the Sun on, and from the first without it.
        let mut run = |rate_hz: u32| {
            let mut eye = Adaptation::default();
            let mut tenths = Vec::new();
            let seconds = 4;
            let mut previous = f64::NAN;
            for (scene, frames) in [(&night, 1), (&day, seconds * rate_hz), (&night, seconds * rate_hz)] {
                let (mut start, mut goal) = (f64::NAN, f64::NAN);
                let (mut all_black, mut all_white) = (0, 0);
                for frame in 0..frames {
                    let dt_s = 1.0 / f64::from(rate_hz);
                    let ev100 = eye.exposure(dt_s, frame == 0, &settings.exposure);
                    let drawn = renderer.render(scene, &rig, &settings, &wanted, ev100).unwrap();
                    let (shown, metered) = (drawn.exposure_ev100, drawn.metered_ev100);
                    assert!(shown.is_finite() && metered.is_finite());
                    goal = metered;
                    if frame == 0 {
                        start = shown;
                    }
                    // One way, and never beyond the goal. The frame itself holds its exposure in f32.
                    if previous.is_finite() && frame > 0 {
                        let (low, high) = if metered > previous { (previous, metered) } else { (metered, previous) };
                        assert!(
                            (low - 1e-5..=high + 1e-5).contains(&shown),
                            "frame {frame}: {previous} {shown} {metered}"
                        );
                    }
                    previous = shown;
                    eye.observe(shown, metered);
                    let image = &drawn.images[0];
                    let bytes = image.display.as_ref().unwrap().as_chunks::<4>().0;
                    let hdr = image.hdr.as_ref().unwrap();
                    let white = white_luminance_cd_m2(shown);
                    for (pixel, bytes) in hdr.iter().zip(bytes) {
                        let rgb = [pixel[0], pixel[1], pixel[2]].map(f64::from);
                        assert!(rgb.iter().all(|channel| channel.is_finite()));
                        for (byte, value) in bytes.iter().zip(settings.tone_map.display_rgb(rgb, white)) {
                            assert!(
                                (f64::from(*byte) - 255.0 * value).abs() <= 1.02,
                                "frame {frame}: {byte} for {value}"
                            );
                        }
                    }
                    // All black or all white only as long as an eye that adapts by the closed form sees nothing else.
                    let elapsed_s = f64::from(frame) * dt_s;
                    let eye_ev100 = goal + (start - goal) * (-elapsed_s / settings.exposure.adaptation_s).exp();
                    let green = |pixel: &[f32; 4]| f64::from(pixel[1]);
                    let seen =
                        |cd_m2: f64| settings.tone_map.display_rgb([cd_m2; 3], white_luminance_cd_m2(eye_ev100))[0];
                    let brightest = seen(hdr.iter().map(green).fold(0.0, f64::max));
                    let darkest = seen(hdr.iter().map(green).fold(f64::INFINITY, f64::min));
                    let black = bytes.iter().all(|bytes| bytes[..3] == [0; 3]);
                    let white = bytes.iter().all(|bytes| bytes[..3].iter().all(|byte| *byte > 250));
                    assert!(!black || brightest < 1.5 / 255.0, "frame {frame} is black: {brightest}");
                    assert!(!white || darkest > 249.0 / 255.0, "frame {frame} is white: {darkest}");
                    all_black += u32::from(black);
                    all_white += u32::from(white);
                    if (frame * 10) % rate_hz == 0 && frames > 1 {
                        tenths.push(shown);
                    }
                }
                if frames > 1 {
                    // After eight time constants the last frame is adapted.
                    assert!((previous - goal).abs() < 0.02, "{previous} for {goal}");
                    let seconds = |count: u32| f64::from(count) / f64::from(rate_hz);
                    println!(
                        "{rate_hz} Hz: black for {:.2} s, white for {:.2} s",
                        seconds(all_black),
                        seconds(all_white)
                    );
                    assert!(seconds(all_black) < 2.0 && seconds(all_white) < 2.0);
                }
            }
            tenths
        };
        let runs = [10, 30, 120].map(&mut run);
        println!("at 0, 0.1, 0.5, 1 and 2 s: {:.3?} EV", [0, 1, 5, 10, 20].map(|i| runs[0][i]));
        assert_eq!(runs[0].len(), 80);
        for run in &runs[1..] {
            for (tenth, (a, b)) in run.iter().zip(&runs[0]).enumerate() {
                // The exposure of each frame is rounded to f32 on its way.
                assert!((a - b).abs() < 1e-3, "after {tenth} tenths of a second: {a} and {b}");
            }
        }
        assert!(runs[0][39] > runs[0][0] + 15.0, "the Sun is far brighter than the stars");
    }
}
