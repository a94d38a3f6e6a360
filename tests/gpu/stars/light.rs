//! The light of stars: every view has the illuminance of the catalogue, wherever the star is in the picture.
//!
//! Solid angles are computed in f64 here, independently of the shader.

use std::f64::consts::{PI, TAU};

use crate::common::*;
use glam::{DVec2, DVec3};
use steradian::{
    catalogue::StarRecord,
    metrics::{centroid_error_px, relative_variation, shape_px, uv_distance},
    photometry::blackbody::rec709_in_gamut,
    plan::settings::StarMethod,
    units::illuminance_lx_from_magnitude,
    view::{
        Fov, ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

/// For every whole magnitude from -1 to 15 there is a catalogue with stars in 50 directions, which is drawn in every projection.
#[test]
fn every_magnitude_has_its_illuminance_in_every_projection() {
    let mut renderer = renderer();
    let mut worst = figures::STAR_FLUX.worst();
    for (name, kind) in all_views() {
        let directions = directions_inside(&view("v", kind.clone()), 50, 12);
        assert_eq!(directions.len(), 50, "{name}");
        let images = view("v", kind.clone()).images.len();
        let eyes = if matches!(kind, ViewKind::Stereo { .. }) { images as f64 } else { 1.0 };
        let rig = rig(vec![(name, kind)]);
        for magnitude in -1..=15_i16 {
            let expected = illuminance_lx_from_magnitude(f64::from(magnitude)) * directions.len() as f64 * eyes;
            let records = directions.iter().map(|direction| star(*direction, f32::from(magnitude))).collect();
            let frame = render_hdr(&mut renderer, &snapshot(records), &rig, &settings(StarMethod::Auto));
            let error = total_illuminance_lx(&frame, &rig) / expected - 1.0;
            worst.add(error, format_args!("{name}, magnitude {magnitude}"));
        }
    }
    worst.print();
}

/// The check above must fail if the stars are brighter by a ten-thousandth.
#[test]
fn light_wrong_by_a_ten_thousandth_fails_the_check() {
    let (name, kind) = all_views().remove(0);
    let directions = directions_inside(&view("v", kind.clone()), 50, 12);
    let rig = rig(vec![(name, kind)]);
    let magnitude = 5.0 - 2.5 * 1.0001_f64.log10();
    let records = directions.iter().map(|direction| star(*direction, magnitude as f32)).collect();
    let frame = render_hdr(&mut renderer(), &snapshot(records), &rig, &settings(StarMethod::Auto));
    let error = total_illuminance_lx(&frame, &rig) / (illuminance_lx_from_magnitude(5.0) * 50.0) - 1.0;
    assert!(!figures::STAR_FLUX.holds(error), "{error}");
}

/// Tests the twelve edges and eight corners of the cube, both poles and the date line. Stars are on them, and are moved across them.
#[test]
fn stars_keep_their_light_on_edges_corners_poles_and_date_line() {
    let mut renderer = renderer();
    let places = hard_places();
    let mut worst = figures::STAR_FLUX_AT_EDGES.worst();
    let expected = illuminance_lx_from_magnitude(3.0);
    for (name, kind) in [
        ("cube", ViewKind::Cubemap { face_size: 48, faces: Face::ALL.to_vec() }),
        ("equirectangular", ViewKind::Equirectangular { size: [128, 64] }),
        ("equidistant-360", ViewKind::Fisheye { size: [96, 96], mapping: FisheyeMapping::Equidistant, fov_rad: TAU }),
    ] {
        let rig = rig(vec![(name, kind)]);
        for method in [StarMethod::BSpline, StarMethod::Tent, StarMethod::PixelGaussian] {
            for direction in &places {
                let across = direction.any_orthonormal_vector();
                for step in -4..=4 {
                    // Use sub-pixel steps across the place, and the place itself.
                    let swept = direction
                        + across * (f64::from(step) * 0.011)
                        + direction.cross(across) * (f64::from(step) * 0.003);
                    let scene = snapshot(vec![star(swept, 3.0)]);
                    let frame = render_hdr(&mut renderer, &scene, &rig, &settings(method));
                    let error = total_illuminance_lx(&frame, &rig) / expected - 1.0;
                    worst.add(error, format_args!("{name} {method:?}, {direction} step {step}"));
                    // If a star is exactly on an edge of the cube, rounding decides which faces count it.
                    if step != 0 || name != "cube" {
                        assert_eq!(frame.views[0].stars_drawn, 1, "{name}, {direction} step {step}");
                    }
                }
            }
        }
    }
    worst.print();
}

/// The light is constant from the centre of the picture to its corner.
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
        let variation = relative_variation(&fluxes).expect("light");
        println!("{name}: relative variation of the light {variation:.1e}");
        assert!(variation < 4e-6, "{name}: {variation}");
    }
}

/// Faces of a cubemap look the same whether all faces are rendered or only some.
#[test]
fn rendered_cube_faces_do_not_depend_on_the_other_faces() {
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
        // The fixed-point unit depends on all the light of the frame, so the last digits may differ.
        for (a, b) in some.iter().flatten().zip(all.iter().flatten()) {
            assert!((a - b).abs() <= 1e-6 * brightest, "{:?}: {a} instead of {b}", image.part);
        }
    }
}

/// The centroid is correct and the width constant at all sub-pixel positions.
#[test]
fn sub_pixel_sweep_keeps_centroid_and_width() {
    let mut renderer = renderer();
    let kind = ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.02 };
    let mapping_view = view("v", kind.clone());
    let mapping = mapping_view.images[0].projection.mapping();
    let rig = rig(vec![("narrow", kind)]);
    let (mut centroid, mut widths) = (figures::CENTROID.worst(), Vec::new());
    for step in 0..60 {
        let place = DVec2::new(30.0 + f64::from(step) * 0.037, 33.0 + f64::from(step) * 0.021);
        let direction = mapping.direction_from_pixel(place).expect("inside");
        let frame =
            render_hdr(&mut renderer, &snapshot(vec![star(direction, 1.0)]), &rig, &settings(StarMethod::BSpline));
        let image = hdr_view(&frame.images[0], mapping);
        // The radius covers the whole picture, so that stray light is included.
        centroid.add(centroid_error_px(&image, place, 100.0).expect("a star"), place);
        widths.push(shape_px(&image, place, 100.0).expect("a star").rms_radius());
    }
    centroid.print();
    figures::WIDTH.check(relative_variation(&widths).expect("widths"));
}

/// Light is additive, but temperatures are not: the pixel contains two stars of 3000 K and 20000 K.
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
    let rgb = [r, g, b].map(f64::from);
    let (red, blue) = (rec709_in_gamut(3000.0), rec709_in_gamut(20_000.0));
    let expected = [red[0] + blue[0], red[1] + blue[1], red[2] + blue[2]];
    let error = uv_distance(rgb, expected).expect("light");
    // The colour of the mean temperature would differ by more than a hundred times the limit.
    let wrong = uv_distance(rec709_in_gamut(11_500.0), expected).expect("light");
    println!("u'v' of 3000 K + 20000 K: error {error:.1e}; error of the mean temperature {wrong:.1e}");
    assert!(error < 1.5e-4 && wrong > 0.03);
}

/// Every kernel equals the f64 reference in every projection.
#[test]
fn the_adapter_and_the_f64_twin_draw_the_same_picture() {
    use steradian::{
        photometry::kernel::SplatKernel,
        plan::{
            GaussianWidth,
            settings::{ExposureSettings, PixelGaussianSettings},
        },
        reference::stars::splat::{Eye, StarKernel, draw},
    };
    let mut renderer = renderer();
    let records: Vec<StarRecord> = spiral(3000)
        .enumerate()
        .map(|(i, d)| StarRecord { temperature_k: 2000.0 + i as f32 * 9.0, ..star(d, (i % 9) as f32) })
        .collect();
    let scene = snapshot(records);
    let few = snapshot(spiral(250).enumerate().map(|(i, d)| star(d, (i % 5) as f32)).collect());
    let gaussian = GaussianWidth::new(&PixelGaussianSettings::default());
    for (method, kernel, scene) in [
        (StarMethod::BSpline, StarKernel::Splat(SplatKernel::BSpline), &scene),
        (StarMethod::Tent, StarKernel::Splat(SplatKernel::Tent), &scene),
        (StarMethod::PixelGaussian, StarKernel::Gaussian(gaussian), &few),
        // With a very low display white, every star is bright enough for the plane Gaussian.
        (StarMethod::Auto, StarKernel::Bright(1.0), &scene),
    ] {
        for (name, kind) in all_views() {
            let rig = rig(vec![(name, kind)]);
            let mut settings = settings(method);
            settings.exposure = ExposureSettings::manual(-60.0);
            let frame = render_hdr(&mut renderer, scene, &rig, &settings);
            for (image, view_image) in frame.images.iter().zip(&rig.views()[0].images) {
                let mapping = view_image.projection.mapping();
                let eye = Eye { world_from_view: view_image.camera_from_view, ..Eye::default() };
                let twin = draw(&scene.stars, eye, mapping, |_| Some(kernel));
                // At the antipode of a full sphere, pixels are so small that the light of the Gaussian in one of them is only a few units of the
                // sums.
                let rounding = frame.plan.certificate.iter().find(|entry| entry.name.starts_with("rounding"));
                let free_lx = match method {
                    StarMethod::PixelGaussian => 10.0 * rounding.expect("certified").bound,
                    _ => 0.0,
                };
                let worst = differences_from_twin(image, &twin, mapping, free_lx, |rgb| rgb);
                // The light of the Gaussian is proportional to the solid angles of the pixels, whose f32 errors at the orthographic rim
                // are as large as this limit.
                let steep = name.starts_with("orthographic") && method == StarMethod::PixelGaussian;
                let limit = if steep { 1e-2 } else { 1e-3 };
                assert!(worst < limit, "{name} {method:?} {:?}: relative difference {worst}", image.part);
                if method != StarMethod::Tent {
                    println!("{name} {method:?} {:?}: largest relative difference from f64 {worst:.1e}", image.part);
                }
            }
        }
    }
}

/// The picture of an off-axis frustum is a part of that of the symmetric one.
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
                // The part has columns 120 to 200 and rows 30 to 90.
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
    println!("part compared with whole: luminance {worst:.1e} of the brightest pixel, solid angle {worst_omega:.1e}");
    assert!(worst_omega < 2.4e-7 && worst < 2.5e-5);
}
