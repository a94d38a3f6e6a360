//! The ground and the air around an observer: pixels against the twin in f64, stars by the light that the air leaves, and nothing from below the horizon.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use steradian::{
    catalogue::StarRecord,
    observer::{Clock, Observer, Place, horizontal_direction},
    photometry::{
        atmosphere::{Air, glow_of},
        blackbody::rec709_in_gamut,
        rec709::luminance,
    },
    plan::settings::{GlareMethod, GlareSettings, RenderSettings, StarMethod},
    reference::air::light::pixel,
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::SolarBody,
        landscape::Landscape,
        surroundings::{Ground, Horizon, LocalSky, Surroundings},
    },
    units::illuminance_lx_from_magnitude,
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

const AU_M: f64 = 1.495_978_707e11;

/// What is around an observer: hills in the south, and a glow of so many magnitudes per square arcsecond.
fn surroundings(glow_mag: f64) -> Surroundings {
    let hills = [[0.0, 0.0], [2.0, 0.02], [3.0, 0.12], [4.0, 0.05], [5.0, 0.0]];
    let ground = Ground { horizon: Horizon::new(hills.to_vec()), albedo: 0.2, landscape: None };
    Surroundings { air: Some(Air::new(0.2, 500.0, glow_of(glow_mag, [1.0; 3]))), ground: Some(ground) }
}

/// A camera on the ground that looks to the south, with the zenith up, stars at azimuths and altitudes in degrees, and a Sun.
fn scene(stars: &[([f64; 2], f32)], sun_deg: Option<[f64; 2]>, surroundings: Surroundings) -> SceneSnapshot {
    let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 500.0 };
    let observer = Observer::new(place, Clock::default(), 8.2e8);
    let icrs_from_horizon = observer.icrs_from_horizon(8.2e8);
    let towards = |[azimuth, altitude]: [f64; 2]| {
        icrs_from_horizon * horizontal_direction(azimuth.to_radians(), altitude.to_radians())
    };
    let records: Vec<StarRecord> = stars.iter().map(|(at, magnitude)| star(towards(*at), *magnitude)).collect();
    let position_m = observer.epoch.position_m;
    let sun = sun_deg.map(|at| Arc::new(SolarBody::Sun.body("sun", position_m + towards(at) * AU_M)));
    let objects = SceneObjects {
        bodies: sun.into_iter().collect(),
        time_s: 8.2e8,
        observer: Some(observer),
        surroundings: Some(Arc::new(surroundings)),
        ..Default::default()
    };
    let to_south = icrs_from_horizon * DQuat::from_rotation_y(PI);
    let camera = Camera { position_m, world_from_camera: to_south.normalize(), ..Camera::default() };
    SceneSnapshot { objects: Arc::new(objects), camera, ..snapshot(records) }
}

fn local_sky(scene: &SceneSnapshot) -> LocalSky {
    scene.objects.local_sky(scene.camera.position_m).unwrap()
}

fn views() -> Rig {
    // The dome looks up, the window to the south with the horizon a little below its middle.
    let up = DQuat::from_rotation_x(PI / 2.0);
    let raised = DQuat::from_rotation_x(0.2);
    let dome = ViewKind::Fisheye { size: [96, 96], mapping: FisheyeMapping::Equidistant, fov_rad: 3.4 };
    let window = ViewKind::Perspective { size: [160, 90], fov_y_rad: 1.0 };
    let view = |name: &str, kind, turned| View::new(name, kind, turned, DVec3::ZERO).unwrap();
    Rig::new(vec![view("dome", dome, up), view("south", window, raised)]).unwrap()
}

/// Largest relative error of a channel of the pixels that are not within `near_rad` of `except`, and how many pixels were compared.
fn worst_of(
    scene: &SceneSnapshot,
    settings: &RenderSettings,
    twin: &LocalSky,
    except: Option<(DVec3, f64)>,
) -> (f64, usize) {
    let rig = views();
    let frame = render_hdr(&mut renderer(), scene, &rig, settings);
    let viewports = rig.viewports(scene.camera.world_from_camera);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for (image, viewport) in frame.images.iter().zip(&viewports) {
        let mapping = viewport.projection.mapping();
        let hdr = image.hdr.as_ref().unwrap();
        for y in 0..image.height {
            for x in 0..image.width {
                let Some(expected) = pixel(twin, mapping, viewport.world_from_view, [x, y], [0.0; 3], 16) else {
                    continue;
                };
                let at = viewport.world_from_view
                    * mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap();
                // Where hill and sky meet in a pixel, both say how far it is covered in their own way.
                let altitude = (twin.horizon_from_world * at).y;
                if except.is_some_and(|(direction, near)| at.angle_between(direction) < near)
                    || (-0.06..0.16).contains(&altitude)
                {
                    continue;
                }
                let found = hdr[(y * image.width + x) as usize];
                for c in 0..3 {
                    worst = worst.max((f64::from(found[c]) / expected[c] - 1.0).abs());
                }
                compared += 1;
            }
        }
    }
    (worst, compared)
}

#[test]
fn pixels_of_sky_and_ground_are_those_of_the_twin() {
    for (sun_deg, near_rad) in [([200.0, 40.0], 0.2), ([250.0, 2.0], 0.2), ([250.0, -5.0], 0.0), ([250.0, -14.0], 0.0)]
    {
        let scene = scene(&[], Some(sun_deg), surroundings(22.0));
        let sky = local_sky(&scene);
        let sun = scene.objects.bodies[0].position_m - scene.camera.position_m;
        let (worst, compared) = worst_of(&scene, &settings(StarMethod::Auto), &sky, Some((sun.normalize(), near_rad)));
        println!("Sun {sun_deg:?}: {compared} pixels, worst {worst:.1e}");
        assert!(worst < 3e-5 && compared > 10_000, "{sun_deg:?}: {worst} {compared}");
        // A Sun a degree lower, or as many hills elsewhere, are told apart.
        let lower = self::scene(&[], Some([sun_deg[0], sun_deg[1] - 1.0]), surroundings(22.0));
        assert!(
            worst_of(&scene, &settings(StarMethod::Auto), &local_sky(&lower), Some((sun.normalize(), 0.2))).0 > 0.01
        );
    }
}

#[test]
fn glare_leaves_the_light_of_an_even_sky_as_it_is() {
    let scene = scene(&[], None, surroundings(18.0));
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction: 0.1, ..GlareSettings::default() };
    let settings = RenderSettings { glare, ..settings(StarMethod::Auto) };
    let (worst, _) = worst_of(&scene, &settings, &local_sky(&scene), None);
    assert!(worst < 1e-4, "{worst}");
}

/// A panorama of a hilly line with windows in it, in soft colours: smooth within a few texels, as the twin has no levels.
fn panorama() -> Landscape {
    let size = [2048_u32, 1024];
    let texels = (0..size[0] * size[1]).map(|index| {
        let [column, row] = [index % size[0], index / size[0]].map(f64::from);
        let azimuth = (column + 0.5) / f64::from(size[0]) * 2.0 * PI;
        let altitude = PI * (0.5 - (row + 0.5) / f64::from(size[1]));
        let hides = ((0.3 + 0.15 * (3.0 * azimuth).sin() - altitude) / 0.1 + 0.5).clamp(0.0, 1.0);
        let window = 1.0 - 0.7 * (-((altitude / 0.12).powi(2) + ((azimuth - 3.0) / 0.2).powi(2))).exp();
        // With the digits that a file has: a bright sky behind a dark hill shows the last of them.
        let held = |value: f64| ((value * 255.0).round() / 255.0) as f32;
        let alpha = held(hides * window);
        let [r, g, b] =
            [0.4 + 0.3 * azimuth.sin(), 0.3, 0.2 + 0.1 * altitude].map(|c| held((c * f64::from(alpha)).sqrt()).powi(2));
        [r, g, b, alpha]
    });
    Landscape::new(size, texels.collect(), 0.4)
}

#[test]
fn a_panorama_stands_before_the_sky_in_the_light_that_falls_on_it() {
    let with = |landscape: Landscape| {
        let ground = Ground { horizon: landscape.horizon(), albedo: 0.2, landscape: Some(Arc::new(landscape)) };
        Surroundings { ground: Some(ground), ..surroundings(21.0) }
    };
    let turned = {
        let mut texels = panorama();
        texels = Landscape::new([2, 1], vec![texels.sample(DVec3::NEG_Y).map(|c| c as f32); 2], 0.0);
        texels
    };
    for sun_deg in [[200.0, 40.0], [250.0, -6.0]] {
        let scene = scene(&[], Some(sun_deg), with(panorama()));
        let rig = views();
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::Auto));
        let errors = |twin: &LocalSky| {
            let (mut squares, mut worst, mut count) = (0.0, 0.0_f64, 0);
            for (image, viewport) in frame.images.iter().zip(&rig.viewports(scene.camera.world_from_camera)) {
                let mapping = viewport.projection.mapping();
                for (index, found) in image.hdr.as_ref().unwrap().iter().enumerate() {
                    let at = [index as u32 % image.width, index as u32 / image.width];
                    let Some(expected) = pixel(twin, mapping, viewport.world_from_view, at, [0.0; 3], 6) else {
                        continue;
                    };
                    let direction =
                        mapping.direction_from_pixel(DVec2::new(f64::from(at[0]) + 0.5, f64::from(at[1]) + 0.5));
                    let towards = viewport.world_from_view * direction.unwrap();
                    let sun = scene.objects.bodies[0].position_m - scene.camera.position_m;
                    if towards.angle_between(sun) < 0.2 {
                        continue;
                    }
                    // Of the sky behind it: beside a bright one a dark hill has little light of its own.
                    let behind = twin.above_cd_m2(towards, [0.0; 3])[1];
                    let off = (f64::from(found[1]) - expected[1]).abs() / expected[1].max(behind);
                    (squares, worst, count) = (squares + off * off, worst.max(off), count + 1);
                }
            }
            ((squares / f64::from(count)).sqrt(), worst, count)
        };
        let (rms, worst, count) = errors(&local_sky(&scene));
        println!("Sun {sun_deg:?}: {count} pixels, rms {rms:.1e}, worst {worst:.1e}");
        // Levels blur an edge by a part of a pixel.
        assert!(rms < 0.02 && worst < 0.3 && count > 18_000, "{rms} {worst} {count}");
        let other = self::scene(&[], Some(sun_deg), with(turned.clone()));
        assert!(errors(&local_sky(&other)).0 > 0.1);
    }
}

#[test]
fn hills_end_where_their_line_is() {
    let scene = scene(&[], None, surroundings(18.0));
    let rig = views();
    let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::Auto));
    let viewports = rig.viewports(scene.camera.world_from_camera);
    let (image, viewport, sky) = (&frame.images[1], &viewports[1], local_sky(&scene));
    let mapping = viewport.projection.mapping();
    let hdr = image.hdr.as_ref().unwrap();
    for x in (0..image.width).step_by(7) {
        // Solid angle of ground in a column: the horizon's place to a part of a pixel.
        let (mut found, mut expected) = (0.0, 0.0);
        for y in 0..image.height {
            let at = mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap();
            let above = sky.above_cd_m2(viewport.world_from_view * at, [0.0; 3]);
            let share = |light: f64| (light - above[1]) / (sky.ground_cd_m2[1] - above[1]);
            found += share(f64::from(hdr[(y * image.width + x) as usize][1]));
            expected += share(pixel(&sky, mapping, viewport.world_from_view, [x, y], [0.0; 3], 32).unwrap()[1]);
        }
        assert!((found - expected).abs() < 0.05, "column {x}: {found} {expected}");
    }
}

#[test]
fn stars_have_the_light_that_the_air_leaves_and_none_shines_from_below() {
    let magnitude = 1.0_f32;
    let window = |altitude_deg: f64| {
        let kind = ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.05 };
        let raised = DQuat::from_rotation_x(altitude_deg.to_radians());
        Rig::new(vec![View::new("star", kind, raised, DVec3::ZERO).unwrap()]).unwrap()
    };
    for (altitude_deg, method) in [
        (80.0, StarMethod::Auto),
        (30.0, StarMethod::BSpline),
        (12.0, StarMethod::Tent),
        (9.0, StarMethod::PixelGaussian),
        (3.0, StarMethod::Auto),
        (-5.0, StarMethod::Auto),
    ] {
        // Without any glow, behind hills of 0.12 rad (6.9 degrees).
        let scene = scene(&[([180.0, altitude_deg], magnitude)], None, surroundings(30.0));
        let rig = window(altitude_deg);
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(method));
        let mapping = rig.views()[0].images[0].projection.mapping();
        let dark = scene_without_stars(&scene);
        let background = render_hdr(&mut renderer(), &dark, &rig, &settings(method));
        let light = illuminance_lx(&frame.images[0], mapping) - illuminance_lx(&background.images[0], mapping);
        let sky = local_sky(&scene);
        let towards = rig.viewports(scene.camera.world_from_camera)[0].world_from_view * DVec3::NEG_Z;
        let through = sky.transmission(towards);
        let colour = rec709_in_gamut(5772.0);
        let expected =
            illuminance_lx_from_magnitude(f64::from(magnitude)) * luminance([0, 1, 2].map(|c| colour[c] * through[c]));
        println!("{altitude_deg} degrees: {light:.3e} lx of {expected:.3e}");
        assert!((light - expected).abs() < 2e-3 * expected + 1e-12, "{altitude_deg}: {light} {expected}");
    }
}

fn scene_without_stars(scene: &SceneSnapshot) -> SceneSnapshot {
    SceneSnapshot { stars: snapshot(Vec::new()).stars, ..scene.clone() }
}

#[test]
fn a_low_sun_is_red_and_one_below_the_horizon_gives_no_glare() {
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction: 0.1, ..GlareSettings::default() };
    let settings = RenderSettings { glare, ..settings(StarMethod::Auto) };
    let without_air = |mut around: Surroundings| {
        around.air = None;
        around
    };
    let rig = views();
    let light = |sun_deg: [f64; 2], around: Surroundings| -> [f64; 3] {
        let scene = scene(&[], Some(sun_deg), around);
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings);
        let mapping = rig.views()[0].images[0].projection.mapping();
        let image = &frame.images[0];
        let hdr = image.hdr.as_ref().unwrap();
        [0, 1, 2].map(|c| {
            (0..image.width * image.height)
                .map(|i| f64::from(hdr[i as usize][c]) * mapping.solid_angle_sr(i % image.width, i / image.width))
                .sum()
        })
    };
    // Behind the ground, without air: there is no light at all.
    assert_eq!(light([180.0, -3.0], without_air(surroundings(22.0))), [0.0; 3]);
    let high = light([90.0, 60.0], without_air(surroundings(22.0)));
    assert!(high[1] > 1e5, "{high:?}");
    // At 4 degrees in the east, without hills, half of the green and most of the blue are gone.
    let scene = scene(&[], Some([90.0, 4.0]), surroundings(22.0));
    let sky = local_sky(&scene);
    let [r, g, b] = sky.transmission((scene.objects.bodies[0].position_m - scene.camera.position_m).normalize());
    assert!(r > 1.3 * g && g > 1.5 * b && g < 0.2, "{r} {g} {b}");
    let low = light([90.0, 4.0], surroundings(22.0));
    let disc_and_sky = low[1] / high[1];
    assert!(disc_and_sky < 0.5 && low[0] / low[2] > 1.5 * high[0] / high[2], "{low:?} {high:?}");
}
