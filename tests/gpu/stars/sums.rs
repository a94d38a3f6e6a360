//! Sums of light: dynamic range, overflow, independence of order, strips and batches, stars at the camera, and repeated
//! frames.

use crate::common::{figures::Worst, *};
use glam::{DVec2, DVec3};
use steradian::{
    catalogue::StarRecord,
    gpu::GpuOptions,
    photometry::rec709::luminance,
    plan::settings::StarMethod,
    render::{FrameRequest, RenderError, Wanted},
    units::illuminance_lx_from_magnitude,
    view::{
        ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

/// A million stars of magnitude 20 in one pixel, each too faint for a 16-bit float.
#[test]
fn a_million_faint_stars_in_one_pixel_add_up() {
    let mut worst = figures::MILLION_FAINT_STARS.worst();
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let rig = rig(vec![("v", ViewKind::Perspective { size: [33, 33], fov_y_rad: 0.5 })]);
        let scene = snapshot(vec![star(DVec3::NEG_Z, 20.0); 1_000_000]);
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::BSpline));
        let error = total_illuminance_lx(&frame, &rig) / (1e6 * illuminance_lx_from_magnitude(20.0)) - 1.0;
        worst.add(error, frame.plan.accumulator);
        assert_eq!(frame.views[0].stars_drawn, 1_000_000);
    }
    worst.print();
}

/// Sirius and a star of magnitude 21, three pixels apart, without and with the Sun in the view.
#[test]
fn sirius_and_a_star_of_magnitude_21_both_keep_their_light() {
    let (mut worst_sirius, mut worst_faint) = (figures::SIRIUS.worst(), figures::STAR_BESIDE_SIRIUS.worst());
    let mut worst_faint_by_day = figures::STAR_BESIDE_THE_SUN.worst();
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let kind = ViewKind::Perspective { size: [65, 65], fov_y_rad: 0.1 };
        let mapping_view = view("v", kind.clone());
        let mapping = mapping_view.images[0].projection.mapping();
        let direction_at = |x: f64, y: f64| mapping.direction_from_pixel(DVec2::new(x, y)).expect("inside");
        let rig = rig(vec![("v", kind)]);
        for with_sun in [false, true] {
            let mut records = vec![star(direction_at(30.3, 30.4), -1.46), star(direction_at(33.6, 30.2), 21.0)];
            if with_sun {
                records.push(star(direction_at(10.5, 50.5), -26.7));
            }
            let frame = render_hdr(&mut renderer, &snapshot(records), &rig, &settings(StarMethod::BSpline));
            let hdr = frame.images[0].hdr.as_ref().expect("asked for");
            let sum_around = |cx: u32, cy: u32| -> f64 {
                (cy - 1..=cy + 1)
                    .flat_map(|y| (cx - 1..=cx + 1).map(move |x| (x, y)))
                    .map(|(x, y)| {
                        let [r, g, b, _] = hdr[(y * 65 + x) as usize];
                        luminance([r, g, b].map(f64::from)) * mapping.solid_angle_sr(x, y)
                    })
                    .sum()
            };
            let sirius = sum_around(30, 30) / illuminance_lx_from_magnitude(-1.46) - 1.0;
            let faint = sum_around(33, 30) / illuminance_lx_from_magnitude(21.0) - 1.0;
            let case = format!("{}, Sun {with_sun}", frame.plan.accumulator);
            worst_sirius.add(sirius, &case);
            if with_sun { &mut worst_faint_by_day } else { &mut worst_faint }.add(faint, &case);
            if with_sun {
                let sun = sum_around(10, 50) / illuminance_lx_from_magnitude(-26.7) - 1.0;
                println!("{case}: relative error of the Sun {sun:.1e}");
                assert!(sun.abs() < 2.6e-5, "{sun}");
            }
        }
    }
    [worst_sirius, worst_faint, worst_faint_by_day].into_iter().for_each(Worst::print);
}

/// With units that are deliberately too fine, the frame is refused, and no sum overflows unnoticed.
#[test]
fn a_provoked_overflow_is_reported() {
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let rig = rig(vec![("v", ViewKind::Perspective { size: [9, 9], fov_y_rad: 0.5 })]);
        let scene = snapshot(vec![star(DVec3::NEG_Z, 2.0); 4096]);
        let mut render = |factor: f64| {
            renderer.unit_factor = factor;
            renderer
                .render(FrameRequest::new(&scene, &rig).settings(&settings(StarMethod::BSpline)).wanted(Wanted::hdr()))
        };
        let expected = 4096.0 * illuminance_lx_from_magnitude(2.0);
        assert!((total_illuminance_lx(&render(1.0).expect("in range"), &rig) / expected - 1.0).abs() < 4.6e-5);
        for factor in [64.0, 1024.0] {
            assert!(matches!(render(factor), Err(RenderError::Overflow(count)) if count > 0), "factor {factor}");
        }
    }
}

/// Returns how many of 100 shuffles change any bit of a picture of a crowd. Each shuffle reorders the records, and without `steady` also the stars on
/// the GPU.
fn changed_by_a_hundred_shuffles(method: StarMethod, steady: bool) -> usize {
    let mut renderer = renderer();
    let mut records: Vec<StarRecord> = spiral(2000)
        .enumerate()
        .map(|(i, direction)| StarRecord { temperature_k: 2500.0 + i as f32 * 7.0, ..star(direction, (i % 17) as f32) })
        .collect();
    // Half of the stars are in a few pixels, so that many threads add to the same sums.
    for record in records.iter_mut().step_by(2) {
        record.position = (DVec3::NEG_Z + record.position * 0.01).normalize();
    }
    let rig = rig(vec![
        ("flat", ViewKind::Perspective { size: [160, 90], fov_y_rad: 1.0 }),
        ("cube", ViewKind::Cubemap { face_size: 32, faces: Face::ALL.to_vec() }),
    ]);
    let mut first = None;
    let mut changed = 0;
    let mut state = 1_u64;
    for shuffle in 0..=100 {
        renderer.catalogue_order = (shuffle > 0 && !steady).then_some(shuffle);
        for i in (1..records.len()).rev() {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            records.swap(i, ((state >> 33) % (i as u64 + 1)) as usize);
        }
        let frame = render_hdr(&mut renderer, &snapshot(records.clone()), &rig, &settings(method));
        assert!(total_illuminance_lx(&frame, &rig) > 0.0, "nothing is drawn");
        let bits = |hdr: Vec<[f32; 4]>| -> Vec<u32> { hdr.into_iter().flatten().map(f32::to_bits).collect() };
        let bits: Vec<_> = frame.images.into_iter().map(|image| image.hdr.map(bits)).collect();
        match &first {
            None => first = Some(bits),
            Some(expected) => changed += usize::from(*expected != bits),
        }
    }
    changed
}

/// The picture depends neither on the order of the catalogue nor on the order of addition: 100 shuffles, bit for bit.
#[test]
fn a_hundred_shuffles_give_identical_bits() {
    for method in [StarMethod::Auto, StarMethod::BSpline, StarMethod::Tent, StarMethod::PixelGaussian] {
        assert_eq!(changed_by_a_hundred_shuffles(method, false), 0, "{}", method.name());
    }
}

/// Sums in 16-bit floats and floating-point blending depend on the order of the stars; the shuffles must detect this.
#[test]
fn order_dependent_sums_are_detected() {
    for method in [StarMethod::PackedCas, StarMethod::PackedCasSorted, StarMethod::Disc] {
        let changed = changed_by_a_hundred_shuffles(method, false);
        println!("{}: {changed} of 100 shuffles change bits", method.name());
        assert!(changed > 90, "{}: {changed}", method.name());
    }
    // Sorting the catalogue before blending hides the dependence.
    assert_eq!(changed_by_a_hundred_shuffles(StarMethod::Disc, true), 0);
}

/// A star at the position of the camera, one behind it, and stars a millionth of a parsec away.
#[test]
fn stars_at_and_near_the_camera_stay_finite() {
    let mut renderer = renderer();
    let rig = rig(vec![
        ("flat", ViewKind::Perspective { size: [64, 64], fov_y_rad: 1.0 }),
        ("all", ViewKind::Equirectangular { size: [64, 32] }),
        ("fisheye", ViewKind::Fisheye { size: [64, 64], mapping: FisheyeMapping::Stereographic, fov_rad: 5.0 }),
    ]);
    let placed = |position: DVec3| StarRecord { position, magnitude: 4.8, temperature_k: 5772.0, distance_known: true };
    for position in [DVec3::ZERO, DVec3::Z, DVec3::NEG_Z * 1e-6, DVec3::Z * 1e-6, DVec3::new(1e-6, -1e-6, 0.0)] {
        let scene = snapshot(vec![placed(position), placed(DVec3::NEG_Z * 10.0)]);
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
        assert!(frame.exposure_ev100.is_finite());
        for image in &frame.images {
            assert!(
                image.hdr.as_ref().expect("asked for").iter().flatten().all(|value| value.is_finite()),
                "{position}"
            );
        }
        // The star ten parsecs ahead keeps its light, regardless of the stars near the camera.
        if position == DVec3::ZERO {
            let image = &frame.images[1];
            let mapping = rig.views()[1].images[0].projection.mapping();
            let error = illuminance_lx(image, mapping) / illuminance_lx_from_magnitude(4.8_f32.into()) - 1.0;
            assert!(error.abs() < 2.8e-5, "{error}");
        }
        if position.length() == 1e-6 {
            let mapping = rig.views()[1].images[0].projection.mapping();
            let expected =
                illuminance_lx_from_magnitude(4.8_f32.into()) * 1e14 + illuminance_lx_from_magnitude(4.8_f32.into());
            assert!((illuminance_lx(&frame.images[1], mapping) / expected - 1.0).abs() < 2.8e-5);
        }
    }
}

/// A camera among the stars: illuminances follow from the distances to the camera.
#[test]
fn a_camera_among_the_stars_sees_their_illuminance() {
    let mut renderer = renderer();
    let rig = rig(vec![("all", ViewKind::Equirectangular { size: [256, 128] })]);
    let mapping = rig.views()[0].images[0].projection.mapping();
    let records: Vec<StarRecord> = spiral(500)
        .enumerate()
        .map(|(i, d)| StarRecord {
            position: d * (1.5 + i as f64 * 0.02),
            magnitude: 5.0,
            temperature_k: 5772.0,
            distance_known: true,
        })
        .collect();
    for camera_pc in [DVec3::ZERO, DVec3::new(1.0, 0.5, -0.3), DVec3::new(0.0, 6.0, 0.0), DVec3::new(-200.0, 10.0, 3.0)]
    {
        let mut scene = snapshot(records.clone());
        scene.camera.position_m = camera_pc * steradian::units::PARSEC_M;
        let expected: f64 = records
            .iter()
            .map(|r| {
                illuminance_lx_from_magnitude(f64::from(r.magnitude)) * 100.0
                    / (r.position - camera_pc).length_squared()
            })
            .sum();
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::BSpline));
        let error = illuminance_lx(&frame.images[0], mapping) / expected - 1.0;
        println!("camera at {camera_pc} pc: relative error {error:.1e}");
        assert!(error.abs() < 1e-4, "{camera_pc}: {error}");
    }
}

/// The same frame five times gives the same bits.
#[test]
fn five_frames_are_identical() {
    let mut renderer = renderer();
    let scene = snapshot(spiral(20_000).enumerate().map(|(i, d)| star(d, (i % 12) as f32)).collect());
    let rig = rig(vec![("a", ViewKind::Equirectangular { size: [256, 128] }), ("b", all_views()[5].1.clone())]);
    let mut frames = (0..5).map(|_| {
        let frame = renderer
            .render(FrameRequest::new(&scene, &rig).settings(&settings(StarMethod::Auto)).wanted(Wanted::both()))
            .expect("renders");
        let images: Vec<_> = frame.images.into_iter().map(|image| (image.hdr, image.display)).collect();
        (frame.exposure_ev100, images)
    });
    let first = frames.next().expect("five frames");
    assert!(frames.all(|frame| frame == first));
}

/// If the exposure is known beforehand, the resolve pass does the tone mapping; if it is metered, a separate pass does. Both give the same picture,
/// and it equals the f64 curve of the HDR image except for dither.
#[test]
fn resolve_and_tone_mapping_pass_give_the_same_display_image() {
    use steradian::{
        photometry::exposure::white_luminance_cd_m2,
        plan::settings::{ExposureSettings, Metering, ToneMapOperator, ToneMapSettings},
    };
    let mut renderer = renderer();
    let scene = snapshot(spiral(20_000).enumerate().map(|(i, d)| star(d, (i % 12) as f32)).collect());
    let rig = rig(vec![("a", ViewKind::Equirectangular { size: [256, 128] }), ("b", all_views()[5].1.clone())]);
    let operator_settings = |operator, desaturation, scotopic| ToneMapSettings {
        desaturation,
        scotopic,
        peak_cd_m2: 1e-3,
        ..ToneMapSettings::of(operator)
    };
    let plain = ToneMapOperator::ALL.map(|operator| operator_settings(operator, 0.0, 0.0));
    for tone_map in plain.into_iter().chain([
        operator_settings(ToneMapOperator::Filmic, 1.0, 0.7),
        operator_settings(ToneMapOperator::Srgb, 0.5, 0.0),
    ]) {
        let mut settings = settings(StarMethod::BSpline);
        settings.tone_map = tone_map;
        settings.exposure = ExposureSettings::auto(Metering::Mean);
        let operator = tone_map.operator;
        let mut render = |wanted: Wanted, ev100: Option<f64>| {
            renderer
                .render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(wanted).adapted_ev100(ev100))
                .expect("the frame renders")
        };
        let metered = render(Wanted { display: true, hdr: true, ..Wanted::default() }, None);
        let known = render(Wanted { display: true, hdr: false, ..Wanted::default() }, Some(metered.exposure_ev100));
        let other =
            render(Wanted { display: true, hdr: false, ..Wanted::default() }, Some(metered.exposure_ev100 + 1.0));
        let white = white_luminance_cd_m2(metered.exposure_ev100);
        for ((a, b), c) in metered.images.iter().zip(&known.images).zip(&other.images) {
            let (a_bytes, b_bytes) = (a.display.as_ref().expect("asked for"), b.display.as_ref().expect("asked for"));
            let off_by_more = a_bytes.iter().zip(b_bytes).filter(|(a, b)| a.abs_diff(**b) > 1).count();
            let different = a_bytes.iter().zip(b_bytes).filter(|(a, b)| a != b).count();
            // One pass computes the white luminance by exp2 in f32, and the other in f64, so a few pixels are rounded differently.
            assert!(off_by_more == 0 && different < a_bytes.len() / 1000, "{operator:?}: {different} bytes differ");
            let uses_exposure = operator != ToneMapOperator::Calibrated;
            assert!((Some(b_bytes) != c.display.as_ref()) == uses_exposure, "{operator:?}: another exposure");
            let hdr = a.hdr.as_ref().expect("asked for");
            for (pixel, bytes) in hdr.iter().zip(a_bytes.as_chunks::<4>().0) {
                let expected = tone_map.display_rgb([pixel[0], pixel[1], pixel[2]].map(f64::from), white);
                for (byte, value) in bytes.iter().zip(expected) {
                    assert!((f64::from(*byte) - value * 255.0).abs() <= 1.02, "{operator:?}: {byte} for {value}");
                }
            }
        }
    }
}

/// If images are drawn in strips and stars in batches and segments, as on an adapter with small bindings, the picture is the same bit for bit.
#[test]
fn strips_and_batches_give_the_same_bits() {
    let scene = snapshot(spiral(6000).enumerate().map(|(i, d)| star(d, (i % 14) as f32)).collect());
    let rig = rig(all_views());
    let images = |options: &GpuOptions| {
        let mut renderer = renderer_with(options);
        let frame = renderer
            .render(FrameRequest::new(&scene, &rig).settings(&settings(StarMethod::BSpline)).wanted(Wanted::both()))
            .expect("renders");
        let drawn: Vec<u64> = frame.views.iter().map(|view| view.stars_drawn).collect();
        (frame.images.into_iter().map(|image| (image.part, image.hdr)).collect::<Vec<_>>(), drawn)
    };
    let whole = images(&GpuOptions::default());
    // The limits allow 40 rows of 192 pixels at a time, and 2048 stars at a time.
    for limit in [16 * 192 * 40, 16 * 2048] {
        let cut = images(&GpuOptions { binding_limit_bytes: Some(limit), ..Default::default() });
        assert!(whole.0 == cut.0, "an image differs with {limit} bytes at a time");
        assert_eq!(whole.1, cut.1, "stars drawn");
    }
}

/// A single star beyond the range of a channel is refused as well.
#[test]
fn a_single_star_beyond_the_range_is_reported() {
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let rig = rig(vec![("v", ViewKind::Perspective { size: [9, 9], fov_y_rad: 0.5 })]);
        renderer.unit_factor = 1e6;
        let scene = snapshot(vec![star(DVec3::NEG_Z, 2.0)]);
        let result = renderer
            .render(FrameRequest::new(&scene, &rig).settings(&settings(StarMethod::BSpline)).wanted(Wanted::hdr()));
        assert!(matches!(result, Err(RenderError::Overflow(count)) if count > 0));
    }
}

/// An eye that is much nearer to a star than the camera sees its brightness at its own position.
#[test]
fn an_eye_apart_from_the_camera_sees_stars_from_its_position() {
    use steradian::{
        units::PARSEC_M,
        view::{Rig, View},
    };
    let mut renderer = renderer();
    let kind = ViewKind::Equirectangular { size: [64, 32] };
    let apart_m = DVec3::new(0.0, 0.0, -9e8);
    let views = vec![
        View::new("camera", kind.clone(), glam::DQuat::IDENTITY, DVec3::ZERO).expect("valid"),
        View::new("apart", kind.clone(), glam::DQuat::IDENTITY, apart_m).expect("valid"),
    ];
    let rig = Rig::new(views).expect("valid");
    // The star is 1e9 m ahead: ten times as far from the camera as from the eye.
    let place_m = DVec3::new(0.0, 0.0, -1e9);
    let near = StarRecord { position: place_m / PARSEC_M, magnitude: 4.8, temperature_k: 5772.0, distance_known: true };
    let far = StarRecord { position: DVec3::X * 10.0, ..near };
    let frame = render_hdr(&mut renderer, &snapshot(vec![near, far]), &rig, &settings(StarMethod::BSpline));
    let light = |eye_m: DVec3| {
        let distance_pc = (place_m - eye_m).length() / PARSEC_M;
        illuminance_lx_from_magnitude(4.8_f32.into()) * (100.0 / distance_pc.powi(2) + 1.0)
    };
    for (image, (view, eye)) in frame.images.iter().zip(rig.views().iter().zip([DVec3::ZERO, apart_m])) {
        let error = illuminance_lx(image, view.images[0].projection.mapping()) / light(eye) - 1.0;
        println!("view {}: {error:.1e}", view.name);
        assert!(error.abs() < 2.8e-5, "{}: {error}", view.name);
    }
    assert!(View::new("far", kind, glam::DQuat::IDENTITY, DVec3::X * 2e9).is_err(), "too far from the camera");
}

/// All views have one exposure, which is metered from the mean luminance over all pixels, weighted by their solid angles.
#[test]
fn the_exposure_is_metered_over_all_views_by_solid_angle() {
    use steradian::{
        photometry::exposure::metered_ev100,
        plan::settings::{ExposureValues, Metering},
    };
    let mut renderer = renderer();
    let crowded = |(i, d): (usize, DVec3)| star(d + DVec3::X * 0.8, (i % 9) as f32);
    let scene = snapshot(spiral(4000).enumerate().map(crowded).collect());
    let rig = rig(all_views());
    for (compensation_ev, max_ev100) in [(0.0, 24.0), (3.5, 24.0), (0.0, -15.0)] {
        let mut settings = settings(StarMethod::BSpline);
        settings.exposure =
            ExposureValues { metering: Metering::Mean, compensation_ev, max_ev100, ..Default::default() }.into();
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
        let (mut light, mut solid_angle, mut plain_sum, mut pixels) = (0.0, 0.0, 0.0, 0.0);
        let images = rig.views().iter().flat_map(|view| &view.images);
        for (image, of_view) in frame.images.iter().zip(images) {
            let mapping = of_view.projection.mapping();
            light += illuminance_lx(image, mapping);
            for (i, [r, g, b, _]) in image.hdr.as_ref().expect("asked for").iter().enumerate() {
                let omega = mapping.solid_angle_sr(i as u32 % image.width, i as u32 / image.width);
                if omega > 0.0 {
                    solid_angle += omega;
                    plain_sum += luminance([*r, *g, *b].map(f64::from));
                    pixels += 1.0;
                }
            }
        }
        let mean = light / solid_angle;
        let expected = metered_ev100(mean, compensation_ev, -20.0, max_ev100);
        let (metered, ev100) = (frame.mean_luminance_cd_m2, frame.exposure_ev100);
        println!("mean {mean:.6e} cd/m^2, metered {metered:.6e} cd/m^2; EV {ev100:.5}, expected EV {expected:.5}");
        // The meter divides by the closed form of a picture's solid angle. For round pictures 160 pixels wide, the sum over the pixels differs from
        // it by about 1e-3.
        assert!((metered / mean - 1.0).abs() < 2e-3);
        assert!((ev100 - expected).abs() < 3e-3 && ev100 == frame.metered_ev100);
        // The mean without weights is clearly different.
        let unweighted = metered_ev100(plain_sum / pixels, 0.0, -20.0, 24.0);
        assert!((unweighted - metered_ev100(mean, 0.0, -20.0, 24.0)).abs() > 0.01, "{unweighted}");
    }
}

/// A faint frame after a bright one has the same bits as one of a new renderer, for every method and size of the bright
/// frame, with or without readback, and also after an overflow.
#[test]
fn a_frame_does_not_depend_on_the_previous_frame() {
    let records =
        |brightest: f32| spiral(300).enumerate().map(move |(i, d)| star(d, brightest + (i % 7) as f32)).collect();
    let (bright, faint) = (snapshot(records(-9.0)), snapshot(records(9.0)));
    let flat = |size| ViewKind::Perspective { size, fov_y_rad: 1.3 };
    let lens = ViewKind::Fisheye { size: [90, 90], mapping: FisheyeMapping::Equidistant, fov_rad: 4.0 };
    let rigs = [rig(vec![("flat", flat([150, 110])), ("lens", lens)]), rig(vec![("small", flat([61, 37]))])];
    for force_u32_accumulator in [false, true] {
        let options =
            GpuOptions { force_u32_accumulator, binding_limit_bytes: Some(150 * 16 * 80), ..Default::default() };
        let new = rigs
            .each_ref()
            .map(|rig| render_hdr(&mut new_renderer_with(&options), &faint, rig, &settings(StarMethod::BSpline)));
        let mut used = renderer_with(&options);
        let mut step = 0;
        for before in &rigs {
            for (method, unit_factor, hdr) in [
                (StarMethod::BSpline, 1.0, true),
                (StarMethod::Auto, 1.0, false),
                (StarMethod::BSpline, 2f64.powi(40), true),
                (StarMethod::PackedCas, 1.0, true),
                (StarMethod::HardwarePoint, 1.0, false),
                (StarMethod::CellSky, 1.0, true),
            ] {
                used.unit_factor = unit_factor;
                let frame = used.render(
                    FrameRequest::new(&bright, before)
                        .settings(&settings(method))
                        .wanted(Wanted { hdr, ..Wanted::default() }),
                );
                used.unit_factor = 1.0;
                let overflowed = matches!(frame, Err(RenderError::Overflow(_)));
                assert!(frame.is_ok() != overflowed && overflowed == (unit_factor > 1.0), "{}", method.name());
                // Draw the small view and the large ones in alternation.
                let index = step % 2;
                step += 1;
                let found = render_hdr(&mut used, &faint, &rigs[index], &settings(StarMethod::BSpline));
                for (found, expected) in found.images.iter().zip(&new[index].images) {
                    assert!(found.hdr == expected.hdr, "after {} in {} views", method.name(), before.views().len());
                }
            }
        }
    }
}
