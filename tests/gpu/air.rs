//! The ground and the air around an observer: pixels compared with the f64 reference, stars dimmed by extinction,
//! refraction compared with a published formula, and no light from below the horizon.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use steradian::{
    catalogue::StarRecord,
    observer::{Clock, Observer, Place, RefractingAir, horizontal_direction},
    photometry::{
        atmosphere::{Air, glow_of},
        blackbody::rec709_in_gamut,
        rec709::luminance,
    },
    plan::settings::{GlareMethod, GlareSettings, RenderSettings, StarMethod},
    reference::air::light::pixel,
    render::Frame,
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, SolarBody},
        landscape::Landscape,
        surroundings::{Ground, Horizon, LocalSky, Surroundings},
    },
    units::illuminance_lx_from_magnitude,
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

const AU_M: f64 = 1.495_978_707e11;

/// Returns the surroundings of an observer: hills in the south, and an airglow in magnitudes per square arcsecond.
fn surroundings(glow_mag: f64) -> Surroundings {
    let hills = [[0.0, 0.0], [2.0, 0.02], [3.0, 0.12], [4.0, 0.05], [5.0, 0.0]];
    let ground = Ground { horizon: Horizon::new(hills.to_vec()), albedo: 0.2, landscape: None };
    Surroundings {
        air: Some(Air::new(0.2, 500.0, glow_of(glow_mag, [1.0; 3]))),
        refraction: Some(RefractingAir::at_height(500.0)),
        ground: Some(ground),
    }
}

/// Returns a scene with a camera on the ground that looks south with the zenith up, stars at azimuths and altitudes in
/// degrees, and a Sun. All positions are without refraction.
fn scene(stars: &[([f64; 2], f32)], sun_deg: Option<[f64; 2]>, surroundings: Surroundings) -> SceneSnapshot {
    let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 500.0 };
    let observer = Observer::new(place, Clock::default(), 8.2e8);
    let icrs_from_horizon = observer.icrs_from_horizon(8.2e8);
    let towards = |[azimuth, altitude]: [f64; 2]| {
        icrs_from_horizon * horizontal_direction(azimuth.to_radians(), altitude.to_radians())
    };
    let records: Vec<StarRecord> = stars.iter().map(|(at, magnitude)| star(towards(*at), *magnitude)).collect();
    let position_m = observer.epoch.position_m;
    let sun = sun_deg.map(|at| Arc::new(Body::preset(SolarBody::Sun, "sun", position_m + towards(at) * AU_M)));
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
    // The dome looks up; the window looks south, with the horizon a little below its middle.
    let up = DQuat::from_rotation_x(PI / 2.0);
    let raised = DQuat::from_rotation_x(0.2);
    let dome = ViewKind::Fisheye { size: [96, 96], mapping: FisheyeMapping::Equidistant, fov_rad: 3.4 };
    let window = ViewKind::Perspective { size: [160, 90], fov_y_rad: 1.0 };
    let view = |name: &str, kind, turned| View::new(name, kind, turned, DVec3::ZERO).unwrap();
    Rig::new(vec![view("dome", dome, up), view("south", window, raised)]).unwrap()
}

/// Returns the largest relative error of any channel, and the number of compared pixels. Pixels within `near_rad` of
/// the direction `except` are skipped.
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
                let towards = viewport.world_from_view
                    * mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap();
                // Skip pixels on the outline of the hills, for which the two renderers estimate the covered share in
                // different ways.
                let altitude = (twin.horizon_from_world * towards).y;
                if except.is_some_and(|(direction, near)| towards.angle_between(direction) < near)
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
fn pixels_of_sky_and_ground_equal_the_reference() {
    for (sun_deg, near_rad) in [([200.0, 40.0], 0.2), ([250.0, 2.0], 0.2), ([250.0, -5.0], 0.0), ([250.0, -14.0], 0.0)]
    {
        let scene = scene(&[], Some(sun_deg), surroundings(22.0));
        let sky = local_sky(&scene);
        let sun = scene.objects.bodies[0].position_m - scene.camera.position_m;
        let (worst, compared) = worst_of(&scene, &settings(StarMethod::Auto), &sky, Some((sun.normalize(), near_rad)));
        println!("Sun {sun_deg:?}: {compared} pixels, worst {worst:.1e}");
        assert!(worst < 3e-5 && compared > 10_000, "{sun_deg:?}: {worst} {compared}");
        // The comparison must fail for a Sun that is one degree lower.
        let lower = self::scene(&[], Some([sun_deg[0], sun_deg[1] - 1.0]), surroundings(22.0));
        assert!(
            worst_of(&scene, &settings(StarMethod::Auto), &local_sky(&lower), Some((sun.normalize(), 0.2))).0 > 0.01
        );
    }
}

#[test]
fn without_ground_the_night_is_dark_and_has_no_black_ring_below_the_horizon() {
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction: 0.1, ..GlareSettings::default() };
    let settings = RenderSettings { glare, ..settings(StarMethod::Auto) };
    // A Sun 45 degrees below the horizon is behind the Earth. A Sun 2 degrees above it causes visible glare.
    for (sun_deg, is_night) in [([180.0, -45.0], true), ([180.0, 2.0], false)] {
        let scene = scene(&[], Some(sun_deg), without_ground(22.0));
        let sky = local_sky(&scene);
        let rig = views();
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings);
        let viewport = &rig.viewports(scene.camera.world_from_camera)[1];
        let image = &frame.images[1];
        let mut worst = 1.0_f64;
        for (index, pixel) in image.hdr.as_ref().unwrap().iter().enumerate() {
            let [x, y] = [index as u32 % image.width, index as u32 / image.width].map(f64::from);
            let towards = viewport.projection.mapping().direction_from_pixel(DVec2::new(x + 0.5, y + 0.5)).unwrap();
            let expected = sky.luminance_cd_m2(viewport.world_from_view * towards)[1];
            let ratio = f64::from(pixel[1]) / expected;
            worst = worst.max(ratio).max(ratio.recip());
        }
        println!("Sun {sun_deg:?}: pixels differ from the sky by a factor of at most {worst:.2}");
        assert_eq!(worst < 1.1, is_night, "{sun_deg:?}: {worst}");
    }
}

#[test]
fn glare_does_not_change_a_uniform_sky() {
    let scene = scene(&[], None, surroundings(18.0));
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction: 0.1, ..GlareSettings::default() };
    let settings = RenderSettings { glare, ..settings(StarMethod::Auto) };
    let (worst, _) = worst_of(&scene, &settings, &local_sky(&scene), None);
    assert!(worst < 1e-4, "{worst}");
}

/// Returns a panorama of hills with windows in it, in soft colours. Its edges are smooth over a few texels, because the
/// reference has no mipmap levels.
fn panorama() -> Landscape {
    let size = [2048_u32, 1024];
    let texels = (0..size[0] * size[1]).map(|index| {
        let [column, row] = [index % size[0], index / size[0]].map(f64::from);
        let azimuth = (column + 0.5) / f64::from(size[0]) * 2.0 * PI;
        let altitude = PI * (0.5 - (row + 0.5) / f64::from(size[1]));
        let hides = ((0.3 + 0.15 * (3.0 * azimuth).sin() - altitude) / 0.1 + 0.5).clamp(0.0, 1.0);
        let window = 1.0 - 0.7 * (-((altitude / 0.12).powi(2) + ((azimuth - 3.0) / 0.2).powi(2))).exp();
        // Round to 8 bits, as in a file, because in front of a bright sky even the last bit of a dark hill is visible.
        let rounded = |value: f64| ((value * 255.0).round() / 255.0) as f32;
        let alpha = rounded(hides * window);
        let [r, g, b] = [0.4 + 0.3 * azimuth.sin(), 0.3, 0.2 + 0.1 * altitude]
            .map(|c| rounded((c * f64::from(alpha)).sqrt()).powi(2));
        [r, g, b, alpha]
    });
    Landscape::new(size, texels.collect(), 0.4)
}

#[test]
fn a_panorama_covers_the_sky_and_reflects_the_incident_light() {
    let surroundings_with = |landscape: Landscape| {
        let ground = Ground { horizon: landscape.horizon(), albedo: 0.2, landscape: Some(Arc::new(landscape)) };
        Surroundings { ground: Some(ground), ..surroundings(21.0) }
    };
    let turned = {
        let mut texels = panorama();
        texels = Landscape::new([2, 1], vec![texels.sample(DVec3::NEG_Y).map(|c| c as f32); 2], 0.0);
        texels
    };
    for sun_deg in [[200.0, 40.0], [250.0, -6.0]] {
        let scene = scene(&[], Some(sun_deg), surroundings_with(panorama()));
        let rig = views();
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::Auto));
        let errors = |twin: &LocalSky| {
            let (mut squares, mut worst, mut count) = (0.0, 0.0_f64, 0);
            for (image, viewport) in frame.images.iter().zip(&rig.viewports(scene.camera.world_from_camera)) {
                let mapping = viewport.projection.mapping();
                for (index, found) in image.hdr.as_ref().unwrap().iter().enumerate() {
                    let xy = [index as u32 % image.width, index as u32 / image.width];
                    let Some(expected) = pixel(twin, mapping, viewport.world_from_view, xy, [0.0; 3], 6) else {
                        continue;
                    };
                    let direction =
                        mapping.direction_from_pixel(DVec2::new(f64::from(xy[0]) + 0.5, f64::from(xy[1]) + 0.5));
                    let towards = viewport.world_from_view * direction.unwrap();
                    let sun = scene.objects.bodies[0].position_m - scene.camera.position_m;
                    if towards.angle_between(sun) < 0.2 {
                        continue;
                    }
                    // Compute the error relative to the brighter of hill and sky behind it, because a dark hill in
                    // front of a bright sky has little light itself.
                    let behind = twin.above_cd_m2(towards, [0.0; 3])[1];
                    let error = (f64::from(found[1]) - expected[1]).abs() / expected[1].max(behind);
                    (squares, worst, count) = (squares + error * error, worst.max(error), count + 1);
                }
            }
            ((squares / f64::from(count)).sqrt(), worst, count)
        };
        let (rms, worst, count) = errors(&local_sky(&scene));
        println!("Sun {sun_deg:?}: {count} pixels, rms {rms:.1e}, worst {worst:.1e}");
        // Mipmap levels blur an edge by a fraction of a pixel.
        assert!(rms < 0.02 && worst < 0.3 && count > 18_000, "{rms} {worst} {count}");
        let other = self::scene(&[], Some(sun_deg), surroundings_with(turned.clone()));
        assert!(errors(&local_sky(&other)).0 > 0.1);
    }
}

#[test]
fn hills_end_at_the_configured_horizon() {
    let scene = scene(&[], None, surroundings(18.0));
    let rig = views();
    let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::Auto));
    let viewports = rig.viewports(scene.camera.world_from_camera);
    let (image, viewport, sky) = (&frame.images[1], &viewports[1], local_sky(&scene));
    let mapping = viewport.projection.mapping();
    let hdr = image.hdr.as_ref().unwrap();
    for x in (0..image.width).step_by(7) {
        // The number of ground pixels in a column gives the altitude of the horizon to a fraction of a pixel.
        let (mut found, mut expected) = (0.0, 0.0);
        for y in 0..image.height {
            let direction = mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap();
            let above = sky.above_cd_m2(viewport.world_from_view * direction, [0.0; 3]);
            let share = |light: f64| (light - above[1]) / (sky.ground_cd_m2[1] - above[1]);
            found += share(f64::from(hdr[(y * image.width + x) as usize][1]));
            expected += share(pixel(&sky, mapping, viewport.world_from_view, [x, y], [0.0; 3], 32).unwrap()[1]);
        }
        assert!((found - expected).abs() < 0.05, "column {x}: {found} {expected}");
    }
}

#[test]
fn stars_are_dimmed_by_extinction_and_hidden_below_the_horizon() {
    let magnitude = 1.0_f32;
    let window = |altitude_deg: f64| {
        let kind = ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.05 };
        let raised = DQuat::from_rotation_x(altitude_deg.to_radians());
        Rig::new(vec![View::new("star", kind, raised, DVec3::ZERO).unwrap()]).unwrap()
    };
    // The stars are behind hills of 0.12 rad (6.9 degrees), or there is no ground. There is almost no airglow.
    let hills = surroundings(30.0);
    for (altitude_deg, method, around, is_seen) in [
        (80.0, StarMethod::Auto, &hills, true),
        (30.0, StarMethod::BSpline, &hills, true),
        (12.0, StarMethod::Tent, &hills, true),
        (9.0, StarMethod::PixelGaussian, &hills, true),
        (3.0, StarMethod::Auto, &hills, false),
        (-5.0, StarMethod::Auto, &hills, false),
        (3.0, StarMethod::Auto, &without_ground(30.0), true),
        (-5.0, StarMethod::Auto, &without_ground(30.0), true),
        (-40.0, StarMethod::BSpline, &without_ground(30.0), true),
    ] {
        let scene = scene(&[([180.0, altitude_deg], magnitude)], None, around.clone());
        let rig = window(altitude_deg);
        let frame = render_hdr(&mut renderer(), &scene, &rig, &settings(method));
        let mapping = rig.views()[0].images[0].projection.mapping();
        let dark = scene_without_stars(&scene);
        let background = render_hdr(&mut renderer(), &dark, &rig, &settings(method));
        let light = illuminance_lx(&frame.images[0], mapping) - illuminance_lx(&background.images[0], mapping);
        let sky = local_sky(&scene);
        let towards = rig.viewports(scene.camera.world_from_camera)[0].world_from_view * DVec3::NEG_Z;
        let through = sky.transmission(sky.seen(towards));
        let colour = rec709_in_gamut(5772.0);
        let expected =
            illuminance_lx_from_magnitude(f64::from(magnitude)) * luminance([0, 1, 2].map(|c| colour[c] * through[c]));
        println!("{altitude_deg} degrees: {light:.3e} lx, expected {expected:.3e}");
        assert_eq!(expected > 1e-8, is_seen, "{altitude_deg}");
        assert!((light - expected).abs() < 2e-3 * expected + 1e-12, "{altitude_deg}: {light} {expected}");
    }
}

fn scene_without_stars(scene: &SceneSnapshot) -> SceneSnapshot {
    SceneSnapshot { stars: snapshot(Vec::new()).stars, ..scene.clone() }
}

#[test]
fn a_low_sun_is_red_and_a_sun_below_the_horizon_gives_no_glare() {
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
    // A Sun below the horizon, without air, gives no light.
    assert_eq!(light([180.0, -3.0], without_air(surroundings(22.0))), [0.0; 3]);
    let high = light([90.0, 60.0], without_air(surroundings(22.0)));
    assert!(high[1] > 1e5, "{high:?}");
    // In the east, where there are no hills, the air absorbs more than 80 % of the green light at an altitude of 4
    // degrees.
    let scene = scene(&[], Some([90.0, 4.0]), surroundings(22.0));
    let sky = local_sky(&scene);
    let towards = (scene.objects.bodies[0].position_m - scene.camera.position_m).normalize();
    let [r, g, b] = sky.transmission(sky.seen(towards));
    assert!(r > 1.3 * g && g > 1.5 * b && g < 0.2, "{r} {g} {b}");
    let low = light([90.0, 4.0], surroundings(22.0));
    let disc_and_sky = low[1] / high[1];
    assert!(disc_and_sky < 0.5 && low[0] / low[2] > 1.5 * high[0] / high[2], "{low:?} {high:?}");
}

/// Returns the refraction at an apparent altitude, arcmin, in air of a relative density: G. G. Bennett, Journal of
/// Navigation 35, 255, 1982, with its second term.
fn bennett_arcmin(apparent_deg: f64, density: f64) -> f64 {
    let first = 1.0 / (apparent_deg + 7.31 / (apparent_deg + 4.4)).to_radians().tan();
    density * (first - 0.06 * (14.7 * first + 13.0).to_radians().sin())
}

/// Returns the mean position and the standard deviation of the light in an image, each as degrees of altitude and
/// degrees across. The camera looks south.
fn place_of_light(frame: &Frame, rig: &Rig, without: Option<&Frame>) -> [[f64; 2]; 2] {
    let mapping = rig.views()[0].images[0].projection.mapping();
    let turned = rig.viewports(DQuat::IDENTITY)[0].world_from_view;
    let image = &frame.images[0];
    let hdr = image.hdr.as_ref().unwrap();
    let dark = without.map(|without| without.images[0].hdr.as_ref().unwrap());
    let (mut sum, mut first, mut second) = (0.0, [0.0; 2], [0.0; 2]);
    for y in 0..image.height {
        for x in 0..image.width {
            let index = (y * image.width + x) as usize;
            let behind = dark.map_or(0.0, |dark| f64::from(dark[index][1]));
            let light = (f64::from(hdr[index][1]) - behind) * mapping.solid_angle_sr(x, y);
            let towards =
                turned * mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap();
            let place =
                [towards.y.asin().to_degrees(), towards.x.atan2(-towards.z).to_degrees() * towards.y.asin().cos()];
            sum += light;
            for axis in 0..2 {
                first[axis] += light * place[axis];
                second[axis] += light * place[axis] * place[axis];
            }
        }
    }
    let mean = first.map(|moment| moment / sum);
    [mean, [0, 1].map(|axis| (second[axis] / sum - mean[axis] * mean[axis]).sqrt())]
}

fn without_ground(glow_mag: f64) -> Surroundings {
    Surroundings { ground: None, ..surroundings(glow_mag) }
}

#[test]
fn refraction_of_stars_and_planets_equals_bennetts_formula() {
    let density = RefractingAir::at_height(500.0).density();
    for apparent_deg in [0.2, 1.0, 3.0, 8.0, 15.0, 30.0, 60.0] {
        let lifted_deg = bennett_arcmin(apparent_deg, density) / 60.0;
        let kind = ViewKind::Perspective { size: [64, 64], fov_y_rad: 0.01 };
        let raised = DQuat::from_rotation_x(f64::to_radians(apparent_deg));
        let rig = Rig::new(vec![View::new("star", kind, raised, DVec3::ZERO).unwrap()]).unwrap();
        let settings = settings(StarMethod::Auto);
        let scene = scene(&[([180.0, apparent_deg - lifted_deg], -1.0)], None, without_ground(30.0));
        let draw = |scene: &SceneSnapshot| render_hdr(&mut renderer(), scene, &rig, &settings);
        let dark = draw(&scene_without_stars(&scene));
        let [[altitude_deg, _], _] = place_of_light(&draw(&scene), &rig, Some(&dark));
        // Draw a planet at the same position, so distant that it is a point.
        let towards = {
            let local = local_sky(&scene).horizon_from_world.transpose();
            local * horizontal_direction(PI, f64::to_radians(apparent_deg - lifted_deg))
        };
        let mut planet = Body::preset(SolarBody::Venus, "venus", scene.camera.position_m + towards * AU_M);
        planet.surface.phase_curve = None;
        let sun = Body::preset(SolarBody::Sun, "sun", scene.camera.position_m - towards * AU_M);
        let bodies = vec![Arc::new(planet), Arc::new(sun)];
        let with_planet =
            SceneSnapshot { objects: Arc::new(SceneObjects { bodies, ..(*scene.objects).clone() }), ..scene.clone() };
        let with_planet = scene_without_stars(&with_planet);
        let objects = SceneObjects { bodies: with_planet.objects.bodies[1..].to_vec(), ..(*scene.objects).clone() };
        let without = SceneSnapshot { objects: Arc::new(objects), ..with_planet.clone() };
        let [[of_planet_deg, _], _] = place_of_light(&draw(&with_planet), &rig, Some(&draw(&without)));
        let errors_arcsec = [altitude_deg, of_planet_deg].map(|found| 3600.0 * (found - apparent_deg));
        println!(
            "{apparent_deg} degrees: star {:.2}, planet {:.2} arcsec from the expected place, refraction {:.1}",
            errors_arcsec[0],
            errors_arcsec[1],
            3600.0 * lifted_deg
        );
        let limit_arcsec = if apparent_deg >= 15.0 { 1.5 } else { 4.0 };
        assert!(errors_arcsec.iter().all(|error| error.abs() < limit_arcsec), "{apparent_deg}: {errors_arcsec:?}");
    }
}

#[test]
fn a_setting_sun_is_flattened_by_refraction() {
    let spread = |true_deg: f64| {
        let kind = ViewKind::Perspective { size: [96, 96], fov_y_rad: 0.02 };
        let lifted_rad = RefractingAir::at_height(500.0).refraction_rad(f64::to_radians(true_deg));
        let raised = DQuat::from_rotation_x(f64::to_radians(true_deg) + lifted_rad);
        let rig = Rig::new(vec![View::new("sun", kind, raised, DVec3::ZERO).unwrap()]).unwrap();
        let air = without_ground(30.0);
        // Turn off extinction, which would dim the lower limb more.
        let air = Surroundings { air: Some(Air::new(1e-6, 500.0, [0.0; 3])), ..air };
        let scene = scene(&[], Some([180.0, true_deg]), air);
        place_of_light(&render_hdr(&mut renderer(), &scene, &rig, &settings(StarMethod::Auto)), &rig, None)
    };
    // The Sun is at -0.3 degrees without refraction. With refraction, the whole disc is above the horizon, and its
    // height is about 5/6 of its width.
    let [[altitude_deg, _], [high, wide]] = spread(-0.3);
    println!("at {altitude_deg:.4} degrees: height over width {:.4}", high / wide);
    let density = RefractingAir::at_height(500.0).density();
    let lifted_deg = bennett_arcmin(altitude_deg, density) / 60.0;
    assert!((altitude_deg - lifted_deg + 0.3).abs() < 0.01, "{altitude_deg} {lifted_deg}");
    let limb = |side: f64| {
        let true_deg = -0.3 + side * 0.267;
        let error = |apparent_deg: f64| apparent_deg - bennett_arcmin(apparent_deg, density) / 60.0 - true_deg;
        let (mut low, mut above) = (-0.9, 2.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + above);
            if error(middle) > 0.0 { above = middle } else { low = middle }
        }
        low
    };
    let expected = (limb(1.0) - limb(-1.0)) / (2.0 * 0.267);
    println!("height over width according to the formula {expected:.4}");
    assert!((high / wide - expected).abs() < 0.01, "{} {expected}", high / wide);
    let [_, [high, wide]] = spread(40.0);
    assert!((high / wide - 1.0).abs() < 2e-3, "{}", high / wide);
}
