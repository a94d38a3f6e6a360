//! Automatic exposure from the mean luminance: it equals the f64 mean over all pictures, does not depend on how they are
//! divided or on earlier frames, and adapts over time.

use std::f64::consts::FRAC_PI_3;

use crate::common::*;
use glam::DVec3;
use steradian::{
    catalogue::StarRecord,
    gpu::GpuOptions,
    photometry::{
        exposure::{mean_luminance_cd_m2, white_luminance_cd_m2},
        rec709::luminance,
    },
    plan::settings::{ExposureKeys, ExposureSettings, Metering, RenderSettings, StarMethod, ToneMapSettings},
    render::{Frame, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{
        Fov, Rig, ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

fn fov() -> Fov {
    Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.85 }
}

fn fisheye(mapping: FisheyeMapping, degrees: f64) -> ViewKind {
    ViewKind::Fisheye { size: [160; 2], mapping, fov_rad: degrees.to_radians() }
}

/// Returns a flat view, a stereo view, a cube, domes that show more and less than half of the sky, and a map of the whole sky.
fn rig_of_all() -> Rig {
    rig(vec![
        ("flat", ViewKind::Perspective { size: [160, 90], fov_y_rad: FRAC_PI_3 }),
        ("eyes", ViewKind::Stereo { size: [96, 100], ipd_m: 0.064, fov_left: fov(), fov_right: fov().mirrored() }),
        ("cube", ViewKind::Cubemap { face_size: 64, faces: Face::ALL.to_vec() }),
        ("dome-180", fisheye(FisheyeMapping::Equidistant, 180.0)),
        ("dome-220", fisheye(FisheyeMapping::Equisolid, 220.0)),
        ("map", ViewKind::Equirectangular { size: [192, 96] }),
    ])
}

/// Stars concentrated towards +x, so that the mean differs between views.
fn crowd() -> SceneSnapshot {
    let crowded = |(i, d): (usize, DVec3)| StarRecord {
        temperature_k: 2500.0 + 13.0 * i as f32,
        ..star(d + DVec3::X * 0.8, (i % 9) as f32)
    };
    snapshot(spiral(4000).enumerate().map(crowded).collect())
}

fn render(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    rig: &Rig,
    settings: &RenderSettings,
    adapted: Option<f64>,
) -> Frame {
    renderer
        .render(FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::both()).adapted_ev100(adapted))
        .unwrap()
}

/// Returns the luminance and solid angle of every pixel of a frame, in f64.
fn pixels(frame: &Frame, rig: &Rig) -> Vec<[f64; 2]> {
    let mappings = rig.views().iter().flat_map(|view| &view.images).map(|image| image.projection.mapping());
    let mut pixels = Vec::new();
    for (image, mapping) in frame.images.iter().zip(mappings) {
        for (i, [r, g, b, _]) in image.hdr.as_ref().unwrap().iter().enumerate() {
            let omega = mapping.solid_angle_sr(i as u32 % image.width, i as u32 / image.width);
            pixels.push([luminance([*r, *g, *b].map(f64::from)), omega]);
        }
    }
    pixels
}

#[test]
fn exposure_of_a_rig_equals_the_f64_mean_over_its_images() {
    let mut renderer = renderer();
    let rig = rig_of_all();
    for (key, scene) in [(None, crowd()), (Some(0.3), snapshot(vec![star(DVec3::new(0.3, 0.2, -1.0), -26.7)]))] {
        let mut settings = settings(StarMethod::Auto);
        let keys = ExposureKeys { metering: Some(Metering::Mean), max_ev100: Some(60.0), key, ..Default::default() };
        settings.exposure = keys.over(&settings.exposure);
        let frame = render(&mut renderer, &scene, &rig, &settings, None);
        let pixels = pixels(&frame, &rig);
        let expected = settings.exposure.metered_ev100(mean_luminance_cd_m2(pixels.iter().copied()));
        let error = frame.exposure_ev100 - expected;
        println!(
            "{} images: exposure {:.5}, f64 {expected:.5}: {error:+.1e} EV",
            frame.images.len(),
            frame.exposure_ev100
        );
        assert!(error.abs() < 1.5e-4, "{error}");
        assert_eq!(frame.exposure_ev100, frame.metered_ev100);
        // A mean in which all pixels have the same weight gives another exposure.
        let in_picture = pixels.iter().filter(|[_, omega]| *omega > 0.0).map(|[luminance, _]| [*luminance, 1.0]);
        let unweighted = settings.exposure.metered_ev100(mean_luminance_cd_m2(in_picture));
        assert!((unweighted - expected).abs() > 0.03, "{unweighted}");
    }
}

/// Counts the bytes of a display image that differ from those computed from its HDR pixels with an exposure.
fn differing_bytes(frame: &Frame, image: usize, tone_map: &ToneMapSettings, ev100: f64) -> usize {
    let image = &frame.images[image];
    let white = white_luminance_cd_m2(ev100);
    let pairs = image.hdr.as_ref().unwrap().iter().zip(image.display.as_ref().unwrap().as_chunks::<4>().0);
    pairs
        .map(|([r, g, b, _], bytes)| {
            let expected = tone_map.display_rgb([*r, *g, *b].map(f64::from), white);
            bytes.iter().zip(expected).filter(|(byte, value)| (f64::from(**byte) - 255.0 * value).abs() > 0.51).count()
        })
        .sum()
}

/// All images of a frame are displayed with the exposure that the frame reports, whether it is metered or given.
#[test]
fn all_images_of_a_frame_use_its_reported_exposure() {
    let mut renderer = renderer();
    let (rig, scene) = (rig_of_all(), crowd());
    let mut settings = settings(StarMethod::Auto);
    settings.tone_map.dither = false;
    // Codes within a budget would be wrong by more than rounding.
    settings.accuracy.display_codes = 0.0;
    settings.exposure = ExposureSettings::auto(Metering::Mean);
    let metered = render(&mut renderer, &scene, &rig, &settings, None);
    assert_eq!(metered.images.len(), 12);
    let known = render(&mut renderer, &scene, &rig, &settings, Some(metered.exposure_ev100 + 1.5));
    assert!((known.exposure_ev100 - metered.exposure_ev100 - 1.5).abs() < 1e-5);
    for frame in [&metered, &known] {
        for image in 0..frame.images.len() {
            assert_eq!(differing_bytes(frame, image, &settings.tone_map, frame.exposure_ev100), 0, "image {image}");
            // An exposure that differs by 0.02 EV changes every image.
            let differing = differing_bytes(frame, image, &settings.tone_map, frame.exposure_ev100 + 0.02);
            assert!(differing > 20, "image {image}: {differing} bytes");
        }
    }
}

#[test]
fn a_picture_cut_into_faces_windows_or_tiles_has_the_same_exposure() {
    let scene = crowd();
    let mut settings = settings(StarMethod::BSpline);
    settings.exposure = ExposureSettings::auto(Metering::Mean);
    let exposure = |options: &GpuOptions, views| {
        render_hdr(&mut renderer_with(options), &scene, &rig(views), &settings).exposure_ev100
    };
    let whole = GpuOptions::default();
    // Draw the whole sky as a map and as six cube faces.
    let map = exposure(&whole, vec![("map", ViewKind::Equirectangular { size: [512, 256] })]);
    let cube = exposure(&whole, vec![("cube", ViewKind::Cubemap { face_size: 128, faces: Face::ALL.to_vec() })]);
    println!("map {map:.6}, cube {cube:.6}: {:+.1e} EV", cube - map);
    assert!((cube - map).abs() < 1e-5);
    // A single face has another exposure.
    let right = exposure(&whole, vec![("right", ViewKind::Cubemap { face_size: 128, faces: vec![Face::Right] })]);
    assert!((right - map).abs() > 0.1, "{right}");
    // Draw a window, and the same window cut in two off-axis halves. Stars on the cut are partly in each half.
    let window = |left_rad: f64, right_rad: f64, width: u32| {
        let fov = Fov { left_rad, right_rad, up_rad: 0.6, down_rad: -0.6 };
        ViewKind::OffAxis { size: [width, 256], fov }
    };
    let one = exposure(&whole, vec![("whole", window(-0.6, 0.6, 256))]);
    let two = exposure(&whole, vec![("left", window(-0.6, 0.0, 128)), ("right", window(0.0, 0.6, 128))]);
    println!("window {one:.6}, two halves {two:.6}: {:+.1e} EV", two - one);
    assert!((two - one).abs() < 1e-5);
    // Draw strips of a few rows, as on an adapter with small bindings.
    for rows in [17, 40] {
        let options = GpuOptions { binding_limit_bytes: Some(16 * 256 * rows), ..GpuOptions::default() };
        let strips = exposure(&options, vec![("whole", window(-0.6, 0.6, 256))]);
        println!("strips of {rows} rows: {:+.1e} EV", strips - one);
        assert!((strips - one).abs() < 1e-5);
    }
}

#[test]
fn darkness_has_the_lowest_exposure_and_stays_black() {
    let mut renderer = renderer();
    let rig = rig(vec![("map", ViewKind::Equirectangular { size: [64, 32] })]);
    let mut settings = settings(StarMethod::Auto);
    settings.exposure = ExposureSettings::auto(Metering::Mean);
    for adapted in [None, Some(-20.0)] {
        let frame = render(&mut renderer, &snapshot(vec![]), &rig, &settings, adapted);
        assert_eq!((frame.exposure_ev100, frame.metered_ev100, frame.mean_luminance_cd_m2), (-20.0, -20.0, 0.0));
        let display = frame.images[0].display.as_ref().unwrap();
        assert!(display.as_chunks::<4>().0.iter().all(|bytes| *bytes == [0, 0, 0, 255]));
    }
}

/// Metering does not depend on the previous frame, however bright and large it was.
#[test]
fn exposure_does_not_depend_on_earlier_frames() {
    let small = rig(vec![("small", ViewKind::Perspective { size: [61, 37], fov_y_rad: 1.0 })]);
    let faint = crowd();
    let mut records: Vec<StarRecord> = spiral(100).map(|d| star(d, 3.0)).collect();
    records.push(star(DVec3::NEG_Z, -26.7));
    let bright = snapshot(records);
    for method in [StarMethod::Auto, StarMethod::HardwarePoint] {
        let mut settings = settings(method);
        settings.exposure = ExposureSettings::auto(Metering::Mean);
        let expected = render(&mut new_renderer(), &faint, &small, &settings, None);
        let mut used = renderer();
        for before in [rig_of_all(), rig(vec![("sky", ViewKind::Equirectangular { size: [256, 128] })])] {
            let frame = render(&mut used, &bright, &before, &settings, Some(-10.0));
            let (brighter, fainter) = (frame.metered_ev100, expected.metered_ev100);
            assert!(brighter > fainter + 5.0, "{}: {brighter} {fainter} {}", method.name(), frame.plan.accumulator);
            let next = render(&mut used, &faint, &small, &settings, None);
            assert_eq!(next.exposure_ev100.to_bits(), expected.exposure_ev100.to_bits(), "{}", method.name());
            assert_eq!(next.mean_luminance_cd_m2.to_bits(), expected.mean_luminance_cd_m2.to_bits());
            assert!(next.images[0].display == expected.images[0].display, "{}", method.name());
        }
    }
}

/// The Sun appears among the stars and disappears again. Every frame equals its own HDR image at the reported exposure;
/// the exposure changes monotonically, and does not depend on the frame rate.
#[test]
fn adaptation_to_the_sun_and_back_is_monotonic() {
    use steradian::{
        plan::adaptation::Adaptation,
        verify::scenes::{rig, snapshot, spiral, star},
    };
    let mut renderer = renderer();
    let rig = rig([("sky", ViewKind::Equirectangular { size: [64, 32] })]).unwrap();
    let stars = || spiral(400).enumerate().map(|(i, d)| star(d, (i % 7) as f32));
    let night = snapshot(stars().collect());
    let day = snapshot(stars().chain([star(glam::DVec3::new(0.2, 0.1, -1.0), -26.7)]).collect());
    let exposure = ExposureSettings::auto(Metering::Mean);
    let settings = RenderSettings { exposure, ..RenderSettings::default() };
    // Returns the exposures at every tenth of a second after the Sun appears, and at every tenth of a second after it disappears.
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
                let adapted_ev100 = eye.exposure(dt_s, if frame == 0 { dt_s } else { 0.0 }, &settings.exposure);
                let drawn = renderer
                    .render(
                        FrameRequest::new(scene, &rig)
                            .settings(&settings)
                            .wanted(Wanted::both())
                            .adapted_ev100(adapted_ev100),
                    )
                    .unwrap();
                let (ev100, metered) = (drawn.exposure_ev100, drawn.metered_ev100);
                assert!(ev100.is_finite() && metered.is_finite());
                goal = metered;
                if frame == 0 {
                    start = ev100;
                }
                // The exposure is monotonic and never overshoots the goal. The tolerance allows for the f32 in which the frame stores its exposure.
                if previous.is_finite() && frame > 0 {
                    let (low, high) = if metered > previous { (previous, metered) } else { (metered, previous) };
                    assert!((low - 1e-5..=high + 1e-5).contains(&ev100), "frame {frame}: {previous} {ev100} {metered}");
                }
                previous = ev100;
                eye.observe(ev100, metered);
                let image = &drawn.images[0];
                let bytes = image.display.as_ref().unwrap().as_chunks::<4>().0;
                let hdr = image.hdr.as_ref().unwrap();
                let white = white_luminance_cd_m2(ev100);
                for (pixel, bytes) in hdr.iter().zip(bytes) {
                    let rgb = [pixel[0], pixel[1], pixel[2]].map(f64::from);
                    assert!(rgb.iter().all(|channel| channel.is_finite()));
                    for (byte, value) in bytes.iter().zip(settings.tone_map.display_rgb(rgb, white)) {
                        assert!((f64::from(*byte) - 255.0 * value).abs() <= 1.02, "frame {frame}: {byte} for {value}");
                    }
                }
                // A frame may be all black or all white only while it would be so for an eye that adapts according to the closed form.
                let elapsed_s = f64::from(frame) * dt_s;
                let eye_ev100 =
                    goal + (start - goal) * (-elapsed_s / settings.exposure.auto_or_default().adaptation_s).exp();
                let green = |pixel: &[f32; 4]| f64::from(pixel[1]);
                let displayed =
                    |cd_m2: f64| settings.tone_map.display_rgb([cd_m2; 3], white_luminance_cd_m2(eye_ev100))[0];
                let brightest = displayed(hdr.iter().map(green).fold(0.0, f64::max));
                let darkest = displayed(hdr.iter().map(green).fold(f64::INFINITY, f64::min));
                let black = bytes.iter().all(|bytes| bytes[..3] == [0; 3]);
                let white = bytes.iter().all(|bytes| bytes[..3].iter().all(|byte| *byte > 250));
                assert!(!black || brightest < 1.5 / 255.0, "frame {frame} is black: {brightest}");
                assert!(!white || darkest > 249.0 / 255.0, "frame {frame} is white: {darkest}");
                all_black += u32::from(black);
                all_white += u32::from(white);
                if (frame * 10) % rate_hz == 0 && frames > 1 {
                    tenths.push(ev100);
                }
            }
            if frames > 1 {
                // After eight time constants the exposure is adapted.
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
            // The exposure of each frame is rounded to f32.
            assert!((a - b).abs() < 1e-3, "after {tenth} tenths of a second: {a} and {b} EV");
        }
    }
    assert!(runs[0][39] > runs[0][0] + 15.0, "the Sun is far brighter than the stars");
}

/// Returns the median of the codes of G over the sky within 30 degrees of the zenith, in a dome with sides of `size` pixels.
fn zenith_code(size: u32, time: &str, reference_arcmin: f64) -> u8 {
    let (scene, rig, settings) = configured(
        "tonight.toml",
        &[
            "scene.catalogues=[\"builtin:bright\"]",
            &format!("scene.time={time}"),
            &format!("views=[{{ name = \"dome\", type = \"dome_master\", size = [{size}, {size}] }}]"),
            &format!("exposure.reference_pixel_arcmin={reference_arcmin}"),
        ],
    );
    let wanted = Wanted { display: true, ..Wanted::default() };
    let frame = renderer().render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(wanted)).unwrap();
    let codes = frame.images[0].display.as_ref().unwrap();
    let half = f64::from(size) / 2.0;
    let is_near = |index: &usize| {
        let (x, y) = ((index % size as usize) as f64 + 0.5 - half, (index / size as usize) as f64 + 0.5 - half);
        x.hypot(y) < half / 3.0
    };
    let mut green: Vec<u8> = (0..(size * size) as usize).filter(is_near).map(|index| codes[4 * index + 1]).collect();
    green.sort_unstable();
    green[green.len() / 2]
}

#[test]
fn a_small_dome_has_the_sky_of_the_large_one_and_its_zenith_darkens_after_dusk() {
    let mut last = u8::MAX;
    for time in ["16:10", "16:40", "17:00", "17:20", "18:00", "20:00"].map(|time| format!("2026-11-09T{time}:00Z")) {
        // The reference pixels are those of a dome of 1024 pixels, and those of a dome of 4096 pixels.
        let codes = [128, 256, 512, 1024].map(|size| zenith_code(size, &time, 9.57));
        let own = [128, 512].map(|size| zenith_code(size, &time, 0.0));
        let of_4096 = zenith_code(256, &time, 2.39);
        println!("{time}: {codes:?} with the pixels of 1024, {own:?} with their own, {of_4096} with those of 4096");
        let (least, most) = (codes.iter().min().unwrap(), codes.iter().max().unwrap());
        assert!(most - least <= 2, "{time}: {codes:?}");
        assert!(of_4096 <= last.saturating_add(1), "{time}: {of_4096} after {last}");
        last = of_4096;
        if time.contains("T20") {
            assert!(own.iter().all(|own| *own > codes[0] + 10) && codes[0] > of_4096 + 10, "{own:?}");
        }
    }
}
