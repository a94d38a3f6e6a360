//! Bodies: their light equals the illuminance from size, surface and phase, from 0.01 to 100 pixels and in every
//! projection, and bodies hide exactly the stars behind them.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::{DQuat, DVec3};
use steradian::{
    photometry::rec709::luminance,
    plan::{
        bodies::light::illuminance_of,
        settings::{ExposureSettings, Metering, StarMethod},
    },
    reference::bodies::rays::hides,
    render::{FrameImage, Renderer},
    scene::{
        SceneObjects, SceneSnapshot,
        bodies::{Body, Emission, ReflectionLaw, Spin, Surface, suns},
    },
    view::{Rig, ViewKind, projection::PlaneMapping},
};

/// Distance of the bodies, m.
const DISTANCE_M: f64 = 1e9;

fn body(name: &str, position_m: DVec3, radii_m: DVec3, law: ReflectionLaw) -> Body {
    Body {
        name: name.to_owned(),
        ephemeris: None,
        position_m,
        radii_m,
        orientation: DQuat::IDENTITY,
        spin: Spin::default(),
        surface: Surface { law, geometric_albedo: [0.3, 0.2, 0.1], phase_curve: None, texture: None },
        emission: None,
        seen_through: [1.0; 3],
    }
}

/// Returns a sun that gives about 1e5 lx at a position.
fn sun(place_m: DVec3, direction: DVec3) -> Body {
    let mut sun = body("sun", place_m + direction * 1e12, DVec3::splat(1e7), ReflectionLaw::Lambert);
    sun.surface.geometric_albedo = [0.0; 3];
    sun.emission = Some(Emission { luminance_cd_m2: [3e14; 3], limb_darkening: 0.0, corona: false });
    sun
}

fn scene(bodies: Vec<Body>) -> SceneSnapshot {
    let objects = SceneObjects { bodies: bodies.into_iter().map(Arc::new).collect(), ..Default::default() };
    SceneSnapshot { objects: Arc::new(objects), ..snapshot(Vec::new()) }
}

/// Returns the light, lx, of the pixels within an angle of a direction in view axes.
fn light_around_lx(image: &FrameImage, mapping: &dyn PlaneMapping, direction: DVec3, within_rad: f64) -> f64 {
    let hdr = image.hdr.as_ref().unwrap();
    let mut sum = 0.0;
    for y in 0..image.height {
        for x in 0..image.width {
            let omega = mapping.solid_angle_sr(x, y);
            if omega > 0.0 {
                let pixel_direction =
                    mapping.direction_from_pixel(glam::DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                if pixel_direction.is_some_and(|pixel_direction| pixel_direction.angle_between(direction) < within_rad)
                {
                    let [r, g, b, _] = hdr[(y * image.width + x) as usize].map(f64::from);
                    sum += luminance([r, g, b]) * omega;
                }
            }
        }
    }
    sum
}

/// Returns the approximate size of the pixel around a direction, rad.
fn pixel_across_rad(mapping: &dyn PlaneMapping, direction: DVec3) -> f64 {
    let Some(pixel) = mapping.pixel_from_direction(direction) else { return 0.0 };
    let direction_at = |x: f64, y: f64| mapping.direction_from_pixel(pixel + glam::DVec2::new(x, y));
    let sides = [direction_at(0.5, 0.0), direction_at(-0.5, 0.0), direction_at(0.0, 0.5), direction_at(0.0, -0.5)];
    sides.into_iter().flatten().map(|side| 2.0 * side.angle_between(direction)).fold(0.0, f64::max)
}

/// Returns the relative error of the light of the first body in the view.
fn light_error(renderer: &mut Renderer, rig: &Rig, bodies: Vec<Body>, times: f64) -> f64 {
    let scene = scene(bodies);
    let body = &scene.objects.bodies[0];
    let expected = luminance(illuminance_of(body, DVec3::ZERO, &suns(&scene.objects), 0.0)) * times;
    let frame = render_hdr(renderer, &scene, rig, &settings(StarMethod::Auto));
    let images = rig.views().iter().flat_map(|view| &view.images);
    let found: f64 = frame
        .images
        .iter()
        .zip(images)
        .map(|(image, view_image)| {
            let mapping = view_image.projection.mapping();
            let direction = view_image.camera_from_view.conjugate() * body.position_m;
            let pixel = view_image.projection.middle_pixel_rad();
            let reach = (body.radii_m.max_element() / DISTANCE_M).asin() + 12.0 * pixel;
            light_around_lx(image, mapping, direction, reach)
        })
        .sum();
    found / expected - 1.0
}

/// The diameters are 0.01 to 100 pixels. Bodies have several phases and both reflection laws; suns are tested too.
#[test]
fn a_body_has_its_illuminance_at_every_size() {
    let mut renderer = renderer();
    let mut worst = figures::BODY_FLUX.worst();
    let diameters = [0.01, 0.1, 0.5, 1.0, 1.7, 2.0, 2.3, 2.7, 3.0, 3.5, 4.0, 5.0, 7.0, 11.0, 20.0, 45.0, 100.0];
    let rig = rig(vec![("window", ViewKind::Perspective { size: [160, 140], fov_y_rad: 0.5 })]);
    let pixel_rad = rig.views()[0].images[0].projection.middle_pixel_rad();
    let direction = DVec3::new(0.013, -0.007, -1.0).normalize();
    let place = direction * DISTANCE_M;
    for diameter in diameters {
        let radius_m = DISTANCE_M * (0.5 * diameter * pixel_rad).sin();
        for law in [ReflectionLaw::Lambert, ReflectionLaw::LommelSeeliger] {
            for phase in [0.0_f64, 40.0, 90.0, 130.0] {
                let towards =
                    DQuat::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), phase.to_radians()) * -direction;
                let bodies = vec![body("body", place, DVec3::splat(radius_m), law), sun(place, towards)];
                let error = light_error(&mut renderer, &rig, bodies, 1.0);
                worst.add(error, format_args!("{law:?}, {diameter} px, phase {phase}"));
            }
        }
        let mut own = body("star", place, DVec3::splat(radius_m), ReflectionLaw::Lambert);
        own.emission = Some(Emission { luminance_cd_m2: [1e9, 9e8, 8e8], limb_darkening: 0.6, corona: false });
        let error = light_error(&mut renderer, &rig, vec![own], 1.0);
        worst.add(error, format_args!("a sun of {diameter} px"));
    }
    worst.print();
}

/// Bodies of three sizes are drawn in every projection, even on poles, edges and corners if the picture continues beyond them.
#[test]
fn a_body_has_its_illuminance_in_every_projection() {
    let mut renderer = renderer();
    let mut worst = (0.0_f64, String::new());
    for (name, kind) in all_views() {
        let eyes = if matches!(kind, ViewKind::Stereo { .. }) { 2.0 } else { 1.0 };
        let whole_sphere = matches!(name, "cube" | "equirectangular" | "equidistant-360");
        let mut directions = directions_inside(&view("v", kind.clone()), 6, 24);
        if whole_sphere {
            directions.extend([DVec3::Y, DVec3::new(1e-3, -1.0, 2e-3), DVec3::new(1.0, 1.0, -1.0), DVec3::Z]);
        }
        let rig = rig(vec![(name, kind)]);
        let images = &rig.views()[0].images;
        for direction in directions.iter().map(|direction| direction.normalize()) {
            for diameter in [0.3, 3.0, 9.0] {
                let place = direction * DISTANCE_M;
                let across = images.iter().map(|image| {
                    pixel_across_rad(image.projection.mapping(), image.camera_from_view.conjugate() * direction)
                });
                let pixel_rad = across.fold(0.0, f64::max);
                let radius_m = DISTANCE_M * (0.5 * diameter * pixel_rad).sin();
                let towards = DQuat::from_axis_angle(direction.any_orthonormal_vector(), 0.9) * -direction;
                let radii_m = DVec3::new(1.0, 0.8, 0.6) * radius_m;
                let bodies = vec![body("body", place, radii_m, ReflectionLaw::Lambert), sun(place, towards)];
                let error = light_error(&mut renderer, &rig, bodies, eyes);
                // At the rim of a round picture of the full sphere, all pixels show nearly the same point. The jagged rim covers this point by a few
                // per cent too much or too little.
                let at_rim = name == "equidistant-360" && direction.z > 0.999;
                let limit = if at_rim { 0.04 } else { 0.01 };
                assert!(error.abs() < limit, "{name}, {direction}, {diameter} px: {error}");
                if error.abs() > worst.0 && !at_rim {
                    worst = (error.abs(), format!("{name}, {direction}, {diameter} px"));
                }
            }
        }
    }
    println!(
        "{} projections: largest relative error of the light of a body {:.4} ({})",
        all_views().len(),
        worst.0,
        worst.1
    );
}

/// The comparisons above must fail if the albedo is wrong by two per cent.
#[test]
fn a_wrong_albedo_is_found() {
    let mut renderer = renderer();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.5 })]);
    let place = DVec3::NEG_Z * DISTANCE_M;
    let mut brighter = body("body", place, DVec3::splat(5e7), ReflectionLaw::Lambert);
    brighter.surface.geometric_albedo = brighter.surface.geometric_albedo.map(|albedo| albedo * 1.02);
    let right = scene(vec![body("body", place, DVec3::splat(5e7), ReflectionLaw::Lambert), sun(place, DVec3::Z)]);
    let expected = luminance(illuminance_of(&right.objects.bodies[0], DVec3::ZERO, &suns(&right.objects), 0.0));
    let frame =
        render_hdr(&mut renderer, &scene(vec![brighter, sun(place, DVec3::Z)]), &rig, &settings(StarMethod::Auto));
    let mapping = rig.views()[0].images[0].projection.mapping();
    let error = light_around_lx(&frame.images[0], mapping, DVec3::NEG_Z, PI) / expected - 1.0;
    assert!(error > 0.01, "{error}");
}

/// A body in front of a crowd of stars hides exactly those behind it: the drawn stars are counted, and the light of each
/// star that is far enough from its neighbours is compared with the scene without the body.
#[test]
fn a_transit_hides_exactly_the_stars_behind_it_in_every_projection() {
    let mut renderer = renderer();
    let stars: Vec<DVec3> = spiral(40_000).collect();
    let sky = snapshot(stars.iter().map(|direction| star(*direction, 6.0)).collect());
    let mut figures = Vec::new();
    // Meter the exposure from the mean, so that all stars use the same kernel. Different kernels would lose different shares of light at a rim.
    let mut settings = settings(StarMethod::Auto);
    settings.exposure = ExposureSettings::auto(Metering::Mean);
    for (name, kind) in all_views() {
        let rig = rig(vec![(name, kind.clone())]);
        let count = |renderer: &mut Renderer, objects: SceneObjects| {
            let scene = SceneSnapshot { objects: Arc::new(objects), ..sky.clone() };
            let frame = render_hdr(renderer, &scene, &rig, &settings);
            (frame.views[0].stars_drawn, total_illuminance_lx(&frame, &rig))
        };
        let (all, all_lx) = count(&mut renderer, SceneObjects::default());
        let mut hidden_in_all = 0;
        for direction in directions_inside(&view("v", kind.clone()), 3, 30) {
            // The body is black, so that all light comes from stars. The ellipsoid is tilted, so that its outline is not a circle.
            let mut dark =
                body("dark", direction * DISTANCE_M, DVec3::new(2.4e8, 1.5e8, 0.9e8), ReflectionLaw::Lambert);
            dark.orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.3);
            dark.surface.geometric_albedo = [0.0; 3];
            let (remaining, remaining_lx) =
                count(&mut renderer, SceneObjects { bodies: vec![Arc::new(dark.clone())], ..Default::default() });
            let hidden_in = |image: &steradian::view::ViewImage| {
                let mapping = image.projection.mapping();
                let eye_m = image.eye_position_m;
                let in_picture = |star: &&DVec3| {
                    mapping.pixel_from_direction(image.camera_from_view.conjugate() * **star).is_some_and(|pixel| {
                        let inside = pixel.x >= 0.0 && pixel.y >= 0.0;
                        mapping.shows_full_sphere() || (inside && mapping.contains(pixel.x as u32, pixel.y as u32))
                    })
                };
                stars.iter().filter(in_picture).filter(|star| hides(&dark, eye_m, **star, 0.0)).count() as u64
            };
            let hidden: u64 = rig.views()[0].images.iter().map(hidden_in).sum();
            assert!(hidden > 10, "{name}: there are too few stars behind the body");
            assert_eq!(all - remaining, hidden, "{name}, body at {direction}");
            let lost = (all_lx - remaining_lx) / (all_lx / all as f64) - hidden as f64;
            // The light is not exact, because kernels extend over the borders of pictures.
            assert!(
                lost.abs() < 0.01 * hidden as f64,
                "{name}: the light of {lost} stars is missing besides the hidden ones"
            );
            hidden_in_all += hidden;
        }
        figures.push(format!("{name} {hidden_in_all}"));
    }
    println!("the hidden stars are exactly those behind the body: {}", figures.join(", "));
}

/// The number of stars in the test above must differ for a slightly larger body.
#[test]
fn a_body_two_per_cent_too_large_hides_too_many_stars() {
    let stars: Vec<DVec3> = spiral(40_000).collect();
    let hidden_by = |radius_m: f64| {
        let dark = body("dark", DVec3::NEG_Z * DISTANCE_M, DVec3::splat(radius_m), ReflectionLaw::Lambert);
        stars.iter().filter(|star| hides(&dark, DVec3::ZERO, **star, 0.0)).count()
    };
    assert!(hidden_by(2.04e8) > hidden_by(2e8));
}

/// The outlines and the light of the largest bodies at the largest distances are as accurate as those of other bodies.
#[test]
fn a_giant_has_its_illuminance_and_hides_only_stars_behind_it() {
    let mut renderer = renderer();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [120, 100], fov_y_rad: 0.5 })]);
    let mapping = rig.views()[0].images[0].projection.mapping();
    for (radius_m, distance_m) in [(5e11, 1e13), (1e11, 1e13), (7e8, 1.5e11), (1e13, 3e14)] {
        let mut giant = body("giant", DVec3::NEG_Z * distance_m, DVec3::splat(radius_m), ReflectionLaw::Lambert);
        giant.emission = Some(Emission { luminance_cd_m2: [1e6; 3], limb_darkening: 0.3, corona: false });
        let around: Vec<DVec3> =
            (0..12).map(|i| DQuat::from_rotation_z(f64::from(i)) * DVec3::new(0.2, 0.0, -1.0)).collect();
        let objects = SceneObjects { bodies: vec![Arc::new(giant)], ..Default::default() };
        let scene = SceneSnapshot {
            objects: Arc::new(objects),
            ..snapshot(around.iter().map(|direction| star(*direction, 3.0)).collect())
        };
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
        assert_eq!(frame.views[0].stars_drawn, 12, "{radius_m:e} m at {distance_m:e} m");
        let expected = luminance(illuminance_of(&scene.objects.bodies[0], DVec3::ZERO, &[], 0.0));
        let found = light_around_lx(&frame.images[0], mapping, DVec3::NEG_Z, 0.15);
        assert!((found / expected - 1.0).abs() < 0.01, "{radius_m:e} m at {distance_m:e} m: {found} {expected}");
    }
}

/// A sun at a distance of 1000 parsecs is drawn as a star.
#[test]
fn a_sun_at_a_kiloparsec_is_visible() {
    let mut renderer = renderer();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.5 })]);
    let mut sun = body("sun", DVec3::NEG_Z * 3.0857e19, DVec3::splat(6.957e8), ReflectionLaw::Lambert);
    sun.emission = Some(Emission { luminance_cd_m2: [1.9e9; 3], limb_darkening: 0.0, corona: false });
    let scene = scene(vec![sun]);
    let expected = luminance(illuminance_of(&scene.objects.bodies[0], DVec3::ZERO, &[], 0.0));
    let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
    let found = total_illuminance_lx(&frame, &rig);
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
}

/// Occlusion between bodies is decided per ray, not by the distances of their centres: a small body low above a large
/// one is in front of it.
#[test]
fn a_small_body_low_above_a_large_one_is_visible() {
    let mut renderer = renderer();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [100, 100], fov_y_rad: 1.0 })]);
    let mut ground = body("ground", DVec3::new(0.0, -6.8e6, 0.0), DVec3::splat(6.4e6), ReflectionLaw::Lambert);
    ground.emission = Some(Emission { luminance_cd_m2: [1.0; 3], limb_darkening: 0.0, corona: false });
    let station_m = DVec3::new(0.0, -2.54e5, -5.44e5);
    let mut station = body("station", station_m, DVec3::splat(5e4), ReflectionLaw::Lambert);
    station.emission = Some(Emission { luminance_cd_m2: [100.0; 3], limb_darkening: 0.0, corona: false });
    let scene = scene(vec![ground, station]);
    let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
    let mapping = rig.views()[0].images[0].projection.mapping();
    let pixel = mapping.pixel_from_direction(station_m.normalize()).unwrap();
    let hdr = frame.images[0].hdr.as_ref().unwrap();
    let luminance_cd_m2 = hdr[pixel.y as usize * 100 + pixel.x as usize][1];
    assert!((luminance_cd_m2 - 100.0).abs() < 0.1, "{luminance_cd_m2}");
}

/// A body in the shadow of another one has the same umbra and penumbra as in the f64 reference.
#[test]
fn shadows_on_bodies_equal_the_reference() {
    let sun_m = DVec3::new(1.0, 0.3, 0.2).normalize() * 1.5e11;
    let mut sun = body("sun", sun_m, DVec3::splat(7e8), ReflectionLaw::Lambert);
    sun.emission = Some(Emission { luminance_cd_m2: [2e9, 1.9e9, 1.8e9], limb_darkening: 0.0, corona: false });
    let lit = body("lit", DVec3::NEG_Z * 4e7, DVec3::new(6.4e6, 6.2e6, 5.9e6), ReflectionLaw::Lambert);
    let towards = (sun_m - lit.position_m).normalize();
    let across = towards.any_orthonormal_vector();
    let caster = |part: f64| {
        let point_m = lit.position_m + towards * 4e8 + across * part * 6e6;
        body("caster", point_m, DVec3::splat(2e6), ReflectionLaw::Lambert)
    };
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [96, 96], fov_y_rad: 0.4 })]);
    let mapping = rig.views()[0].images[0].projection.mapping();
    let mut lights = Vec::new();
    for part in [0.0, 0.6, 3.0] {
        let scene = scene(vec![sun.clone(), lit.clone(), caster(part)]);
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::Auto));
        let twin = steradian::reference::bodies::rays::draw(&scene.objects, DVec3::ZERO, DQuat::IDENTITY, mapping, 12);
        let hdr = frame.images[0].hdr.as_ref().unwrap();
        let brightest = twin.luminance_cd_m2.iter().map(|rgb| rgb[1]).fold(0.0, f64::max);
        let error = |(found, expected): (&[f32; 4], &[f64; 3])| (f64::from(found[1]) - expected[1]).abs() / brightest;
        let worst = hdr.iter().zip(&twin.luminance_cd_m2).map(error).fold(0.0, f64::max);
        let light: f64 = illuminance_lx(&frame.images[0], mapping);
        println!("shadow {part}: worst {worst:.1e}, light {light:.4e} lx");
        // The reference is not exact for pixels on the limb and on the edge of the shadow, which it divides into a finite number of parts.
        assert!(worst < 0.06, "{part}: {worst}");
        lights.push(light);
        let whole = luminance(illuminance_of(&lit, DVec3::ZERO, &suns(&scene.objects), 0.0));
        assert!((light / whole - 1.0).abs() < 0.02, "{part}: {light} {whole}");
    }
    assert!(lights[0] < 0.97 * lights[2] && lights[1] < lights[2], "{lights:?}");
}

/// A disc behind a nearer and larger one is hidden completely, however the limbs cross pixels.
#[test]
fn a_sun_behind_a_larger_moon_is_hidden_in_every_pixel() {
    let direction = DVec3::new(0.02, 0.01, -1.0).normalize();
    let mut sun = body("sun", direction * 1.5e11, DVec3::splat(6.957e8), ReflectionLaw::Lambert);
    sun.emission = Some(Emission { luminance_cd_m2: [2e9; 3], limb_darkening: 0.0, corona: false });
    // The moon is larger than the Sun by 2 %, which is less than a pixel.
    let moon = |part: f64| {
        let offset_m = direction.any_orthonormal_vector() * part;
        body(
            "moon",
            direction * 3.6e8 + offset_m,
            DVec3::splat(3.6e8 * 6.957e8 / 1.5e11 * 1.02),
            ReflectionLaw::Lambert,
        )
    };
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.05 })]);
    let mapping = rig.views()[0].images[0].projection.mapping();
    let light = |bodies: Vec<Body>| {
        let frame = render_hdr(&mut renderer(), &scene(bodies), &rig, &settings(StarMethod::Auto));
        illuminance_lx(&frame.images[0], mapping)
    };
    let whole = light(vec![sun.clone()]);
    assert_eq!(light(vec![sun.clone(), moon(0.0)]), 0.0);
    // With an offset of a tenth of the radius, a crescent remains visible. Its share follows from the area between two circles.
    let offset_m = 1.7e5;
    let visible = light(vec![sun.clone(), moon(offset_m)]) / whole;
    let radius = 6.957e8 / 1.5e11;
    let expected = 1.0 - steradian::scene::bodies::hidden_share(radius, 1.02 * radius, offset_m / 3.6e8);
    println!("visible share {visible:.5}, computed from areas {expected:.5}");
    assert!(expected > 0.01 && (visible / expected - 1.0).abs() < 0.03, "{visible} {expected}");
}
