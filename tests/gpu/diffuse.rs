//! Unresolved starlight and zodiacal light: pixels are compared with the f64 reference at rest, at relativistic speeds,
//! through air, behind a body, and with glare.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use steradian::{
    FrameRequest, Wanted,
    catalogue::{
        diffuse::DiffuseSky,
        galaxy::{GalaxyParameters, generate},
        zodiacal_light::ZodiacalLight,
    },
    observer::{Clock, Observer, Place, RefractingAir},
    photometry::atmosphere::{Air, glow_of},
    plan::settings::{AccuracySettings, ExposureSettings, GlareMethod, GlareSettings, RenderSettings, StarMethod},
    reference::diffuse::{luminance_cd_m2, zodiacal_cd_m2},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, SolarBody},
        surroundings::{LocalSky, Surroundings},
    },
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

/// Returns a coloured band of light along the plane z = 0 of the world, which is brighter towards x.
fn band() -> Arc<DiffuseSky> {
    Arc::new(DiffuseSky::new(0.01, |towards| {
        let band = (-0.5 * (towards.z / 0.15).powi(2)).exp() * (1.0 + 0.8 * towards.x) + 0.1;
        [4e-4 * band, 3e-4 * band, 2e-4 * (0.5 * band + 0.1)]
    }))
}

/// Returns a scene with the band and without stars.
fn scene(camera: Camera) -> SceneSnapshot {
    let mut scene = snapshot(Vec::new());
    scene.stars = Arc::new((*scene.stars).clone().with_unresolved(Some(band())));
    SceneSnapshot { camera, ..scene }
}

fn views() -> Rig {
    let fisheye = |fov_rad| ViewKind::Fisheye { size: [96, 96], mapping: FisheyeMapping::Equidistant, fov_rad };
    let kinds = [
        ("dome", fisheye(PI), DQuat::IDENTITY),
        ("window", ViewKind::Perspective { size: [160, 90], fov_y_rad: 1.0 }, DQuat::from_rotation_y(1.1)),
        ("map", ViewKind::Equirectangular { size: [128, 64] }, DQuat::from_rotation_x(0.4)),
    ];
    Rig::new(kinds.map(|(name, kind, turned)| View::new(name, kind, turned, DVec3::ZERO).unwrap()).to_vec()).unwrap()
}

/// Returns the largest relative error of any channel of the pixels whose direction passes `wanted`, and their number.
fn worst_of(
    scene: &SceneSnapshot,
    settings: &RenderSettings,
    expected: &dyn Fn(DVec3) -> [f64; 3],
    wanted: &dyn Fn(DVec3) -> bool,
) -> (f64, usize) {
    let rig = views();
    let frame = render_hdr(&mut renderer(), scene, &rig, settings);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for (image, viewport) in frame.images.iter().zip(&rig.viewports(scene.camera.world_from_camera)) {
        let hdr = image.hdr.as_ref().unwrap();
        for (index, found) in hdr.iter().enumerate() {
            let [x, y] = [index as u32 % image.width, index as u32 / image.width].map(f64::from);
            let mapping = viewport.projection.mapping();
            let Some(direction) = mapping.direction_from_pixel(DVec2::new(x, y) + 0.5) else { continue };
            let towards = viewport.world_from_view * direction;
            if !mapping.contains(x as u32, y as u32) || !wanted(towards) {
                continue;
            }
            let expected = expected(towards);
            for c in 0..3 {
                // Light from behind a moving observer can be too small for f32.
                worst = worst.max((f64::from(found[c]) - expected[c]).abs() / expected[c].max(1e-20));
            }
            compared += 1;
        }
    }
    (worst, compared)
}

#[test]
fn pixels_equal_the_reference_at_every_speed() {
    let sky = band();
    for velocity_c in [DVec3::ZERO, DVec3::new(0.3, 0.4, 0.0), DVec3::new(-1e-4, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.99)]
    {
        let camera = Camera { velocity_c, ..Camera::default() };
        let settings = settings(StarMethod::Auto);
        let twin = |towards| luminance_cd_m2(&sky, towards, velocity_c, None);
        let (worst, compared) = worst_of(&scene(camera), &settings, &twin, &|_| true);
        println!("velocity {velocity_c}: {compared} pixels, worst {worst:.1e}");
        assert!(worst < 2e-4 && compared > 25_000, "{velocity_c}: {worst} {compared}");
        // A slightly different velocity fails the comparison.
        let wrong = |towards| luminance_cd_m2(&sky, towards, velocity_c + DVec3::new(0.0, 2e-3, 0.0), None);
        assert!(worst_of(&scene(camera), &settings, &wrong, &|_| true).0 > 1e-3, "{velocity_c}");
    }
}

#[test]
fn glare_does_not_change_a_smooth_sky() {
    let sky = band();
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction: 0.1, ..GlareSettings::default() };
    let settings = RenderSettings { glare, ..settings(StarMethod::Auto) };
    let twin = |towards| luminance_cd_m2(&sky, towards, DVec3::ZERO, None);
    let (worst, _) = worst_of(&scene(Camera::default()), &settings, &twin, &|_| true);
    assert!(worst < 3e-4, "{worst}");
}

#[test]
fn display_images_are_equal_with_and_without_an_hdr_image() {
    let glare = GlareSettings { method: GlareMethod::SkyCube, ..GlareSettings::default() };
    let exposure = ExposureSettings::manual(-8.0);
    let mut settings = RenderSettings { glare, exposure, ..settings(StarMethod::Auto) };
    settings.accuracy = AccuracySettings::default();
    let (scene, rig) = (scene(Camera::default()), views());
    let mut renderer = renderer();
    let codes = |renderer: &mut steradian::Renderer, wanted: Wanted| {
        let frame = renderer.render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(wanted)).unwrap();
        frame.images.into_iter().flat_map(|image| image.display.unwrap()).collect::<Vec<u8>>()
    };
    let alone = codes(&mut renderer, Wanted { display: true, ..Wanted::default() });
    let with_hdr = codes(&mut renderer, Wanted { display: true, hdr: true, ..Wanted::default() });
    assert!(alone.iter().max() > Some(&60), "{:?}", alone.iter().max());
    let worst = alone.iter().zip(&with_hdr).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= 1, "{worst} codes");
}

/// Compares the colour channels of two pictures. Returns the share that differs by more than one code, the largest
/// difference, and the brightest code.
fn differing(a: &[u8], b: &[u8]) -> (f64, u8, u8) {
    let colours = || a.iter().zip(b).enumerate().filter(|(index, _)| index % 4 < 3).map(|(_, both)| both);
    let differences: Vec<u8> = colours().map(|(a, b)| a.abs_diff(*b)).collect();
    let share = differences.iter().filter(|difference| **difference > 1).count() as f64 / differences.len() as f64;
    (share, differences.into_iter().max().unwrap(), colours().map(|(a, _)| *a).max().unwrap())
}

#[test]
fn light_is_interpolated_between_points_within_the_budget() {
    let parameters = GalaxyParameters { stars: 10, seed: 1, fainter_than: Some(6.5), unresolved_light: true };
    let galaxy = Arc::new(generate(&parameters).unwrap().unresolved.unwrap());
    let place = Place { latitude_rad: -0.4, longitude_rad: 0.2, height_m: 500.0 };
    let observer = Observer::new(place, Clock::default(), 8.2e8);
    let of_air = Surroundings {
        air: Some(Air::new(0.2, 500.0, glow_of(99.0, [1.0; 3]))),
        refraction: Some(RefractingAir::at_height(500.0)),
        ground: None,
    };
    let in_air = SceneObjects {
        time_s: 8.2e8,
        observer: Some(observer),
        surroundings: Some(Arc::new(of_air)),
        ..Default::default()
    };
    let dome = ViewKind::Fisheye { size: [700, 700], mapping: FisheyeMapping::Equidistant, fov_rad: PI };
    let window = ViewKind::Perspective { size: [900, 500], fov_y_rad: 1.0 };
    let rig = Rig::new(vec![
        View::new("dome", dome, DQuat::from_rotation_x(PI / 2.0), DVec3::ZERO).unwrap(),
        View::new("window", window, DQuat::from_rotation_x(0.6), DVec3::ZERO).unwrap(),
    ])
    .unwrap();
    for (name, objects) in [("space", SceneObjects::default()), ("air", in_air)] {
        let turned = observer.icrs_from_horizon(8.2e8) * DQuat::from_rotation_y(2.0);
        let camera = Camera { position_m: observer.epoch.position_m, world_from_camera: turned, ..Camera::default() };
        let mut scene = SceneSnapshot { camera, objects: Arc::new(objects), ..snapshot(Vec::new()) };
        scene.stars = Arc::new((*scene.stars).clone().with_unresolved(Some(Arc::clone(&galaxy))));
        let exposure = ExposureSettings::manual(-6.5);
        let settings = RenderSettings { exposure, ..settings(StarMethod::Auto) };
        let codes = |display_codes: f64| {
            let mut settings = settings.clone();
            settings.accuracy = AccuracySettings { display_codes, ..AccuracySettings::default() };
            let wanted = Wanted { display: true, ..Wanted::default() };
            let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted(wanted);
            let frame = renderer().render(request).unwrap();
            let smooth = frame.plan.certificate.iter().any(|bound| bound.name.contains("diffuse light"));
            assert_eq!(smooth, display_codes > 0.0);
            frame.images.into_iter().map(|image| image.display.unwrap()).collect::<Vec<_>>()
        };
        let (exact, within, far) = (codes(0.0), codes(0.5), codes(8.0));
        for (view, exact) in exact.iter().enumerate() {
            let (share, most, brightest) = differing(exact, &within[view]);
            println!(
                "{name}, view {view}: {share:.1e} of the channels differ by more than one code, at most by {most}; brightest code {brightest}"
            );
            assert!(share < 1e-5 && most <= 2 && brightest > 40, "{name} {view}: {share} {most} {brightest}");
            // The comparison detects the differences that a larger budget causes.
            let (share, most, _) = differing(exact, &far[view]);
            println!("    with a budget of 8 codes {share:.1e}, at most {most}");
            assert!(share > 3e-4 && most >= 3, "{name} {view}: {share} {most}");
        }
    }
}

#[test]
fn the_zodiacal_light_is_added_in_space_and_behind_air() {
    let sky = band();
    // By night.
    let time_s = 8.2e8 - 14_400.0;
    let observer =
        Observer::new(Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 500.0 }, Clock::default(), time_s);
    let mut sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
    sun.ephemeris = Some(SolarBody::Sun.into());
    let air = Air::new(0.3, 500.0, glow_of(99.0, [1.0; 3]));
    let air = Surroundings { air: Some(air), refraction: Some(RefractingAir::at_height(0.0)), ground: None };
    let position_m = observer.epoch.position_m;
    let camera = Camera { position_m, world_from_camera: observer.icrs_from_horizon(time_s), ..Camera::default() };
    for (surroundings, with_stars) in [(None, true), (None, false), (Some(Arc::new(air)), true)] {
        let objects = SceneObjects {
            bodies: vec![Arc::new(sun.clone())],
            time_s,
            observer: Some(observer),
            surroundings,
            zodiacal_light: true,
            ..Default::default()
        };
        let mut scene = SceneSnapshot { objects: Arc::new(objects.placed()), ..scene(camera) };
        if !with_stars {
            scene.stars = Arc::new((*scene.stars).clone().with_unresolved(None));
        }
        let seen = scene.objects.seen_from(position_m);
        let (light, local) = (seen.zodiacal_light().unwrap(), seen.local_sky.as_deref());
        let to_sun = (seen.bodies[0].position_m - position_m).normalize();
        // Skip directions near the Sun: otherwise its own light and the sky around it would be compared too.
        let wanted = |towards: DVec3| {
            towards.angle_between(to_sun) > 0.3
                && local.is_none_or(|local| (local.horizon_from_world * towards).y > 0.05)
        };
        let of_air = |towards: DVec3| local.map_or([0.0; 3], |local| local.luminance_cd_m2(towards));
        let expected = |light: &ZodiacalLight, towards: DVec3| {
            let stars = if with_stars { luminance_cd_m2(&sky, towards, DVec3::ZERO, local) } else { [0.0; 3] };
            let (dust, air) = (zodiacal_cd_m2(light, towards, local), of_air(towards));
            [0, 1, 2].map(|c| stars[c] + dust[c] + air[c])
        };
        let settings = settings(StarMethod::Auto);
        let (worst, compared) = worst_of(&scene, &settings, &|towards| expected(&light, towards), &wanted);
        println!("air {}, stars {with_stars}: {compared} pixels, worst {worst:.1e}", local.is_some());
        assert!(worst < 1e-3 && compared > 5_000, "{worst} {compared}");
        // A Sun one degree away fails the comparison.
        let wrong = ZodiacalLight::new(DQuat::from_rotation_z(0.02) * to_sun, local.is_some());
        let off = worst_of(&scene, &settings, &|towards| expected(&wrong, towards), &wanted).0;
        assert!(off > 4.0 * worst, "{off} {worst}");
    }
}

#[test]
fn air_absorbs_light_and_a_body_hides_it() {
    let sky = band();
    let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 500.0 };
    let observer = Observer::new(place, Clock::default(), 8.2e8);
    let position_m = observer.epoch.position_m;
    let moon_at = observer.icrs_from_horizon(8.2e8) * DVec3::new(0.3, 0.9, 0.2).normalize();
    let moon = Body::preset(SolarBody::Moon, "moon", position_m + moon_at * 3e7);
    let air = Air::new(0.3, 500.0, glow_of(99.0, [1.0; 3]));
    let objects = |air: Option<Air>| SceneObjects {
        bodies: vec![Arc::new(moon.clone())],
        time_s: 8.2e8,
        observer: Some(observer),
        surroundings: air.map(|air| {
            Arc::new(Surroundings { air: Some(air), refraction: Some(RefractingAir::at_height(0.0)), ground: None })
        }),
        ..Default::default()
    };
    let camera = Camera { position_m, world_from_camera: observer.icrs_from_horizon(8.2e8), ..Camera::default() };
    for air in [None, Some(air)] {
        let scene = SceneSnapshot { objects: Arc::new(objects(air)), ..scene(camera) };
        let local: Option<LocalSky> = scene.objects.local_sky(position_m);
        let radius_rad = (1.738e6_f64 / 3e7).asin();
        let above = |towards: DVec3| local.as_ref().is_none_or(|local| (local.horizon_from_world * towards).y > 0.02);
        let twin = |towards| luminance_cd_m2(&sky, towards, DVec3::ZERO, local.as_ref());
        let settings = settings(StarMethod::Auto);
        let outside = |towards: DVec3| above(towards) && towards.angle_between(moon_at) > radius_rad + 0.06;
        let (worst, compared) = worst_of(&scene, &settings, &twin, &outside);
        println!("air {}: {compared} pixels, worst {worst:.1e}", local.is_some());
        assert!(worst < 2e-4 && compared > 9_000, "{worst} {compared}");
        // The disc is dark, because no Sun lights it.
        let none = |_| [1.0; 3];
        let on_disc = |towards: DVec3| towards.angle_between(moon_at) < radius_rad - 0.04;
        let frame = render_hdr(&mut renderer(), &scene, &views(), &settings);
        let viewport = &views().viewports(camera.world_from_camera)[0];
        let hidden = frame.images[0].hdr.as_ref().unwrap().iter().enumerate().filter(|(index, _)| {
            let centre = DVec2::new((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
            let direction = viewport.projection.mapping().direction_from_pixel(centre);
            direction.is_some_and(|direction| on_disc(viewport.world_from_view * direction))
        });
        for (index, pixel) in hidden {
            assert!(pixel[..3].iter().all(|c| *c < 1e-6), "{index}: {pixel:?}");
        }
        assert!(worst_of(&scene, &settings, &none, &on_disc).1 > 0);
    }
}
