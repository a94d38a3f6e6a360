//! A moving camera: direction, light and colour of every star, compared with closed forms and with the f64 reference.
//!
//! The closed forms are repeated here, so that the code is not compared with itself.

use std::sync::Arc;

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use steradian::{
    catalogue::{StarRecord, chunks::StarSet, packed::temperature_of_step_k},
    metrics::{centroid_px, uv_distance},
    photometry::{
        blackbody::{luminance_cd_m2, rec709_in_gamut},
        kernel::SplatKernel,
        rec709::luminance,
    },
    plan::settings::StarMethod,
    reference::stars::splat::{Eye, draw},
    render::{Frame, Renderer},
    scene::{Camera, SceneSnapshot},
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{Rig, ViewKind, projection::Face},
};

const SPEEDS: [f64; 4] = [0.1, 0.5, 0.9, 0.99];
const ANGLES_DEG: [f64; 9] = [0.0, 1.0, 25.0, 60.0, 90.0, 120.0, 150.0, 178.0, 180.0];
const TEMPERATURES_K: [f32; 5] = [1500.0, 3000.0, 5800.0, 12_000.0, 40_000.0];

fn direction_of_travel() -> DVec3 {
    DVec3::new(0.36, -0.48, 0.8)
}

fn doppler(beta: f64, a: f64) -> f64 {
    (1.0 + beta * a.cos()) / (1.0 - beta * beta).sqrt()
}

/// Returns the angle from the velocity at which a star appears. The form with tangents is accurate near 0 and pi.
fn aberrated(beta: f64, a: f64) -> f64 {
    2.0 * (((1.0 - beta) / (1.0 + beta)).sqrt() * (a / 2.0).tan()).atan()
}

/// Returns the ratio of the light of a blackbody star in flight to its light at rest. Its spectrum remains that of a blackbody, with the temperature
/// multiplied by the Doppler factor. The solid angle is divided by the square of this factor.
fn light(kelvin: f64, doppler: f64) -> f64 {
    luminance_cd_m2(doppler * kelvin) / luminance_cd_m2(kelvin) / (doppler * doppler)
}

fn moving(records: Vec<StarRecord>, camera: Camera) -> SceneSnapshot {
    SceneSnapshot { revision: 1, stars: Arc::new(StarSet::from_records(records)), objects: Default::default(), camera }
}

/// Returns a narrow view of 48 x 48 pixels.
fn narrow() -> Rig {
    rig(vec![("narrow", ViewKind::Perspective { size: [48, 48], fov_y_rad: 0.04 })])
}

/// Measured image of one star.
struct Measured {
    illuminance_lx: f64,
    /// Distance of the centroid from the expected position, pixels; NaN if the star is not visible.
    centroid_error_px: f64,
    /// Sum of all pixels by channel.
    rgb: [f64; 3],
}

/// Draws one star in flight, in a view whose centre is a few pixels off the direction `expected`.
fn look_at(renderer: &mut Renderer, record: StarRecord, camera: Camera, expected: DVec3, offset_px: DVec2) -> Measured {
    let rig = narrow();
    let mapping = rig.views()[0].images[0].projection.mapping();
    let axis = mapping.direction_from_pixel(DVec2::splat(24.0) + offset_px).expect("inside");
    let world_from_camera = DQuat::from_rotation_arc(axis, expected);
    let scene = moving(vec![record], Camera { world_from_camera, ..camera });
    let frame = render_hdr(renderer, &scene, &rig, &settings(StarMethod::BSpline));
    let pixels = frame.images[0].hdr.as_ref().expect("asked for");
    let place = mapping.pixel_from_direction(world_from_camera.conjugate() * expected).expect("inside");
    let image = hdr_view(&frame.images[0], mapping);
    Measured {
        illuminance_lx: illuminance_lx(&frame.images[0], mapping),
        centroid_error_px: centroid_px(&image, place, 100.0).map_or(f64::NAN, |found| (found - place).length()),
        rgb: [0, 1, 2].map(|channel| pixels.iter().map(|pixel| f64::from(pixel[channel])).sum()),
    }
}

/// Returns the direction of a star at rest, at the angle `a` from the velocity, and its aberrated direction.
fn place_and_sight(beta: f64, a: f64, turn: f64) -> (DVec3, DVec3) {
    let ahead = direction_of_travel();
    let (u, v) = ahead.any_orthonormal_pair();
    let side = u * turn.cos() + v * turn.sin();
    let direction_at = |angle: f64| ahead * angle.cos() + side * angle.sin();
    (direction_at(a), direction_at(aberrated(beta, a)))
}

/// Returns the illuminance at rest and the temperature of a star after packing, which rounds them.
fn packed(record: StarRecord) -> (f64, f64) {
    let set = StarSet::from_records(vec![record]);
    (set.stars[0].illuminance_at_1_pc_lx(), temperature_of_step_k(set.stars[0].temperature_step()))
}

#[test]
fn direction_light_and_colour_equal_the_closed_forms() {
    let mut renderer = renderer();
    for beta in SPEEDS {
        let (mut centroid, mut flux, mut colour, mut dark) = (0.0_f64, 0.0_f64, 0.0_f64, 0);
        let mut cases = 0;
        for (i, degrees) in ANGLES_DEG.into_iter().enumerate() {
            for (j, temperature_k) in TEMPERATURES_K.into_iter().enumerate() {
                let a = degrees.to_radians();
                let (direction, expected) = place_and_sight(beta, a, i as f64 + 0.3 * j as f64);
                let record = StarRecord { temperature_k, ..star(direction, 2.0) };
                let (at_rest_lx, kelvin) = packed(record);
                let d = doppler(beta, a);
                let expected_lx = at_rest_lx * light(kelvin, d);
                let velocity_c = direction_of_travel() * beta;
                let camera = Camera { velocity_c, ..Camera::default() };
                let offset = DVec2::new(1.7 * i as f64 - 5.0, 2.3 * j as f64 - 4.0) * 1.111;
                let measured = look_at(&mut renderer, record, camera, expected, offset);
                cases += 1;
                if expected_lx < 1e-12 * at_rest_lx {
                    // The light is shifted far into the infrared, so it is too faint for f32.
                    assert!(measured.illuminance_lx < 2e-12 * at_rest_lx);
                    dark += 1;
                    continue;
                }
                let case = format!("{beta} c, {degrees} degrees, {kelvin:.0} K");
                let flux_error = (measured.illuminance_lx / expected_lx - 1.0).abs();
                let colour_error = uv_distance(measured.rgb, rec709_in_gamut(d * kelvin)).expect("light");
                assert!(flux_error < 1.1e-4, "{case}: relative error of the light {flux_error:.1e}");
                assert!(
                    measured.centroid_error_px < 2.1e-3,
                    "{case}: centroid off by {} px",
                    measured.centroid_error_px
                );
                assert!(colour_error < 8.2e-4, "{case}: error of u'v' {colour_error}");
                (centroid, flux, colour) =
                    (centroid.max(measured.centroid_error_px), flux.max(flux_error), colour.max(colour_error));
            }
        }
        println!(
            "{beta} c, {cases} cases ({dark} too faint), largest errors: light {flux:.1e}, centroid {centroid:.1e} px, u'v' {colour:.1e}"
        );
        assert!(dark < cases / 3);
    }
}

/// The comparison above must fail for other laws, and for the light at rest.
#[test]
fn other_relativistic_laws_fail_the_comparison() {
    let mut renderer = renderer();
    let record = StarRecord { temperature_k: 5800.0, ..star(direction_of_travel(), 2.0) };
    let (at_rest_lx, kelvin) = packed(record);
    let d = doppler(0.9, 0.0);
    let camera = Camera { velocity_c: direction_of_travel() * 0.9, ..Camera::default() };
    let measured = look_at(&mut renderer, record, camera, direction_of_travel(), DVec2::new(0.4, 1.3));
    let growth = measured.illuminance_lx / at_rest_lx;
    println!("5800 K head-on at 0.9 c: {growth:.4} times the light; D^2 = {:.1}, D^4 = {:.1}", d.powi(2), d.powi(4));
    assert!((growth / light(kelvin, d) - 1.0).abs() < 4e-6);
    assert!((growth - 2.6).abs() < 2.8e-3);
    for wrong in [1.0, d.powi(2), d.powi(4), light(kelvin, d) * d * d, light(kelvin, 1.0 / d)] {
        assert!((growth / wrong - 1.0).abs() > 0.5, "{wrong}");
    }
    // The wrong laws have the colour at rest, or the position without aberration or with aberration of the opposite sign.
    assert!(uv_distance(measured.rgb, rec709_in_gamut(kelvin)).expect("light") > 0.03);
    let (direction, expected) = place_and_sight(0.9, 1.0, 0.4);
    for wrong in [direction, place_and_sight(-0.9, 1.0, 0.4).1] {
        let record = StarRecord { position: direction, ..record };
        let error = look_at(&mut renderer, record, camera, wrong, DVec2::ZERO).centroid_error_px;
        assert!(error.is_nan(), "no star is expected here");
        let right = look_at(&mut renderer, record, camera, expected, DVec2::ZERO).centroid_error_px;
        assert!(right < 8e-5);
    }
}

/// Stars with a known distance, seen from far away from the Sun. The renderer processes the nearest of them individually in f64.
#[test]
fn stars_near_a_moving_camera_equal_the_closed_forms() {
    let mut renderer = renderer();
    let camera_pc = DVec3::new(12.0, -7.0, 3.0);
    let mut worst = (0.0_f64, 0.0_f64);
    for beta in SPEEDS {
        for distance_pc in [1e-4, 0.3, 40.0] {
            for degrees in [3.0_f64, 70.0, 140.0] {
                let a = degrees.to_radians();
                let (direction, expected) = place_and_sight(beta, a, distance_pc);
                let position = camera_pc + direction * distance_pc;
                let record = StarRecord { position, magnitude: 4.0, temperature_k: 9000.0, distance_known: true };
                let (at_1_pc_lx, kelvin) = packed(record);
                let velocity_c = direction_of_travel() * beta;
                let camera = Camera { position_m: camera_pc * PARSEC_M, velocity_c, ..Camera::default() };
                let measured = look_at(&mut renderer, record, camera, expected, DVec2::new(3.2, -1.4));
                let expected_lx = at_1_pc_lx / distance_pc.powi(2) * light(kelvin, doppler(beta, a));
                worst.0 = worst.0.max((measured.illuminance_lx / expected_lx - 1.0).abs());
                worst.1 = worst.1.max(measured.centroid_error_px);
            }
        }
    }
    println!("stars with a distance, largest errors: light {:.1e}, centroid {:.1e} px", worst.0, worst.1);
    assert!(worst.0 < 1.3e-5 && worst.1 < 7.4e-4);
}

fn sky() -> Vec<StarRecord> {
    let kelvin = |i: usize| 1500.0 * 1.6_f32.powi((i % 9) as i32);
    spiral(3000).enumerate().map(|(i, d)| StarRecord { temperature_k: kelvin(i), ..star(d, (i % 7) as f32) }).collect()
}

#[test]
fn the_adapter_and_the_f64_twin_draw_the_same_picture() {
    let mut renderer = renderer();
    for beta in [0.5, 0.99] {
        let velocity_c = direction_of_travel() * beta;
        let scene = moving(sky(), Camera { velocity_c, ..Camera::default() });
        for (name, kind) in all_views() {
            let rig = rig(vec![(name, kind)]);
            let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::BSpline));
            let (mut worst, mut worst_channel) = (0.0_f64, 0.0_f64);
            // The light behind is so faint, compared with that ahead, that it may be only a few units of the sums: allow an error of one unit for
            // each of 10 stars.
            let free_lx = 10.0 * unit_lx(&frame);
            for (image, view_image) in frame.images.iter().zip(&rig.views()[0].images) {
                let mapping = view_image.projection.mapping();
                let world_from_view = view_image.camera_from_view;
                let eye = Eye { position_m: DVec3::ZERO, world_from_view, velocity_c };
                let twin = draw(&scene.stars, eye, mapping, |_| Some(SplatKernel::BSpline));
                worst = worst.max(differences_from_twin(image, &twin, mapping, free_lx, |rgb| [luminance(rgb)]));
                // In a saturated colour a channel may be almost zero, so its error is taken relative to the luminance.
                let with_luminance = |rgb: [f64; 3]| rgb.map(|channel| channel + luminance(rgb));
                worst_channel =
                    worst_channel.max(differences_from_twin(image, &twin, mapping, free_lx, with_luminance));
                // The reference at rest fails the comparison.
                let resting = Eye { velocity_c: DVec3::ZERO, ..eye };
                let wrong = draw(&scene.stars, resting, mapping, |_| Some(SplatKernel::BSpline));
                assert!(difference_from_twin(image, &wrong, mapping) > 0.5);
            }
            println!(
                "{beta} c, {name}: largest difference from f64, luminance {worst:.1e}, channels {worst_channel:.1e}"
            );
            // Shifted temperatures are rounded to steps of 0.26 %.
            assert!(worst < 4.5e-4 && worst_channel < 3e-3, "{beta} c, {name}: {worst} {worst_channel}");
        }
    }
}

/// The total light of the sky, in views that show all of it.
#[test]
fn the_whole_sky_has_the_light_of_the_closed_form() {
    let mut renderer = renderer();
    let set = StarSet::from_records(sky());
    for beta in SPEEDS {
        let expected: f64 = set
            .iter()
            .map(|(direction, _, star)| {
                let a = direction.angle_between(direction_of_travel());
                let kelvin = temperature_of_step_k(star.temperature_step());
                star.illuminance_at_1_pc_lx() * light(kelvin, doppler(beta, a))
            })
            .sum();
        let camera = Camera { velocity_c: direction_of_travel() * beta, ..Camera::default() };
        for (name, kind) in [
            ("cube", ViewKind::Cubemap { face_size: 64, faces: Face::ALL.to_vec() }),
            ("equirectangular", ViewKind::Equirectangular { size: [192, 96] }),
        ] {
            let rig = rig(vec![(name, kind)]);
            let frame = render_hdr(&mut renderer, &moving(sky(), camera), &rig, &settings(StarMethod::Auto));
            let error = total_illuminance_lx(&frame, &rig) / expected - 1.0;
            println!("{beta} c, {name}: relative error of the light of the whole sky {error:.1e}");
            assert!(error.abs() < 2.4e-5);
        }
    }
}

/// The magnitude limit applies to the received light. Stars ahead can become brighter than the limit, and stars behind can become fainter.
#[test]
fn the_magnitude_limit_applies_to_the_received_light() {
    let mut renderer = renderer();
    let records: Vec<StarRecord> =
        spiral(4000).enumerate().map(|(i, d)| star(d, 4.0 + (i % 41) as f32 * 0.1)).collect();
    let set = StarSet::from_records(records.clone());
    let rig = rig(vec![("sky", ViewKind::Equirectangular { size: [192, 96] })]);
    let mut settings = settings(StarMethod::BSpline);
    settings.stars.magnitude_limit = 6.03;
    let limit_lx = illuminance_lx_from_magnitude(6.03);
    let mut counts = Vec::new();
    for beta in [0.0, 0.1, 0.5, 0.9, 0.99] {
        let received: Vec<f64> = set
            .iter()
            .map(|(direction, _, star)| {
                let a = direction.angle_between(direction_of_travel());
                let kelvin = temperature_of_step_k(star.temperature_step());
                star.illuminance_at_1_pc_lx() * light(kelvin, doppler(beta, a))
            })
            .collect();
        let brighter_than = |lx: f64| received.iter().filter(|received| **received >= lx).count() as u64;
        let camera = Camera { velocity_c: direction_of_travel() * beta, ..Camera::default() };
        let frame = render_hdr(&mut renderer, &moving(records.clone(), camera), &rig, &settings);
        let drawn = frame.views[0].stars_drawn;
        // The shader is accurate to 2e-4: stars this near to the limit may be on either side.
        let (fewest, most) = (brighter_than(limit_lx * 1.0002), brighter_than(limit_lx * 0.9998));
        println!("{beta} c: {drawn} of 4000 stars are brighter than the limit, {fewest} to {most} by the closed form");
        assert!((fewest..=most).contains(&drawn));
        assert!(most - fewest < 10);
        counts.push(drawn);
    }
    assert!(counts.windows(2).all(|pair| pair[0] != pair[1]), "the number of stars depends on the speed");
}

/// Unit of the coarsest sums, lx, from the certificate.
fn unit_lx(frame: &Frame) -> f64 {
    let units = frame.plan.certificate.iter().filter(|entry| entry.name.starts_with("rounding of "));
    units.map(|entry| entry.bound).fold(0.0, f64::max)
}

/// Culling changes neither the stars nor their light.
#[test]
fn culling_loses_no_star_in_flight() {
    let mut renderer = renderer();
    let records: Vec<StarRecord> = spiral(30_000)
        .enumerate()
        .map(|(i, d)| {
            let distance_pc = if i % 5 == 0 { 1.0 } else { 2.0 + (i % 97) as f64 };
            let temperature_k = 2000.0 + (i % 50) as f32 * 400.0;
            StarRecord { position: d * distance_pc, magnitude: 5.0, temperature_k, distance_known: i % 5 != 0 }
        })
        .collect();
    for velocity_c in
        [direction_of_travel() * 0.5, direction_of_travel() * -0.99, DVec3::NEG_Z * 0.9, DVec3::Z * 0.9999]
    {
        let camera = Camera { velocity_c, position_m: DVec3::new(3.0, 1.0, -2.0) * PARSEC_M, ..Camera::default() };
        let scene = moving(records.clone(), camera);
        for limit in [99.0, 9.0] {
            let mut settings = settings(StarMethod::BSpline);
            settings.stars.magnitude_limit = limit;
            for (name, kind) in all_views() {
                let rig = rig(vec![(name, kind)]);
                renderer.culling = true;
                let culled = render_hdr(&mut renderer, &scene, &rig, &settings);
                renderer.culling = false;
                let all = render_hdr(&mut renderer, &scene, &rig, &settings);
                assert_eq!(culled.views[0].stars_drawn, all.views[0].stars_drawn, "{velocity_c} {name} {limit}");
                let (a, b) = (total_illuminance_lx(&culled, &rig), total_illuminance_lx(&all, &rig));
                // Without culling, the unit follows from the light of the whole sky. Compared with it, a view to the back is almost dark. Each of the
                // nine pixels of each star is rounded by up to a unit, also for stars just outside of the picture.
                let outside = 300;
                let noise = 6.0 * unit_lx(&all) * (9.0 * (all.views[0].stars_drawn + outside) as f64).sqrt();
                assert!((a - b).abs() <= 1e-6 * b + noise, "{velocity_c} {name} {limit}: {a} {b} +- {noise}");
            }
        }
    }
}

/// Cool stars straight ahead become a billion times brighter: the sums must not overflow, and other stars must keep their light.
#[test]
fn cool_stars_ahead_do_not_overflow_the_sums() {
    let mut renderer = renderer();
    let ahead = direction_of_travel();
    let (beta, count) = (0.99, 3000);
    let mut records = vec![StarRecord { temperature_k: 700.0, ..star(ahead, 12.0) }; count];
    let hot = StarRecord { temperature_k: 9000.0, ..star(place_and_sight(beta, 0.1, 0.0).0, 12.0) };
    records.push(hot);
    let camera = Camera {
        velocity_c: ahead * beta,
        world_from_camera: DQuat::from_rotation_arc(DVec3::NEG_Z, ahead),
        ..Camera::default()
    };
    let rig = narrow();
    let frame = render_hdr(&mut renderer, &moving(records, camera), &rig, &settings(StarMethod::BSpline));
    let (cool_lx, cool_k) = packed(StarRecord { temperature_k: 700.0, ..star(ahead, 12.0) });
    let (hot_lx, hot_k) = packed(hot);
    let growth = light(cool_k, doppler(beta, 0.0));
    let cool = count as f64 * cool_lx * growth;
    let expected = cool + hot_lx * light(hot_k, doppler(beta, 0.1));
    let found = total_illuminance_lx(&frame, &rig);
    println!(
        "{count} stars of {cool_k:.0} K, each {growth:.1e} times as bright: relative error {:.1e}",
        found / expected - 1.0
    );
    assert!(growth > 1e9);
    assert!((found / expected - 1.0).abs() < 1.6e-5);
}

fn bits(frame: &Frame) -> Vec<[u32; 4]> {
    let pixels = frame.images.iter().flat_map(|image| image.hdr.as_ref().expect("asked for"));
    pixels.map(|pixel| pixel.map(f32::to_bits)).collect()
}

#[test]
fn zero_velocity_changes_nothing_and_a_tiny_one_almost_nothing() {
    let mut renderer = renderer();
    let rig = rig(all_views());
    let mut render = |velocity_c: [f64; 3]| {
        let camera = Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.0], velocity_c).expect("a valid camera");
        render_hdr(&mut renderer, &moving(sky(), camera), &rig, &settings(StarMethod::Auto))
    };
    let at_rest = render([0.0; 3]);
    assert_eq!(bits(&at_rest), bits(&render([-0.0, 0.0, -0.0])));
    assert!(at_rest.plan.certificate.iter().all(|entry| !entry.name.contains("moving camera")));
    let slow = render([0.0, 1e-9, 0.0]);
    let (a, b) = (total_illuminance_lx(&at_rest, &rig), total_illuminance_lx(&slow, &rig));
    assert!((b / a - 1.0).abs() < 1.5e-6, "{a} {b}");
    let fast = render([0.0, 0.9, 0.0]);
    assert_ne!(bits(&at_rest), bits(&fast));
    let in_flight: Vec<_> = fast.plan.certificate.iter().filter(|entry| entry.name.contains("moving camera")).collect();
    for entry in &in_flight {
        println!("0.9 c, certificate: {} {:.1e} {}", entry.name, entry.bound, entry.unit);
        assert!(entry.bound > 0.0 && entry.bound < 0.1);
    }
    assert_eq!(in_flight.len(), 3);
}

/// The error from rounding the temperature is within the bound of the certificate.
#[test]
fn the_certificate_bounds_the_error_of_rounded_temperatures() {
    let (beta, kelvin) = (0.9, 3000.0_f32);
    let record = |temperature_k: f32| StarRecord { temperature_k, ..star(direction_of_travel(), 2.0) };
    let camera = Camera { velocity_c: direction_of_travel() * beta, ..Camera::default() };
    let rig = rig(vec![("sky", ViewKind::Equirectangular { size: [32, 16] })]);
    let scene = moving(vec![record(kelvin)], camera);
    let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::BSpline));
    let bound =
        frame.plan.certificate.iter().find(|entry| entry.name.contains("temperature in 11 bits")).expect("in flight");
    let mut worst = 0.0_f64;
    for part in 0..50 {
        let kelvin = f64::from(kelvin) * (1.0 + f64::from(part) * 1e-4);
        for degrees in 0..=18 {
            let d = doppler(beta, f64::from(degrees * 10).to_radians());
            let rounded = light(packed(record(kelvin as f32)).1, d);
            let exact = light(kelvin, d);
            worst = worst.max((rounded - exact).abs() / exact.max(1.0));
        }
    }
    println!(
        "light of stars of 3000 K at 0.9 c: error from rounded temperatures {worst:.1e}, certificate {:.1e}",
        bound.bound
    );
    assert!(worst <= bound.bound && worst > 0.1 * bound.bound);
}
