//! Adaptation of the exposure from frame to frame, with frames as they are drawn.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use steradian::{
    frame::{Renderer, Wanted},
    gpu::{Gpu, GpuOptions},
    photometry::exposure::white_luminance_cd_m2,
    plan::{adaptation::Adaptation, settings::RenderSettings},
    verify::scenes::{rig, snapshot, spiral, star},
    view::ViewKind,
};

/// The Sun appears among the stars, and goes again: every frame is shown as its own light and the exposure that it reports ask for,
/// the exposure goes one way and is the same at the same time for every frame rate.
#[test]
fn from_night_to_the_sun_and_back_no_frame_is_bad() {
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
                    assert!((low - 1e-5..=high + 1e-5).contains(&shown), "frame {frame}: {previous} {shown} {metered}");
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
                        assert!((f64::from(*byte) - 255.0 * value).abs() <= 1.02, "frame {frame}: {byte} for {value}");
                    }
                }
                // All black or all white only as long as an eye that adapts by the closed form sees nothing else.
                let elapsed_s = f64::from(frame) * dt_s;
                let eye_ev100 = goal + (start - goal) * (-elapsed_s / settings.exposure.adaptation_s).exp();
                let green = |pixel: &[f32; 4]| f64::from(pixel[1]);
                let seen = |cd_m2: f64| settings.tone_map.display_rgb([cd_m2; 3], white_luminance_cd_m2(eye_ev100))[0];
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
                println!("{rate_hz} Hz: black for {:.2} s, white for {:.2} s", seconds(all_black), seconds(all_white));
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
