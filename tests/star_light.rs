//! The light of stars: every view shows exactly the illuminance that the catalogue says, wherever the star stands.
//!
//! Solid angles come from f64 here, never from the shader.

mod common;

use std::f64::consts::{PI, TAU};

use common::*;
use glam::{DVec2, DVec3};
use steradian::{
    catalogue::StarRecord,
    frame::RenderError,
    gpu::GpuOptions,
    photometry::{blackbody::rec709_in_gamut, rec709::luminance, rec709::uv_prime},
    plan::settings::StarMethod,
    units::illuminance_lx_from_magnitude,
    view::{
        Fov, ViewKind,
        projection::{Face, FisheyeMapping, PlaneMapping},
    },
};

/// Every projection, each with its name.
fn all_views() -> Vec<(&'static str, ViewKind)> {
    let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.85 };
    let fisheye =
        |mapping, degrees: f64| ViewKind::Fisheye { size: [160, 160], mapping, fov_rad: degrees.to_radians() };
    vec![
        ("perspective", ViewKind::Perspective { size: [192, 108], fov_y_rad: PI / 3.0 }),
        ("perspective-150", ViewKind::Perspective { size: [160, 160], fov_y_rad: 150f64.to_radians() }),
        ("off-axis", ViewKind::OffAxis { size: [128, 130], fov }),
        ("stereo", ViewKind::Stereo { size: [96, 100], ipd_m: 0.064, fov_left: fov, fov_right: fov.mirrored() }),
        ("cube", ViewKind::Cubemap { face_size: 64, faces: Face::ALL.to_vec() }),
        ("equidistant-180", fisheye(FisheyeMapping::Equidistant, 180.0)),
        ("equidistant-360", fisheye(FisheyeMapping::Equidistant, 360.0)),
        ("equisolid-220", fisheye(FisheyeMapping::Equisolid, 220.0)),
        ("orthographic-180", fisheye(FisheyeMapping::Orthographic, 180.0)),
        ("stereographic-220", fisheye(FisheyeMapping::Stereographic, 220.0)),
        ("domemaster", ViewKind::DomeMaster { size: 160, fov_rad: PI, tilt_rad: 0.3 }),
        ("equirectangular", ViewKind::Equirectangular { size: [192, 96] }),
    ]
}

/// Up to `count` directions whose whole kernel lies inside every image of the view.
fn directions_inside(kind: &ViewKind, count: usize) -> Vec<DVec3> {
    let view = view("v", kind.clone());
    let inside = |direction: DVec3| {
        let taps_inside = |mapping: &dyn PlaneMapping, direction: DVec3| {
            let Some(pixel) = mapping.pixel_from_direction(direction) else { return false };
            (-2..=2).all(|j| {
                (-2..=2).all(|i| {
                    let at = pixel + DVec2::new(f64::from(i), f64::from(j));
                    at.x >= 0.0 && at.y >= 0.0 && mapping.contains(at.x as u32, at.y as u32)
                })
            })
        };
        let images = view
            .images
            .iter()
            .map(|image| taps_inside(image.projection.mapping(), image.camera_from_view.conjugate() * direction));
        match kind {
            // A cubemap shares its edges; a star needs to be inside of one face only.
            ViewKind::Cubemap { .. } => images.into_iter().any(|inside| inside),
            _ => images.into_iter().all(|inside| inside),
        }
    };
    let found: Vec<DVec3> = spiral(20_000).filter(|direction| inside(*direction)).collect();
    let step = (found.len() / count).max(1);
    found.into_iter().step_by(step).take(count).collect()
}

/// Every whole magnitude from -1 to 15, a catalogue each, at 50 directions in every projection.
#[test]
fn every_magnitude_has_its_light_in_every_projection() {
    let mut renderer = renderer();
    let mut worst = (0.0_f64, String::new());
    for (name, kind) in all_views() {
        let directions = directions_inside(&kind, 50);
        assert_eq!(directions.len(), 50, "{name}");
        let images = view("v", kind.clone()).images.len();
        let eyes = if matches!(kind, ViewKind::Stereo { .. }) { images as f64 } else { 1.0 };
        let rig = rig(vec![(name, kind)]);
        for magnitude in -1..=15_i16 {
            let expected = illuminance_lx_from_magnitude(f64::from(magnitude)) * directions.len() as f64 * eyes;
            let records = directions.iter().map(|direction| star(*direction, f32::from(magnitude))).collect();
            let frame = render_hdr(&mut renderer, &snapshot(records), &rig, &settings(StarMethod::Auto));
            let error = total_illuminance_lx(&frame, &rig) / expected - 1.0;
            assert!(error.abs() < 1e-3, "{name}, magnitude {magnitude}: {error}");
            if error.abs() > worst.0 {
                worst = (error.abs(), format!("{name}, magnitude {magnitude}"));
            }
        }
    }
    println!(
        "50 directions x 17 magnitudes x {} projections: worst relative error {:.1e} ({})",
        all_views().len(),
        worst.0,
        worst.1
    );
}

/// The check above must fail when the light is wrong: the same stars half a per cent brighter.
#[test]
fn half_a_per_cent_too_much_light_is_found() {
    let (name, kind) = all_views().remove(0);
    let directions = directions_inside(&kind, 50);
    let rig = rig(vec![(name, kind)]);
    let magnitude = 5.0 - 2.5 * 1.005_f64.log10();
    let records = directions.iter().map(|direction| star(*direction, magnitude as f32)).collect();
    let frame = render_hdr(&mut renderer(), &snapshot(records), &rig, &settings(StarMethod::Auto));
    let error = total_illuminance_lx(&frame, &rig) / (illuminance_lx_from_magnitude(5.0) * 50.0) - 1.0;
    assert!(error.abs() > 1e-3, "{error}");
}

/// The twelve edges and eight corners of the cube, both poles and the date line: stars on them and swept across them.
#[test]
fn light_is_whole_on_every_edge_corner_pole_and_date_line() {
    let mut renderer = renderer();
    let mut places = vec![("north pole", DVec3::Y), ("south pole", DVec3::NEG_Y)];
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                match [x, y, z].iter().filter(|v: &&f64| v.abs() > 0.0).count() {
                    3 => places.push(("corner", DVec3::new(x, y, z))),
                    2 => {
                        places.push(("edge", DVec3::new(x, y, z)));
                        // A point of the edge that is not its middle.
                        places.push((
                            "edge",
                            DVec3::new(x, y, z) + 0.37 * DVec3::new(1.0 - x * x, 1.0 - y * y, 1.0 - z * z),
                        ));
                    }
                    _ => {}
                }
            }
        }
    }
    for latitude in [-1.2_f64, -0.4, 0.0, 0.7, 1.4] {
        places.push(("date line", DVec3::new(0.0, latitude.sin(), latitude.cos())));
    }
    let expected = illuminance_lx_from_magnitude(3.0);
    for (name, kind) in [
        ("cube", ViewKind::Cubemap { face_size: 48, faces: Face::ALL.to_vec() }),
        ("equirectangular", ViewKind::Equirectangular { size: [128, 64] }),
        ("equidistant-360", ViewKind::Fisheye { size: [96, 96], mapping: FisheyeMapping::Equidistant, fov_rad: TAU }),
    ] {
        let rig = rig(vec![(name, kind)]);
        for method in [StarMethod::BSpline, StarMethod::Tent] {
            let mut worst = 0.0_f64;
            for (place, direction) in &places {
                let direction = direction.normalize();
                let across = direction.any_orthonormal_vector();
                for step in -4..=4 {
                    // Sub-pixel steps across, and the place itself.
                    let swept = direction
                        + across * (f64::from(step) * 0.011)
                        + direction.cross(across) * (f64::from(step) * 0.003);
                    let scene = snapshot(vec![star(swept, 3.0)]);
                    let frame = render_hdr(&mut renderer, &scene, &rig, &settings(method));
                    let error = total_illuminance_lx(&frame, &rig) / expected - 1.0;
                    assert!(error.abs() < 1e-4, "{name} {method:?}, {place} {direction} step {step}: {error}");
                    // Exactly on an edge of the cube, rounding decides which faces count the star.
                    if step != 0 || name != "cube" {
                        assert_eq!(frame.views[0].stars_drawn, 1, "{name}, {place} {direction} step {step}");
                    }
                    worst = worst.max(error.abs());
                }
            }
            println!("{name} {method:?}: {} places, worst relative error {worst:.1e}", places.len());
        }
    }
}

/// From the centre of the picture to its corner the light stays the same.
#[test]
fn a_star_swept_from_centre_to_corner_keeps_its_light() {
    let mut renderer = renderer();
    for (name, kind) in all_views().into_iter().take(3).chain([("dome", all_views()[5].1.clone())]) {
        let mapping_view = view("v", kind.clone());
        let mapping = mapping_view.images[0].projection.mapping();
        let [width, height] = mapping.size().map(f64::from);
        let rig = rig(vec![(name, kind.clone())]);
        let mut fluxes = Vec::new();
        for step in 0..40 {
            let part = f64::from(step) / 40.0;
            let pixel = if name == "dome" {
                DVec2::new(width / 2.0 + part * (width / 2.0 - 4.0), height / 2.0)
            } else {
                DVec2::new(width, height) / 2.0 + part * (DVec2::new(width, height) / 2.0 - 4.0)
            };
            let direction = mapping.direction_from_pixel(pixel).expect("inside");
            let frame =
                render_hdr(&mut renderer, &snapshot(vec![star(direction, 4.0)]), &rig, &settings(StarMethod::BSpline));
            fluxes.push(illuminance_lx(&frame.images[0], mapping));
        }
        let (least, most) = fluxes.iter().fold((f64::MAX, 0.0_f64), |(a, b), f| (a.min(*f), b.max(*f)));
        println!("{name}: light constant to {:.1e}", most / least - 1.0);
        assert!(most / least - 1.0 < 1e-4, "{name}");
    }
}

/// Tiles of one picture: a view cut into strips and batches is the same view, bit for bit. The light of a window's border
/// stars is what the border leaves of their kernel.
#[test]
fn a_cubemap_with_fewer_faces_shows_the_same_faces() {
    let mut renderer = renderer();
    let records: Vec<StarRecord> = spiral(5000).map(|direction| star(direction, 5.0)).collect();
    let scene = snapshot(records);
    let all = rig(vec![("cube", ViewKind::Cubemap { face_size: 40, faces: Face::ALL.to_vec() })]);
    let some = rig(vec![("cube", ViewKind::Cubemap { face_size: 40, faces: vec![Face::Up, Face::Right] })]);
    let whole = render_hdr(&mut renderer, &scene, &all, &settings(StarMethod::BSpline));
    let part = render_hdr(&mut renderer, &scene, &some, &settings(StarMethod::BSpline));
    for image in &part.images {
        let other = whole.images.iter().find(|other| other.part == image.part).expect("the same face");
        let (some, all) = (image.hdr.as_ref().expect("asked for"), other.hdr.as_ref().expect("asked for"));
        let brightest = all.iter().map(|pixel| pixel[1]).fold(0.0, f32::max);
        // The fixed-point unit depends on all the light of the frame, so the last digits may differ, no more.
        for (a, b) in some.iter().flatten().zip(all.iter().flatten()) {
            assert!((a - b).abs() <= 1e-6 * brightest, "{:?}: {a} instead of {b}", image.part);
        }
    }
}

/// Centroid and width over sub-pixel positions.
#[test]
fn sub_pixel_sweep_keeps_centroid_and_width() {
    let mut renderer = renderer();
    let kind = ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.02 };
    let mapping_view = view("v", kind.clone());
    let mapping = mapping_view.images[0].projection.mapping();
    let rig = rig(vec![("narrow", kind)]);
    let (mut worst_centroid, mut widths) = (0.0_f64, Vec::new());
    for step in 0..60 {
        let place = DVec2::new(30.0 + f64::from(step) * 0.037, 33.0 + f64::from(step) * 0.021);
        let direction = mapping.direction_from_pixel(place).expect("inside");
        let frame =
            render_hdr(&mut renderer, &snapshot(vec![star(direction, 1.0)]), &rig, &settings(StarMethod::BSpline));
        let hdr = frame.images[0].hdr.as_ref().expect("asked for");
        let (mut sum, mut centroid) = (0.0, DVec2::ZERO);
        let weight = |i: usize| {
            let (x, y) = (i as u32 % 64, i as u32 / 64);
            (DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), f64::from(hdr[i][1]) * mapping.solid_angle_sr(x, y))
        };
        for i in 0..hdr.len() {
            let (at, light) = weight(i);
            sum += light;
            centroid += at * light;
        }
        centroid /= sum;
        worst_centroid = worst_centroid.max((centroid - place).length());
        let variance: f64 =
            (0..hdr.len()).map(|i| (weight(i).0 - centroid).length_squared() * weight(i).1).sum::<f64>() / sum;
        widths.push(variance.sqrt());
    }
    let (least, most) = widths.iter().fold((f64::MAX, 0.0_f64), |(a, b), w| (a.min(*w), b.max(*w)));
    println!("centroid within {worst_centroid:.1e} px, width within {:.1e}", most / least - 1.0);
    assert!(worst_centroid < 0.005);
    assert!(most / least - 1.0 < 0.005);
}

/// A million stars of magnitude 20 in one pixel, each far below what a 16-bit float would keep.
#[test]
fn a_million_faint_stars_in_one_pixel_add_up() {
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let rig = rig(vec![("v", ViewKind::Perspective { size: [33, 33], fov_y_rad: 0.5 })]);
        let scene = snapshot(vec![star(DVec3::NEG_Z, 20.0); 1_000_000]);
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::BSpline));
        let error = total_illuminance_lx(&frame, &rig) / (1e6 * illuminance_lx_from_magnitude(20.0)) - 1.0;
        println!("a million stars of magnitude 20, {}: {error:.1e}", frame.plan.accumulator);
        assert!(error.abs() < 1e-3);
        assert_eq!(frame.views[0].stars_drawn, 1_000_000);
    }
}

/// Sirius beside a star of magnitude 21, three pixels apart; and the Sun beside both.
#[test]
fn sirius_and_a_star_of_magnitude_21_are_both_right() {
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let kind = ViewKind::Perspective { size: [65, 65], fov_y_rad: 0.1 };
        let mapping_view = view("v", kind.clone());
        let mapping = mapping_view.images[0].projection.mapping();
        let at = |x: f64, y: f64| mapping.direction_from_pixel(DVec2::new(x, y)).expect("inside");
        let rig = rig(vec![("v", kind)]);
        for with_sun in [false, true] {
            let mut records = vec![star(at(30.3, 30.4), -1.46), star(at(33.6, 30.2), 21.0)];
            if with_sun {
                records.push(star(at(10.5, 50.5), -26.7));
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
            println!("{}, Sun {with_sun}: Sirius {sirius:.1e}, magnitude 21 {faint:.1e}", frame.plan.accumulator);
            assert!(sirius.abs() < 0.02 && faint.abs() < 0.02);
            if with_sun {
                let sun = sum_around(10, 50) / illuminance_lx_from_magnitude(-26.7) - 1.0;
                assert!(sun.abs() < 1e-3, "{sun}");
            }
        }
    }
}

/// Units chosen too fine on purpose: the frame is refused, nothing wraps.
#[test]
fn a_provoked_overflow_is_reported() {
    for force_u32_accumulator in [false, true] {
        let mut renderer = renderer_with(&GpuOptions { force_u32_accumulator, ..Default::default() });
        let rig = rig(vec![("v", ViewKind::Perspective { size: [9, 9], fov_y_rad: 0.5 })]);
        let scene = snapshot(vec![star(DVec3::NEG_Z, 2.0); 4096]);
        let wanted = [steradian::frame::Wanted { display: false, hdr: true }];
        let mut render = |factor: f64| {
            renderer.unit_factor = factor;
            renderer.render(&scene, &rig, &settings(StarMethod::BSpline), &wanted, None)
        };
        let expected = 4096.0 * illuminance_lx_from_magnitude(2.0);
        assert!((total_illuminance_lx(&render(1.0).expect("in range"), &rig) / expected - 1.0).abs() < 1e-3);
        for factor in [64.0, 1024.0] {
            assert!(matches!(render(factor), Err(RenderError::Overflow(count)) if count > 0), "factor {factor}");
        }
    }
}

/// The order of the catalogue does not show: a hundred shuffles, bit for bit.
#[test]
fn a_hundred_shuffles_give_identical_bits() {
    let mut renderer = renderer();
    let mut records: Vec<StarRecord> = spiral(2000)
        .enumerate()
        .map(|(i, direction)| StarRecord { temperature_k: 2500.0 + i as f32 * 7.0, ..star(direction, (i % 17) as f32) })
        .collect();
    // Half of them crowd into a few pixels, so that many threads add to the same sums.
    for record in records.iter_mut().step_by(2) {
        record.position = (DVec3::NEG_Z + record.position * 0.01).normalize();
    }
    let rig = rig(vec![
        ("flat", ViewKind::Perspective { size: [160, 90], fov_y_rad: 1.0 }),
        ("cube", ViewKind::Cubemap { face_size: 32, faces: Face::ALL.to_vec() }),
    ]);
    let mut first = None;
    let mut state = 1_u64;
    for _ in 0..100 {
        for i in (1..records.len()).rev() {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            records.swap(i, ((state >> 33) % (i as u64 + 1)) as usize);
        }
        let frame = render_hdr(&mut renderer, &snapshot(records.clone()), &rig, &settings(StarMethod::Auto));
        let bits: Vec<_> = frame.images.into_iter().map(|image| image.hdr).collect();
        match &first {
            None => first = Some(bits),
            Some(expected) => assert!(*expected == bits, "a shuffle changed the image"),
        }
    }
}

/// Light adds, temperatures do not: two stars of 3000 and 20000 K in a pixel.
#[test]
fn two_colours_in_one_pixel_add_as_light() {
    let rig = rig(vec![("v", ViewKind::Perspective { size: [9, 9], fov_y_rad: 0.5 })]);
    let pair = |kelvin: f32| StarRecord { temperature_k: kelvin, ..star(DVec3::NEG_Z, 3.0) };
    let frame = render_hdr(
        &mut renderer(),
        &snapshot(vec![pair(3000.0), pair(20_000.0)]),
        &rig,
        &settings(StarMethod::BSpline),
    );
    let [r, g, b, _] = frame.images[0].hdr.as_ref().expect("asked for")[4 * 9 + 4];
    let seen = uv_prime([r, g, b].map(f64::from));
    let (red, blue) = (rec709_in_gamut(3000.0), rec709_in_gamut(20_000.0));
    let expected = uv_prime([red[0] + blue[0], red[1] + blue[1], red[2] + blue[2]]);
    let error = (seen[0] - expected[0]).hypot(seen[1] - expected[1]);
    // What averaging the temperatures would show lies ten times the limit away.
    let averaged = uv_prime(rec709_in_gamut(11_500.0));
    let wrong = (averaged[0] - expected[0]).hypot(averaged[1] - expected[1]);
    println!("u'v' of 3000 K + 20000 K: off by {error:.1e}; averaged temperatures would be by {wrong:.1e}");
    assert!(error < 0.003 && wrong > 0.03);
}

/// A star at the camera's place, behind it, and a millionth of a parsec away.
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
        // The star ten parsecs ahead is whole, whatever stands near the camera.
        if position == DVec3::ZERO {
            let image = &frame.images[1];
            let mapping = rig.views()[1].images[0].projection.mapping();
            let error = illuminance_lx(image, mapping) / illuminance_lx_from_magnitude(4.8_f32.into()) - 1.0;
            assert!(error.abs() < 1e-4, "{error}");
        }
        if position.length() == 1e-6 {
            let mapping = rig.views()[1].images[0].projection.mapping();
            let expected =
                illuminance_lx_from_magnitude(4.8_f32.into()) * 1e14 + illuminance_lx_from_magnitude(4.8_f32.into());
            assert!((illuminance_lx(&frame.images[1], mapping) / expected - 1.0).abs() < 1e-4);
        }
    }
}

/// The camera among the stars: magnitudes and directions are those of its place.
#[test]
fn a_travelling_camera_sees_stars_where_and_as_bright_as_they_are() {
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
        println!("camera at {camera_pc} pc: {error:.1e}");
        assert!(error.abs() < 1e-4, "{camera_pc}: {error}");
    }
}

/// The twin in f64 draws the same picture.
#[test]
fn the_adapter_and_the_f64_twin_draw_the_same_picture() {
    use steradian::{
        photometry::kernel::SplatKernel,
        reference::stars::{Eye, draw},
    };
    let mut renderer = renderer();
    let records: Vec<StarRecord> = spiral(3000)
        .enumerate()
        .map(|(i, d)| StarRecord { temperature_k: 2000.0 + i as f32 * 9.0, ..star(d, (i % 9) as f32) })
        .collect();
    let scene = snapshot(records);
    for (method, kernel) in [(StarMethod::BSpline, SplatKernel::BSpline), (StarMethod::Tent, SplatKernel::Tent)] {
        for (name, kind) in all_views() {
            let rig = rig(vec![(name, kind)]);
            let frame = render_hdr(&mut renderer, &scene, &rig, &settings(method));
            for (image, view_image) in frame.images.iter().zip(&rig.views()[0].images) {
                let mapping = view_image.projection.mapping();
                let eye = Eye { position_m: DVec3::ZERO, world_from_view: view_image.camera_from_view };
                let twin = draw(&scene.stars, eye, mapping, |_| Some(kernel));
                let expected = twin.luminance_cd_m2(mapping);
                let [width, height] = mapping.size().map(i64::from);
                // Differences count against the brightest of the 3 x 3 pixels around: f32 coordinates shift a kernel by
                // some 1e-5 pixel, and with it the small weights at its edge.
                let around = |index: usize, channel: usize| {
                    let (x, y) = (index as i64 % width, index as i64 / width);
                    let near = (-1..=1).flat_map(|j| (-1..=1).map(move |i| (x + i, y + j)));
                    near.filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y))
                        .map(|(x, y)| expected[(y * width + x) as usize][channel])
                        .fold(0.0_f64, f64::max)
                };
                // A star just outside of the picture leaves but the edge of its kernel: hence the second term.
                let brightest = expected.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
                let mut worst = 0.0_f64;
                for (index, seen) in image.hdr.as_ref().expect("asked for").iter().enumerate() {
                    for channel in 0..3 {
                        let difference = (f64::from(seen[channel]) - expected[index][channel]).abs();
                        if difference > 0.0 {
                            worst = worst.max(difference / (around(index, channel) + 1e-4 * brightest));
                        }
                    }
                }
                assert!(worst < 1e-3, "{name} {method:?} {:?}: relative difference {worst}", image.part);
                if method == StarMethod::BSpline {
                    println!("{name} {:?}: largest relative difference from f64 {worst:.1e}", image.part);
                }
            }
        }
    }
}

/// Nothing that is not asked for differs: the same frame five times.
#[test]
fn five_frames_are_identical() {
    let mut renderer = renderer();
    let scene = snapshot(spiral(20_000).enumerate().map(|(i, d)| star(d, (i % 12) as f32)).collect());
    let rig = rig(vec![("a", ViewKind::Equirectangular { size: [256, 128] }), ("b", all_views()[5].1.clone())]);
    let wanted = [steradian::frame::Wanted { display: true, hdr: true }; 2];
    let mut frames = (0..5).map(|_| {
        let frame = renderer.render(&scene, &rig, &settings(StarMethod::Auto), &wanted, None).expect("renders");
        let images: Vec<_> = frame.images.into_iter().map(|image| (image.hdr, image.display)).collect();
        (frame.exposure_ev100, images)
    });
    let first = frames.next().expect("five frames");
    assert!(frames.all(|frame| frame == first));
}

/// A frame whose exposure is known before is tone mapped by the resolve pass, one that meters itself by a pass of its own:
/// the same picture, and the f64 curve of the HDR image but for the dither.
#[test]
fn both_ways_to_the_display_image_agree() {
    use steradian::{frame::Wanted, photometry::exposure::white_luminance_cd_m2, plan::settings::ToneMapOperator};
    let mut renderer = renderer();
    let scene = snapshot(spiral(20_000).enumerate().map(|(i, d)| star(d, (i % 12) as f32)).collect());
    let rig = rig(vec![("a", ViewKind::Equirectangular { size: [256, 128] }), ("b", all_views()[5].1.clone())]);
    for operator in ToneMapOperator::ALL {
        let mut settings = settings(StarMethod::BSpline);
        settings.tone_map.operator = operator;
        let mut render = |wanted: Wanted, ev100: Option<f64>| {
            renderer.render(&scene, &rig, &settings, &[wanted; 2], ev100).expect("the frame renders")
        };
        let metered = render(Wanted { display: true, hdr: true }, None);
        let known = render(Wanted { display: true, hdr: false }, Some(metered.exposure_ev100));
        let other = render(Wanted { display: true, hdr: false }, Some(metered.exposure_ev100 + 1.0));
        let white = white_luminance_cd_m2(metered.exposure_ev100);
        for ((a, b), c) in metered.images.iter().zip(&known.images).zip(&other.images) {
            let (a_bytes, b_bytes) = (a.display.as_ref().expect("asked for"), b.display.as_ref().expect("asked for"));
            let off_by_more = a_bytes.iter().zip(b_bytes).filter(|(a, b)| a.abs_diff(**b) > 1).count();
            let different = a_bytes.iter().zip(b_bytes).filter(|(a, b)| a != b).count();
            // The white luminance comes from exp2 in f32 in one way and from f64 in the other: a few pixels round apart.
            assert!(off_by_more == 0 && different < a_bytes.len() / 1000, "{operator:?}: {different} bytes differ");
            assert_ne!(Some(b_bytes), c.display.as_ref(), "another exposure must show");
            let hdr = a.hdr.as_ref().expect("asked for");
            for (pixel, bytes) in hdr.iter().zip(a_bytes.as_chunks::<4>().0) {
                let expected = operator.display_rgb([pixel[0], pixel[1], pixel[2]].map(f64::from), white);
                for (byte, value) in bytes.iter().zip(expected) {
                    assert!((f64::from(*byte) - value * 255.0).abs() <= 1.02, "{operator:?}: {byte} for {value}");
                }
            }
        }
    }
}

/// Strips, batches and segments of stars: an adapter that binds little at once shows the same picture, bit for bit.
#[test]
fn cut_into_strips_and_batches_the_picture_is_the_same() {
    let scene = snapshot(spiral(6000).enumerate().map(|(i, d)| star(d, (i % 14) as f32)).collect());
    let rig = rig(all_views());
    let images = |options: &GpuOptions| {
        let wanted = vec![steradian::frame::Wanted { display: true, hdr: true }; rig.views().len()];
        let mut renderer = renderer_with(options);
        let frame = renderer.render(&scene, &rig, &settings(StarMethod::BSpline), &wanted, None).expect("renders");
        let drawn: Vec<u64> = frame.views.iter().map(|view| view.stars_drawn).collect();
        (frame.images.into_iter().map(|image| (image.part, image.hdr)).collect::<Vec<_>>(), drawn)
    };
    let whole = images(&GpuOptions::default());
    // 40 rows of 192 pixels at a time, and 2048 stars.
    for limit in [16 * 192 * 40, 16 * 2048] {
        let cut = images(&GpuOptions { binding_limit_bytes: Some(limit), ..Default::default() });
        assert!(whole.0 == cut.0, "an image differs with {limit} bytes at a time");
        assert_eq!(whole.1, cut.1, "stars drawn");
    }
}

/// An off-axis frustum is a sub-window of the symmetric one.
#[test]
fn an_off_axis_view_is_a_window_of_the_symmetric_one() {
    let scene = snapshot(spiral(20_000).map(|d| star(d, 3.0)).collect());
    let half = (PI / 6.0).tan();
    let rig = rig(vec![
        ("whole", ViewKind::Perspective { size: [240, 240], fov_y_rad: PI / 3.0 }),
        (
            "window",
            ViewKind::OffAxis {
                size: [80, 60],
                // Columns 120 to 200, rows 30 to 90.
                fov: Fov {
                    left_rad: 0.0,
                    right_rad: (half * 2.0 / 3.0).atan(),
                    up_rad: (half * 0.75).atan(),
                    down_rad: (half * 0.25).atan(),
                },
            },
        ),
    ]);
    let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::BSpline));
    let [whole, window] = [0, 1].map(|i| frame.images[i].hdr.as_ref().expect("asked for"));
    let brightest = whole.iter().map(|pixel| pixel[1]).fold(0.0, f32::max);
    let (mut worst, mut worst_omega) = (0.0_f32, 0.0_f32);
    for y in 0..60 {
        for x in 0..80 {
            let (a, b) = (whole[(y + 30) * 240 + x + 120], window[y * 80 + x]);
            worst = worst.max((a[1] - b[1]).abs() / brightest);
            worst_omega = worst_omega.max((a[3] / b[3] - 1.0).abs());
        }
    }
    println!("window against whole: luminance {worst:.1e} of the brightest pixel, solid angle {worst_omega:.1e}");
    assert!(worst_omega < 1e-6 && worst < 1e-4);
}
