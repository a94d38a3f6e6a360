//! A moving camera: direction, light and colour of every star against the closed forms, and against the twin in f64.
//!
//! The closed forms stand here once more, so that nothing is compared with itself.

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

/// The angle from the velocity at which a star is seen; by tangents, which keep their digits at both ends.
fn aberrated(beta: f64, a: f64) -> f64 {
    2.0 * (((1.0 - beta) / (1.0 + beta)).sqrt() * (a / 2.0).tan()).atan()
}

/// The law of physics.md.
fn light(kelvin: f64, doppler: f64) -> f64 {
    luminance_cd_m2(doppler * kelvin) / luminance_cd_m2(kelvin) / (doppler * doppler)
}

fn moving(records: Vec<StarRecord>, camera: Camera) -> SceneSnapshot {
    SceneSnapshot { revision: 1, stars: Arc::new(StarSet::from_records(records)), objects: Default::default(), camera }
}

/// A narrow view, and its pixels.
fn narrow() -> Rig {
    rig(vec![("narrow", ViewKind::Perspective { size: [48, 48], fov_y_rad: 0.04 })])
}

/// What one star looks like.
struct Seen {
    illuminance_lx: f64,
    /// Distance of its centroid from where the closed form has it, pixels; NaN if it does not shine.
    centroid_error_px: f64,
    /// Mean colour of all pixels.
    rgb: [f64; 3],
}

/// One star in flight, in a view that looks a few pixels past where `expected` says it is seen.
fn look_at(renderer: &mut Renderer, record: StarRecord, camera: Camera, expected: DVec3, offset_px: DVec2) -> Seen {
    let rig = narrow();
    let mapping = rig.views()[0].images[0].projection.mapping();
    let axis = mapping.direction_from_pixel(DVec2::splat(24.0) + offset_px).expect("inside");
    let world_from_camera = DQuat::from_rotation_arc(axis, expected);
    let scene = moving(vec![record], Camera { world_from_camera, ..camera });
    let frame = render_hdr(renderer, &scene, &rig, &settings(StarMethod::BSpline));
    let pixels = frame.images[0].hdr.as_ref().expect("asked for");
    let place = mapping.pixel_from_direction(world_from_camera.conjugate() * expected).expect("inside");
    let image = hdr_view(&frame.images[0], mapping);
    Seen {
        illuminance_lx: illuminance_lx(&frame.images[0], mapping),
        centroid_error_px: centroid_px(&image, place, 100.0).map_or(f64::NAN, |found| (found - place).length()),
        rgb: [0, 1, 2].map(|channel| pixels.iter().map(|pixel| f64::from(pixel[channel])).sum()),
    }
}

/// Where the star of a case stands, and where it is seen.
fn place_and_sight(beta: f64, a: f64, turn: f64) -> (DVec3, DVec3) {
    let ahead = direction_of_travel();
    let (u, v) = ahead.any_orthonormal_pair();
    let side = u * turn.cos() + v * turn.sin();
    let at = |angle: f64| ahead * angle.cos() + side * angle.sin();
    (at(a), at(aberrated(beta, a)))
}

/// What is known of the case's star after packing: illuminance at rest and temperature.
fn packed(record: StarRecord) -> (f64, f64) {
    let set = StarSet::from_records(vec![record]);
    (set.stars[0].illuminance_at_1_pc_lx(), temperature_of_step_k(set.stars[0].temperature_step()))
}

#[test]
fn direction_light_and_colour_are_those_of_the_closed_forms() {
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
                let seen = look_at(&mut renderer, record, camera, expected, offset);
                cases += 1;
                if expected_lx < 1e-12 * at_rest_lx {
                    // Shifted far into the infrared: beyond what f32 and display can tell from nothing.
                    assert!(seen.illuminance_lx < 2e-12 * at_rest_lx);
                    dark += 1;
                    continue;
                }
                let case = format!("{beta} c, {degrees} degrees, {kelvin:.0} K");
                let flux_error = (seen.illuminance_lx / expected_lx - 1.0).abs();
                let colour_error = uv_distance(seen.rgb, rec709_in_gamut(d * kelvin)).expect("light");
                assert!(flux_error < 1.1e-4, "{case}: light off by {flux_error:.1e}");
                assert!(seen.centroid_error_px < 2.1e-3, "{case}: centroid off by {} px", seen.centroid_error_px);
                assert!(colour_error < 8.2e-4, "{case}: u'v' off by {colour_error}");
                (centroid, flux, colour) =
                    (centroid.max(seen.centroid_error_px), flux.max(flux_error), colour.max(colour_error));
            }
        }
        println!(
            "{beta} c, {cases} cases ({dark} in the dark): light within {flux:.1e}, centroid {centroid:.1e} px, u'v' {colour:.1e}"
        );
        assert!(dark < cases / 3);
    }
}

/// What the comparison above must not accept: other laws, and no law.
#[test]
fn other_laws_fail() {
    let mut renderer = renderer();
    let record = StarRecord { temperature_k: 5800.0, ..star(direction_of_travel(), 2.0) };
    let (at_rest_lx, kelvin) = packed(record);
    let d = doppler(0.9, 0.0);
    let camera = Camera { velocity_c: direction_of_travel() * 0.9, ..Camera::default() };
    let seen = look_at(&mut renderer, record, camera, direction_of_travel(), DVec2::new(0.4, 1.3));
    let growth = seen.illuminance_lx / at_rest_lx;
    println!("5800 K head-on at 0.9 c: {growth:.4} times the light; D^2 = {:.1}, D^4 = {:.1}", d.powi(2), d.powi(4));
    assert!((growth / light(kelvin, d) - 1.0).abs() < 4e-6);
    assert!((growth - 2.6).abs() < 2.8e-3);
    for wrong in [1.0, d.powi(2), d.powi(4), light(kelvin, d) * d * d, light(kelvin, 1.0 / d)] {
        assert!((growth / wrong - 1.0).abs() > 0.5, "{wrong}");
    }
    // The colour at rest, and the place without aberration or with its sense reversed.
    assert!(uv_distance(seen.rgb, rec709_in_gamut(kelvin)).expect("light") > 0.03);
    let (direction, expected) = place_and_sight(0.9, 1.0, 0.4);
    for wrong in [direction, place_and_sight(-0.9, 1.0, 0.4).1] {
        let record = StarRecord { position: direction, ..record };
        let error = look_at(&mut renderer, record, camera, wrong, DVec2::ZERO).centroid_error_px;
        assert!(error.is_nan(), "a star where there is none");
        let right = look_at(&mut renderer, record, camera, expected, DVec2::ZERO).centroid_error_px;
        assert!(right < 8e-5);
    }
}

/// Stars with a distance, seen from far away from the Sun; the nearest of them go through f64 one by one.
#[test]
fn stars_near_the_camera_obey_the_same_laws() {
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
                let seen = look_at(&mut renderer, record, camera, expected, DVec2::new(3.2, -1.4));
                let expected_lx = at_1_pc_lx / distance_pc.powi(2) * light(kelvin, doppler(beta, a));
                worst.0 = worst.0.max((seen.illuminance_lx / expected_lx - 1.0).abs());
                worst.1 = worst.1.max(seen.centroid_error_px);
            }
        }
    }
    println!("stars with a distance: light within {:.1e}, centroid {:.1e} px", worst.0, worst.1);
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
            // Beside the light ahead, what is behind may be worth a few units: a unit for each of some stars.
            let free_lx = 10.0 * unit_lx(&frame);
            for (image, view_image) in frame.images.iter().zip(&rig.views()[0].images) {
                let mapping = view_image.projection.mapping();
                let world_from_view = view_image.camera_from_view;
                let eye = Eye { position_m: DVec3::ZERO, world_from_view, velocity_c };
                let twin = draw(&scene.stars, eye, mapping, |_| Some(SplatKernel::BSpline));
                worst = worst.max(differences_from_twin(image, &twin, mapping, free_lx, |rgb| [luminance(rgb)]));
                // A channel may be next to nothing in a saturated colour: what counts is how it compares with the light.
                let with_luminance = |rgb: [f64; 3]| rgb.map(|channel| channel + luminance(rgb));
                worst_channel =
                    worst_channel.max(differences_from_twin(image, &twin, mapping, free_lx, with_luminance));
                // The twin at rest is another picture.
                let resting = Eye { velocity_c: DVec3::ZERO, ..eye };
                let wrong = draw(&scene.stars, resting, mapping, |_| Some(SplatKernel::BSpline));
                assert!(difference_from_twin(image, &wrong, mapping) > 0.5);
            }
            println!("{beta} c, {name}: from f64, luminance within {worst:.1e}, colour {worst_channel:.1e}");
            // Shifted temperatures are rounded to steps of 0.26 %.
            assert!(worst < 4.5e-4 && worst_channel < 3e-3, "{beta} c, {name}: {worst} {worst_channel}");
        }
    }
}

/// All of the sky's light, in views that show all of it.
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
            println!("{beta} c, {name}: light of the whole sky off by {error:.1e}");
            assert!(error.abs() < 2.4e-5);
        }
    }
}

/// The limit is that of the light that arrives: stars ahead come up over it, stars behind sink below.
#[test]
fn the_magnitude_limit_counts_the_light_that_arrives() {
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
        // The shader's light is good to 2e-4: stars so near to the limit may fall on either side.
        let (fewest, most) = (brighter_than(limit_lx * 1.0002), brighter_than(limit_lx * 0.9998));
        println!("{beta} c: {drawn} of 4000 stars above the limit, closed form {fewest} to {most}");
        assert!((fewest..=most).contains(&drawn));
        assert!(most - fewest < 10);
        counts.push(drawn);
    }
    assert!(counts.windows(2).all(|pair| pair[0] != pair[1]), "the limit takes no notice of the speed");
}

/// Lux per unit of the coarsest sums, from the certificate.
fn unit_lx(frame: &Frame) -> f64 {
    let units = frame.plan.certificate.iter().filter(|entry| entry.what.starts_with("rounding of "));
    units.map(|entry| entry.bound).fold(0.0, f64::max)
}

/// With culling and without, the same stars and the same light.
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
                // Without culling the unit is that of the whole sky's light, of which a view behind sees next to nothing:
                // each of nine pixels of each star is rounded by up to a unit, also of stars just outside of the picture.
                let outside = 300;
                let noise = 6.0 * unit_lx(&all) * (9.0 * (all.views[0].stars_drawn + outside) as f64).sqrt();
                assert!((a - b).abs() <= 1e-6 * b + noise, "{velocity_c} {name} {limit}: {a} {b} +- {noise}");
            }
        }
    }
}

/// Cool stars head-on grow a billionfold: the sums must hold that, and not those of the others.
#[test]
fn cool_stars_ahead_do_not_overflow_the_sums_nor_spoil_them() {
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
        "{count} stars of {cool_k:.0} K, {growth:.1e} times as bright each: off by {:.1e}",
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
fn no_velocity_is_no_change_and_little_velocity_little_change() {
    let mut renderer = renderer();
    let rig = rig(all_views());
    let mut render = |velocity_c: [f64; 3]| {
        let camera = Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.0], velocity_c).expect("a valid camera");
        render_hdr(&mut renderer, &moving(sky(), camera), &rig, &settings(StarMethod::Auto))
    };
    let at_rest = render([0.0; 3]);
    assert_eq!(bits(&at_rest), bits(&render([-0.0, 0.0, -0.0])));
    assert!(at_rest.plan.certificate.iter().all(|entry| !entry.what.contains("in flight")));
    let slow = render([0.0, 1e-9, 0.0]);
    let (a, b) = (total_illuminance_lx(&at_rest, &rig), total_illuminance_lx(&slow, &rig));
    assert!((b / a - 1.0).abs() < 1.5e-6, "{a} {b}");
    let fast = render([0.0, 0.9, 0.0]);
    assert_ne!(bits(&at_rest), bits(&fast));
    let in_flight: Vec<_> = fast.plan.certificate.iter().filter(|entry| entry.what.contains("in flight")).collect();
    for entry in &in_flight {
        println!("0.9 c, certificate: {} {:.1e} {}", entry.what, entry.bound, entry.unit);
        assert!(entry.bound > 0.0 && entry.bound < 0.1);
    }
    assert_eq!(in_flight.len(), 3);
}

/// A step of the temperature is no more than the certificate says.
#[test]
fn the_certificate_bounds_what_temperatures_in_steps_do() {
    let (beta, kelvin) = (0.9, 3000.0_f32);
    let record = |temperature_k: f32| StarRecord { temperature_k, ..star(direction_of_travel(), 2.0) };
    let camera = Camera { velocity_c: direction_of_travel() * beta, ..Camera::default() };
    let rig = rig(vec![("sky", ViewKind::Equirectangular { size: [32, 16] })]);
    let scene = moving(vec![record(kelvin)], camera);
    let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::BSpline));
    let bound =
        frame.plan.certificate.iter().find(|entry| entry.what.contains("temperature in 11 bits")).expect("in flight");
    let mut worst = 0.0_f64;
    for part in 0..50 {
        let kelvin = f64::from(kelvin) * (1.0 + f64::from(part) * 1e-4);
        for degrees in 0..=18 {
            let d = doppler(beta, f64::from(degrees * 10).to_radians());
            let held = light(packed(record(kelvin as f32)).1, d);
            let exact = light(kelvin, d);
            worst = worst.max((held - exact).abs() / exact.max(1.0));
        }
    }
    println!("light of stars of 3000 K at 0.9 c: off by {worst:.1e} for want of bits, certificate {:.1e}", bound.bound);
    assert!(worst <= bound.bound && worst > 0.1 * bound.bound);
}
