//! Saturn with its rings: the total light matches the measured magnitude, the ring zones have their radii, and globe
//! and rings hide and shade each other.

use std::sync::Arc;

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use steradian::{
    photometry::rec709::luminance,
    plan::{bodies::light::illuminance_of, settings::StarMethod},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, SolarBody, suns},
    },
    units::ASTRONOMICAL_UNIT_M,
    view::{
        Rig, ViewKind,
        projection::{Perspective, TabulatedMapping},
    },
};

const AU: f64 = ASTRONOMICAL_UNIT_M;
const RADIUS_M: f64 = 60_268e3;
const SIZE: [u32; 2] = [400, 240];

/// Returns a scene with Saturn at 9 au. Its pole leans towards the eye by `eye_deg`. The Sun is `sun_deg` above the
/// equator of Saturn, and its azimuth around the pole differs from that of the eye by `sun_azimuth_deg`.
fn scene(eye_deg: f64, sun_deg: f64, sun_azimuth_deg: f64, has_curve: bool) -> SceneSnapshot {
    let place = DVec3::NEG_Z * 9.0 * AU;
    let mut saturn = Body::preset(SolarBody::Saturn, "saturn", place);
    if !has_curve {
        saturn.surface.phase_curve = None;
    }
    // The pole points up (+y) in the picture and leans towards the eye (+z).
    saturn.orientation = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2 + eye_deg.to_radians());
    let pole = saturn.orientation * DVec3::Z;
    let (sin, cos) = sun_deg.to_radians().sin_cos();
    let flat = (DVec3::Z - pole * pole.z).normalize();
    let turned = DQuat::from_axis_angle(pole, sun_azimuth_deg.to_radians()) * flat;
    let sun = Body::preset(SolarBody::Sun, "sun", place + (pole * sin + turned * cos) * 9.5 * AU);
    let objects = SceneObjects { bodies: vec![Arc::new(saturn), Arc::new(sun)], ..Default::default() };
    SceneSnapshot { objects: Arc::new(objects), camera: Camera::default(), ..snapshot(Vec::new()) }
}

fn window() -> Rig {
    // The rings are 320 pixels wide.
    let fov_y_rad = 2.0 * (RADIUS_M * 2.269 / (9.0 * AU)) * 240.0 / 320.0;
    rig(vec![("window", ViewKind::Perspective { size: SIZE, fov_y_rad })])
}

/// Returns the luminance of all pixels, row by row, and the illuminance of the picture, lx.
fn picture(scene: &SceneSnapshot) -> (Vec<f64>, f64) {
    let rig = window();
    let frame = render_hdr(&mut renderer(), scene, &rig, &settings(StarMethod::Auto));
    let image = &frame.images[0];
    let mapping = rig.views()[0].images[0].projection.mapping();
    let pixels = image.hdr.as_ref().unwrap().iter().map(|[r, g, b, _]| luminance([r, g, b].map(|c| f64::from(*c))));
    (pixels.collect(), illuminance_lx(image, mapping))
}

/// Returns the luminance at a position, given in equatorial radii to the right and up.
fn luminance_at(picture: &[f64], right: f64, up: f64) -> f64 {
    let place = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1])) * 0.5 + DVec2::new(right, -up) * 160.0 / 2.269;
    picture[place.y as usize * SIZE[0] as usize + place.x as usize]
}

#[test]
fn globe_and_rings_have_the_measured_total_light() {
    for (eye_deg, sun_deg, sun_azimuth_deg) in
        [(26.0, 26.0, 0.5), (20.0, 21.0, 3.0), (-12.0, -11.0, 5.0), (5.0, 6.0, 2.0)]
    {
        let scene = scene(eye_deg, sun_deg, sun_azimuth_deg, true);
        let expected = luminance(illuminance_of(&scene.objects.bodies[0], DVec3::ZERO, &suns(&scene.objects), 0.0));
        let (pixels, found) = picture(&scene);
        println!("eye {eye_deg}, Sun {sun_deg}: relative error of the light {:+.3}", found / expected - 1.0);
        // Globe and rings hide parts of each other; the measured magnitude is that of the visible parts.
        assert!((0.97..1.03).contains(&(found / expected)), "{eye_deg}: {}", found / expected);
        // Next to the globe, ring C is dark, B is bright, and A is fainter than B. Cassini's division between B and A
        // is dark.
        let [c, b, division, a, beyond] =
            [1.38, 1.75, 1.99, 2.15, 2.35].map(|radius| luminance_at(&pixels, radius, 0.0));
        if eye_deg.abs() > 10.0 {
            assert!(b > 1.3 * a && a > 1.3 * division && b > 3.0 * c && c > 0.0, "{c} {b} {division} {a}");
        }
        assert!(beyond == 0.0 && luminance_at(&pixels, 1.1, 0.0) == 0.0, "{beyond}");
    }
}

#[test]
fn globe_and_rings_hide_and_shade_each_other() {
    let bright = picture(&scene(26.0, 26.0, 0.0, true)).0;
    let without = picture(&scene(26.0, 26.0, 0.0, false)).0;
    let sine = 26_f64.to_radians().sin();
    // The near part of ring B crosses the globe below its centre. Above the centre, the globe hides the far part.
    let [before, behind] = [-1.75 * sine, 1.75 * sine];
    let globe = |picture: &[f64]| luminance_at(picture, 0.0, 0.1);
    let ratio = luminance_at(&bright, 0.0, before) / globe(&bright);
    let plain = luminance_at(&without, 0.0, before) / globe(&without);
    assert!((ratio / plain - 1.0).abs() > 0.05, "{ratio} {plain}");
    let hidden = luminance_at(&bright, 0.0, behind) / globe(&bright);
    let alike = luminance_at(&without, 0.0, behind) / globe(&without);
    assert!((hidden / alike - 1.0).abs() < 0.05, "{hidden} {alike}");
    // If they are lit from the other side, the rings reflect no light.
    let dark = picture(&scene(10.0, -10.0, 0.0, true)).0;
    assert_eq!(luminance_at(&dark, 1.75, 0.0), 0.0);
    // With the Sun to one side of the eye, the shadow of the globe falls on the far part of the rings, left or right.
    let [left, right] = [20.0, -20.0].map(|azimuth_deg| picture(&scene(24.0, 24.0, azimuth_deg, true)).0);
    let shadow =
        |picture: &[f64]| [-1.0, 1.0].map(|side| luminance_at(picture, side * 0.95, 1.62 * 24_f64.to_radians().sin()));
    let [[a, b], [c, d]] = [shadow(&left), shadow(&right)];
    assert!((a - d).abs() <= 0.1 * a.max(d) && (b - c).abs() <= 0.1 * b.max(c), "{a} {b} {c} {d}");
    assert!(a.min(b) < 0.3 * a.max(b), "{a} {b}");
}

/// Limb, rings, and a moon that crosses the limb are the same in a table of the projection as in its closed form. In tables, the rays within a pixel are
/// interpolated.
#[test]
fn a_tabulated_picture_has_the_globe_the_rings_and_the_transit_of_the_closed_form() {
    let place = DVec3::NEG_Z * 10.0 * RADIUS_M;
    let body = |preset, name: &str, place: DVec3, radius_share: f64| {
        let mut body = Body::preset(preset, name, place);
        body.surface.phase_curve = None;
        body.radii_m *= radius_share;
        Arc::new(body)
    };
    let mut saturn = Body::clone(&body(SolarBody::Saturn, "saturn", place, 1.0));
    saturn.orientation = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(-1.2);
    let sun = Arc::new(Body::preset(SolarBody::Sun, "sun", DVec3::new(0.4, 0.3, 0.8) * 9.5 * AU));
    let moon = body(SolarBody::Moon, "moon", place * 0.5 + DVec3::new(0.45, 0.1, 0.0) * RADIUS_M, 5.0);
    let objects = SceneObjects { bodies: vec![Arc::new(saturn), moon, sun], ..Default::default() };
    let scene = SceneSnapshot { objects: Arc::new(objects), camera: Camera::default(), ..snapshot(Vec::new()) };
    let pictures = |turn_rad: f64| {
        let turned = SceneSnapshot {
            camera: Camera { world_from_camera: DQuat::from_rotation_z(turn_rad), ..Camera::default() },
            ..scene.clone()
        };
        let mapping = Perspective::symmetric(SIZE, 0.6).unwrap();
        let table = ViewKind::Tabulated { mapping: Arc::new(TabulatedMapping::new(mapping).unwrap()) };
        let rig = rig(vec![("closed", ViewKind::Perspective { size: SIZE, fov_y_rad: 0.6 }), ("table", table)]);
        let frame = render_hdr(&mut renderer(), &turned, &rig, &settings(StarMethod::Auto));
        let light = |image: usize| -> Vec<f64> {
            let pixels = frame.images[image].hdr.as_ref().unwrap();
            pixels.iter().map(|[r, g, b, _]| luminance([*r, *g, *b].map(f64::from))).collect()
        };
        [light(0), light(1)]
    };
    // The largest and the mean difference of a pixel, relative to the brightest one.
    let difference = |a: &[f64], b: &[f64]| {
        let brightest = a.iter().copied().fold(0.0, f64::max);
        let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs() / brightest);
        let (sum, most) = apart.fold((0.0, 0.0), |(sum, most), apart| (sum + apart, f64::max(most, apart)));
        [most, sum / a.len() as f64]
    };
    let [closed, table] = pictures(0.0);
    let apart = difference(&closed, &table);
    println!("largest difference of a pixel {:.1e} of the brightest, mean {:.1e}", apart[0], apart[1]);
    assert!(apart[0] < 2.5e-4 && apart[1] < 2.5e-7, "{apart:?}");
    // A picture that is turned by a sixtieth of a degree differs by more.
    let turned = difference(&closed, &pictures(3e-4)[1]);
    println!("turned: {:.1e}, {:.1e}", turned[0], turned[1]);
    assert!(turned[0] > 1e-2 && turned[1] > 2e-6, "{turned:?}");
}
