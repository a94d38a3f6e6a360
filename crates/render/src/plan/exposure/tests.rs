#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec3};

use super::*;
use crate::{
    catalogue::chunks::StarSet,
    photometry::{blackbody, exposure::white_luminance_cd_m2, kernel::BSPLINE_PEAK, rec709::luminance},
    plan::{
        Limits, Output, PlanOutputs, Planner,
        settings::{ExposureMode, ExposureValues, GlareMethod, Metering, StarMethod, ToneMapOperator},
    },
    scene::{
        SceneObjects, SceneSnapshot,
        bodies::{Body, Emission, SolarBody},
    },
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

const AU_M: f64 = 1.495_978_707e11;

fn dome(size: u32) -> ViewKind {
    ViewKind::DomeMaster { size, fov_rad: PI, tilt_rad: 0.0 }
}

fn flat(size: [u32; 2], fov_y_deg: f64) -> ViewKind {
    ViewKind::Perspective { size, fov_y_rad: fov_y_deg.to_radians() }
}

fn rig(kinds: &[ViewKind]) -> Rig {
    let view = |(i, kind): (usize, &ViewKind)| {
        View::new(&format!("v{i}"), kind.clone(), DQuat::IDENTITY, DVec3::ZERO).unwrap()
    };
    Rig::new(kinds.iter().enumerate().map(view).collect()).unwrap()
}

/// Mean pixel of the first view, exposure, and displayed stars without lit objects.
fn of_night(kinds: &[ViewKind], settings: &RenderSettings) -> (DisplayedStars, Option<f64>) {
    let viewports = rig(kinds).viewports(DQuat::IDENTITY);
    let pictures = pictures::Pictures::default().for_viewports(&viewports);
    let stars = DisplayedStars::new(settings, &viewports, &pictures);
    let ev100 = planned_ev100(settings, &stars, &pictures, None);
    (stars, ev100)
}

/// Planned exposure of bodies around a camera at the origin.
fn planned(bodies: Vec<Body>, kinds: &[ViewKind], settings: &RenderSettings) -> f64 {
    let objects = SceneObjects { bodies: bodies.into_iter().map(Arc::new).collect(), ..Default::default() };
    let scene = SceneSnapshot { objects: Arc::new(objects), ..SceneSnapshot::of_stars(StarSet::default()) };
    let outputs = PlanOutputs::new(Output::Display);
    let plan = Planner::new().plan(&scene, &rig(kinds), settings, None, outputs, &Limits::default()).unwrap();
    assert_eq!(plan.exposure.known_ev100, plan.exposure.planned_ev100);
    plan.exposure.known_ev100.unwrap()
}

#[test]
fn the_mean_pixel_is_that_of_all_pixels_weighted_by_solid_angle() {
    let kinds = [
        dome(500),
        flat([640, 360], 60.0),
        flat([200, 400], 150.0),
        ViewKind::Equirectangular { size: [512, 256] },
        ViewKind::Fisheye { size: [300, 300], mapping: FisheyeMapping::Stereographic, fov_rad: 3.5 },
    ];
    for kind in kinds {
        let viewports = rig(std::slice::from_ref(&kind)).viewports(DQuat::IDENTITY);
        let mapping = viewports[0].projection.mapping();
        let [width, height] = mapping.size();
        let (mut sum, mut squares) = (0.0, 0.0);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let pixel_sr = mapping.solid_angle_sr(x, y);
            sum += pixel_sr;
            squares += pixel_sr * pixel_sr;
        }
        let (stars, _) = of_night(std::slice::from_ref(&kind), &RenderSettings::default());
        let error = stars.pixels_sr[0] / (squares / sum) - 1.0;
        println!("{kind:?}: mean pixel {:.4e} sr, {error:+.1e} of it too large", stars.pixels_sr[0]);
        assert!(error.abs() < 2e-3, "{kind:?}: {error}");
    }
    // By hand: the pixels of an equidistant dome have (pi / n)^2 sin(theta) / theta. Their mean, weighted by solid angle, is 0.824 of the central
    // pixel.
    let (stars, _) = of_night(&[dome(1024)], &RenderSettings::default());
    assert!((stars.pixels_sr[0] / 7.756e-6 - 1.0).abs() < 2e-3, "{:e}", stars.pixels_sr[0]);
    assert!(of_night(&[dome(1)], &RenderSettings::default()).0.pixels_sr[0] > 6.0);
}

#[test]
fn magnitudes_are_distinct_and_bright_stars_keep_their_colours_in_domes_of_every_size() {
    let settings = RenderSettings::default();
    for size in [1024, 4096] {
        let (stars, ev100) = of_night(&[dome(size)], &settings);
        let ev100 = ev100.unwrap();
        let codes = |magnitude: f64, temperature_k: f64, peak: f64| -> [f64; 3] {
            let light = illuminance_lx_from_magnitude(magnitude) * peak / stars.pixels_sr[0];
            let colour = blackbody::rec709_in_gamut(temperature_k).map(|channel| light * channel);
            settings.tone_map.display_rgb(colour, white_luminance_cd_m2(ev100)).map(|value| 255.0 * value)
        };
        println!("dome of {size}: EV100 {ev100:.2}; code of white light, and of 3000 K and 20000 K");
        let mut white = Vec::new();
        for magnitude in [-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.5] {
            let peak = illuminance_lx_from_magnitude(magnitude) * BSPLINE_PEAK / stars.pixels_sr[0];
            let grey = settings.tone_map.display_rgb([peak; 3], white_luminance_cd_m2(ev100))[1] * 255.0;
            let [cool, hot] = [3000.0, 20_000.0].map(|k| codes(magnitude, k, BSPLINE_PEAK).map(f64::round));
            println!("  V = {magnitude}: {grey:.0}; {cool:?} {hot:?}");
            white.push(grey);
        }
        assert!((ev100 - if size == 1024 { -5.18 } else { -1.18 }).abs() < 0.03, "{ev100}");
        let expected = [250.6, 244.2, 229.8, 201.0, 155.3, 102.8, 58.7, 29.5, 20.0];
        for (code, expected) in white.iter().zip(expected) {
            assert!((code - expected).abs() < 0.6, "{white:?}");
        }
        // The cores of the brightest stars keep their hue: orange remains orange, and blue remains blue.
        let [red, green, blue] = codes(0.0, 3000.0, BSPLINE_PEAK);
        assert!(red > green + 10.0 && green > blue + 10.0, "{red} {green} {blue}");
        let [red, green, blue] = codes(0.0, 20_000.0, BSPLINE_PEAK);
        assert!(blue > green + 10.0 && green > red + 2.0, "{red} {green} {blue}");
        // If the exposure follows the mean luminance of the sky, the same stars are hardly distinguishable: codes 254 and 243, and 255 and 254.
        let at_the_mean = [3.0, 6.0].map(|magnitude| {
            let peak = illuminance_lx_from_magnitude(magnitude) * BSPLINE_PEAK / stars.pixels_sr[0];
            settings.tone_map.display_rgb([peak; 3], white_luminance_cd_m2(-13.0))[1] * 255.0
        });
        assert!(at_the_mean[0] - at_the_mean[1] < 12.0 && white[4] - white[7] > 100.0, "{at_the_mean:?}");
    }
}

#[test]
fn each_view_has_a_separate_limit_and_the_first_one_that_of_the_settings() {
    let exposure = ExposureValues { limiting_magnitude: 5.0, ..Default::default() }.into();
    let mut settings = RenderSettings { exposure, ..RenderSettings::default() };
    let kinds = [dome(1024), dome(2048), flat([1920, 1080], 60.0)];
    let (stars, ev100) = of_night(&kinds, &settings);
    let limits: Vec<f64> = (0..3).map(|view| stars.limiting_magnitude(view, ev100.unwrap()).unwrap()).collect();
    assert!((limits[0] - 5.0).abs() < 1e-9 && stars.limiting_magnitude(3, 0.0).is_none());
    for view in 1..3 {
        let expected = 5.0 + 2.5 * (stars.pixels_sr[0] / stars.pixels_sr[view]).log10();
        assert!((limits[view] - expected).abs() < 1e-9, "{limits:?}");
    }
    // Pixels of a quarter of the solid angle add 1.505 magnitudes to the limit.
    assert!((limits[1] - 6.505).abs() < 5e-3, "{limits:?}");
    // A compensation of one stop changes the limit by 0.75 mag.
    settings.exposure = ExposureValues { limiting_magnitude: 5.0, compensation_ev: 1.0, ..Default::default() }.into();
    let (stars, brighter) = of_night(&kinds, &settings);
    assert!((brighter.unwrap() - ev100.unwrap() - 1.0).abs() < 1e-12);
    assert!((stars.limiting_magnitude(0, brighter.unwrap()).unwrap() - 5.0 + 0.7526).abs() < 1e-3);
    // Methods with relative brightness have no known limit.
    settings.stars.method = StarMethod::CellSky;
    assert_eq!(of_night(&kinds, &settings).0.limiting_magnitude(0, -5.0), None);
}

#[test]
fn calibrated_displays_and_other_exposure_modes_ignore_the_plan() {
    let mut settings = RenderSettings::default();
    settings.tone_map.operator = ToneMapOperator::Calibrated;
    let (stars, ev100) = of_night(&[dome(1024)], &settings);
    assert_eq!(ev100, settings.tone_map.white_ev100());
    // With white at 100 cd/m^2, code 20 is 0.7 cd/m^2: in the coarse pixels of the dome, a star brighter than all but the Sun.
    let limit = stars.limiting_magnitude(0, -99.0).unwrap();
    let light = 0.006_995 * 100.0 * stars.pixels_sr[0] / BSPLINE_PEAK;
    assert!((limit - magnitude_from_illuminance_lx(light)).abs() < 1e-3, "{limit}");
    let planned_with = |exposure: ExposureValues| {
        of_night(&[dome(64)], &RenderSettings { exposure: exposure.into(), ..RenderSettings::default() }).1
    };
    let base = ExposureValues::default();
    assert_eq!(planned_with(ExposureValues { metering: Metering::Mean, ..base }), None);
    assert_eq!(planned_with(ExposureValues { mode: ExposureMode::Manual, ..base }), None);
    assert_eq!(planned_with(ExposureValues { max_ev100: -15.0, ..base }), Some(-15.0));
    assert_eq!(planned_with(ExposureValues { min_ev100: 5.0, ..base }), Some(5.0));
}

fn planet(distance_radii: f64, sun_behind: bool) -> Vec<Body> {
    let radius_m = 6.4e6;
    let mut planet = Body::preset(SolarBody::Moon, "planet", DVec3::NEG_Z * distance_radii * radius_m);
    planet.radii_m = DVec3::splat(radius_m);
    planet.surface.phase_curve = None;
    let sun = Body::preset(SolarBody::Sun, "sun", if sun_behind { DVec3::NEG_Z } else { DVec3::Z } * AU_M);
    vec![planet, sun]
}

#[test]
fn sunlit_surfaces_over_a_thousandth_are_below_white_and_smaller_ones_approach_continuously() {
    let mut settings = RenderSettings::default();
    settings.glare.method = GlareMethod::None;
    let view = [flat([1000, 1000], 60.0)];
    let night = of_night(&view, &settings).1.unwrap();
    // Geometric albedo 0.12 in 1.3e5 lx: p E / pi is 5000 cd/m^2.
    let expected = |bodies: &[Body]| {
        let objects =
            SceneObjects { bodies: bodies.iter().cloned().map(Arc::new).collect(), ..SceneObjects::default() };
        let suns = crate::scene::bodies::suns(&objects);
        let lights = crate::scene::bodies::lights_on(&objects.bodies[0], &suns, DVec3::ZERO);
        luminance(lights[0].illuminance_lx) * luminance(objects.bodies[0].surface.geometric_albedo) / PI
    };
    let mut previous = night;
    let mut largest_step = 0.0_f64;
    // Approach from 3000 radii, where the disc is smaller than a pixel, to 2 radii.
    for step in 0..=200 {
        let distance = 3000.0 * (2.0_f64 / 3000.0).powf(f64::from(step) / 200.0);
        let bodies = planet(distance, false);
        let white = expected(&bodies);
        let ev100 = planned(bodies, &view, &settings);
        let share = PI / (distance * distance) / 1.0;
        if share > 2e-3 {
            let over = white_luminance_cd_m2(ev100) / white;
            // For a near eye, the luminance near the limb is up to twice as large, by Lommel and Seeliger's law.
            assert!((0.97..2.0).contains(&over), "at {distance}: white is {over} of the surface");
        } else if share < 2e-6 {
            assert!((ev100 - night).abs() < 1e-6, "at {distance}: {ev100} instead of {night}");
        }
        largest_step = largest_step.max((ev100 - previous).abs());
        previous = ev100;
    }
    println!("night {night:.2}, full disc {previous:.2}, largest step of 3.7 % in distance {largest_step:.2} EV");
    assert!(previous - night > 14.0, "a sunlit body is 17 stops brighter: {night} to {previous}");
    assert!(largest_step < 0.6, "{largest_step}");
    // The night side, and a body outside the picture, impose no bound.
    let mut eclipse = planet(20.0, true);
    assert!((planned(eclipse.clone(), &view, &settings) - night).abs() < 1e-6);
    eclipse[0].position_m = DVec3::Z * 1e8;
    eclipse[1].position_m = DVec3::Z * -AU_M;
    assert!(
        planned(eclipse, &[flat([100, 100], 10.0)], &settings) > night + 20.0,
        "the Sun itself fills a narrow view"
    );
    let mut behind = planet(5.0, false);
    behind[0].position_m = DVec3::Z * 5.0 * 6.4e6;
    behind[1].position_m = DVec3::NEG_X * AU_M;
    assert!((planned(behind, &view, &settings) - night).abs() < 1e-6);
}

#[test]
fn a_picture_within_a_disc_is_exposed_for_it_and_hidden_discs_do_not_count() {
    let mut settings = RenderSettings::default();
    settings.glare.method = GlareMethod::None;
    let view = [flat([400, 400], 20.0)];
    let night = of_night(&view, &settings).1.unwrap();
    // The body is so near that its disc is wider than the picture.
    let within = planned(planet(1.2, false), &view, &settings);
    let whole = planned(planet(8.0, false), &view, &settings);
    // White is 5000 cd/m^2, and more if the whole disc, with its brighter limb, is visible.
    assert!((within - 12.0).abs() < 0.1 && (within..within + 1.0).contains(&whole), "{night} {within} {whole}");
    // Place a dark body in front.
    let mut hidden = planet(20.0, false);
    let mut screen = Body::preset(SolarBody::Moon, "screen", DVec3::NEG_Z * 2e7);
    screen.radii_m = DVec3::splat(1.5e7);
    screen.surface.geometric_albedo = [0.0; 3];
    hidden.push(screen);
    assert!((planned(hidden, &view, &settings) - night).abs() < 1e-6);
}

#[test]
fn the_veil_of_the_sun_is_below_a_fifth_of_white_at_any_position_of_the_sun() {
    let settings = RenderSettings::default();
    let view = [dome(512)];
    let night = of_night(&view, &settings).1.unwrap();
    // The dome looks along +y of the camera's axes. The Sun is overhead, on the horizon, and below it.
    let with_sun_at =
        |direction: DVec3| planned(vec![Body::preset(SolarBody::Sun, "sun", direction * AU_M)], &view, &settings);
    let viewports = rig(&view).viewports(DQuat::IDENTITY);
    let zenith = viewports[0].world_from_view * DVec3::NEG_Z;
    let side = viewports[0].world_from_view * DVec3::X;
    let [overhead, horizon, below] = [with_sun_at(zenith), with_sun_at(side), with_sun_at(-zenith)];
    println!("night {night:.2}, Sun overhead {overhead:.2}, on the horizon {horizon:.2}, below {below:.2}");
    // By hand: a fraction of 0.1 of 1.26e5 lx is scattered, with 0.02166 / theta^2 per sr. Half of a dome lies more than 60 degrees from its zenith.
    let veil = 0.1 * 1.26e5 * 0.02166 / 60f64.to_radians().powi(2);
    assert!((white_luminance_cd_m2(overhead) / (veil / 0.18) - 1.0).abs() < 0.1, "{overhead}");
    assert!(overhead > horizon && horizon > below && below > night + 5.0);
    // The ground hides the Sun.
    let mut ground = Body::preset(SolarBody::Earth, "ground", -zenith * 6.4e6);
    ground.radii_m = DVec3::splat(6.399e6);
    let sunset = planned(vec![ground, Body::preset(SolarBody::Sun, "sun", -zenith * AU_M)], &view, &settings);
    assert!((sunset - night).abs() < 1e-6, "{sunset}");
    // The full Moon is 14 magnitudes fainter and hardly changes the exposure. Its veil is a fifth of white even if the exposure does not change.
    let mut moon = Body::preset(SolarBody::Moon, "moon", zenith * 3.84e8);
    moon.emission = Some(Emission { luminance_cd_m2: [4e3; 3], limb_darkening: 0.0, corona: false });
    let moonlit = planned(vec![moon], &view, &settings);
    println!("full Moon overhead {moonlit:.2}");
    assert!(moonlit < night + 1.0, "{moonlit}");
}

#[test]
fn a_small_picture_is_as_bright_as_the_large_one_for_whose_pixels_the_exposure_is_meant() {
    let large = of_night(&[dome(4096)], &RenderSettings::default());
    let side_arcmin = large.0.pixels_sr[0].sqrt().to_degrees() * 60.0;
    // By hand: the side of a pixel is 54.47 arcminutes times the field of view in degrees, divided by the dome's size in pixels.
    assert!((side_arcmin - 54.47 * 180.0 / 4096.0).abs() < 0.003, "{side_arcmin}");
    let exposure: ExposureSettings =
        ExposureValues { reference_pixel_arcmin: side_arcmin, ..Default::default() }.into();
    let settings = RenderSettings { exposure, ..RenderSettings::default() };
    for kind in
        [dome(256), dome(512), dome(1024), flat([320, 240], 60.0), ViewKind::Equirectangular { size: [256, 128] }]
    {
        let (stars, ev100) = of_night(std::slice::from_ref(&kind), &settings);
        assert!((ev100.unwrap() - large.1.unwrap()).abs() < 1e-9, "{kind:?}: {ev100:?} instead of {:?}", large.1);
        let own = of_night(std::slice::from_ref(&kind), &RenderSettings::default()).1.unwrap();
        assert!((own - ev100.unwrap()).abs() > 1.0, "{kind:?}: {own}");
        // The limiting magnitude of a view depends on its own pixels.
        let brighter = 2.5 * (stars.pixels_sr[0] / large.0.pixels_sr[0]).log10();
        let limit = stars.limiting_magnitude(0, ev100.unwrap()).unwrap();
        assert!((limit - 6.5 + brighter).abs() < 1e-6, "{kind:?}: {limit}");
    }
}
