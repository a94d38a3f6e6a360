//! Spot metering: the mean luminance of the cone equals the f64 mean over the stars and bodies in it, and does not
//! depend on which views are drawn.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::{DQuat, DVec3};
use steradian::{
    catalogue::StarRecord,
    photometry::rec709::luminance,
    plan::settings::{ExposureKeys, ExposureSettings, ExposureValues, Metering, RenderSettings, StarMethod},
    render::{Frame, FrameRequest, Wanted},
    scene::{
        SceneObjects, SceneSnapshot,
        bodies::{Body, Emission, SolarBody},
    },
    units::illuminance_lx_from_magnitude,
    view::{Rig, View, ViewKind},
};

const SPOT_DEG: f64 = 10.0;
/// Direction of the first view.
const AHEAD: DVec3 = DVec3::X;

fn spot_settings() -> RenderSettings {
    let mut settings = settings(StarMethod::Auto);
    settings.exposure = ExposureValues { metering: Metering::Spot, spot_deg: SPOT_DEG, ..Default::default() }.into();
    settings
}

/// Returns a flat view along +x, and a view of the whole sky.
fn rig_of_two() -> Rig {
    let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, AHEAD);
    let ahead = ViewKind::Perspective { size: [160, 120], fov_y_rad: PI / 3.0 };
    let sky = ViewKind::Equirectangular { size: [128, 64] };
    Rig::new(vec![View::new("ahead", ahead, turn, DVec3::ZERO).unwrap(), view("sky", sky)]).unwrap()
}

fn angle_deg(direction: DVec3) -> f64 {
    AHEAD.angle_between(direction).to_degrees()
}

/// Returns stars everywhere except near the rim of the cone, where kernels would be partly outside. Stars farther from
/// the axis are brighter.
fn stars() -> Vec<StarRecord> {
    let away_from_the_rim = |direction: &DVec3| (angle_deg(*direction) - 0.5 * SPOT_DEG).abs() > 0.6;
    spiral(40_000).filter(away_from_the_rim).map(|d| star(d, 8.0 - 0.05 * angle_deg(d) as f32)).collect()
}

/// Returns the mean luminance of the stars in a cone around +x, cd/m^2.
fn mean_of_cone(stars: &[StarRecord], across_deg: f64) -> f64 {
    let inside = stars.iter().filter(|star| angle_deg(star.position) < 0.5 * across_deg);
    let light_lx: f64 = inside.map(|star| illuminance_lx_from_magnitude(f64::from(star.magnitude))).sum();
    light_lx / (2.0 * PI * (1.0 - (0.5 * across_deg).to_radians().cos()))
}

fn draw(scene: &SceneSnapshot, settings: &RenderSettings, wanted: [Wanted; 2], adapted: Option<f64>) -> Frame {
    let rig = rig_of_two();
    let request = FrameRequest::new(scene, &rig).settings(settings).wanted_per_view(&wanted).adapted_ev100(adapted);
    renderer().render(request).unwrap()
}

const NOTHING: Wanted = Wanted { display: false, hdr: false, hdr_streamed: false, hdr_stays: false };

#[test]
fn spot_exposure_equals_the_f64_mean_of_the_cone() {
    let (stars, mut settings) = (stars(), spot_settings());
    let scene = snapshot(stars.clone());
    for key in [0.104, 0.3] {
        settings.exposure = ExposureKeys { key: Some(key), ..Default::default() }.over(&settings.exposure);
        let frame = draw(&scene, &settings, [Wanted::display(); 2], None);
        let expected = settings.exposure.metered_ev100(mean_of_cone(&stars, SPOT_DEG));
        let error = frame.exposure_ev100 - expected;
        println!("key {key}: exposure {:.5}, f64 {expected:.5}: {error:+.1e} EV", frame.exposure_ev100);
        assert!(error.abs() < 1e-3, "{error}");
        assert_eq!(frame.exposure_ev100, frame.metered_ev100);
        let ratio = frame.mean_luminance_cd_m2 / mean_of_cone(&stars, SPOT_DEG);
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
        // A wider cone, the whole sky, and a mean that is 10 % smaller give other exposures.
        let whole = stars.iter().map(|star| illuminance_lx_from_magnitude(f64::from(star.magnitude))).sum::<f64>();
        let flat = mean_of_cone(&stars, SPOT_DEG) * 0.9;
        for wrong in [mean_of_cone(&stars, 2.0 * SPOT_DEG), whole / (4.0 * PI), flat] {
            let difference = settings.exposure.metered_ev100(wrong) - frame.exposure_ev100;
            assert!(difference.abs() > 0.05, "{difference}");
        }
    }
}

#[test]
fn a_body_in_the_cone_is_metered_by_its_luminance() {
    let mut lamp = Body::preset(SolarBody::Moon, "lamp", AHEAD * 1e9);
    lamp.radii_m = DVec3::splat(5e8);
    lamp.emission = Some(Emission { luminance_cd_m2: [3000.0, 4000.0, 5000.0], limb_darkening: 0.0, corona: false });
    let objects = SceneObjects { bodies: vec![Arc::new(lamp)], ..SceneObjects::default() };
    let scene = SceneSnapshot { objects: Arc::new(objects), ..snapshot(stars()) };
    let settings = spot_settings();
    let frame = draw(&scene, &settings, [Wanted::display(); 2], None);
    let expected = settings.exposure.metered_ev100(luminance([3000.0, 4000.0, 5000.0]));
    let error = frame.exposure_ev100 - expected;
    assert!(error.abs() < 1e-3, "{error}");
}

#[test]
fn unrequested_views_are_not_drawn_and_keep_the_spot_exposure() {
    let (scene, settings) = (snapshot(stars()), spot_settings());
    let both = draw(&scene, &settings, [Wanted::display(); 2], None);
    let second = draw(&scene, &settings, [NOTHING, Wanted::display()], None);
    assert_eq!(both.exposure_ev100.to_bits(), second.exposure_ev100.to_bits());
    assert!(both.views[0].stars_drawn > 0 && second.views[0].stars_drawn == 0);
    assert_eq!(both.images[1].display, second.images[0].display);
    // Requesting HDR images does not change the exposure, and the picture equals one with the same manual exposure.
    let with_hdr = draw(&scene, &settings, [Wanted::both(); 2], None);
    assert_eq!(with_hdr.exposure_ev100.to_bits(), both.exposure_ev100.to_bits());
    let mut manual = settings.clone();
    manual.exposure = ExposureSettings::manual(both.exposure_ev100);
    let known = draw(&scene, &manual, [Wanted::display(); 2], None);
    assert_eq!(known.images[0].display, both.images[0].display, "equal to the frame with manual exposure");
}

#[test]
fn an_adapted_frame_reports_the_metered_spot_exposure() {
    let (scene, settings) = (snapshot(stars()), spot_settings());
    let adapted = draw(&scene, &settings, [Wanted::display(); 2], Some(-2.0));
    let full = draw(&scene, &settings, [Wanted::display(); 2], None);
    assert!((adapted.exposure_ev100 - -2.0).abs() < 1e-6);
    assert!((adapted.metered_ev100 - full.exposure_ev100).abs() < 1e-3, "{}", adapted.metered_ev100);
    assert_ne!(adapted.images[0].display, full.images[0].display);
}

#[test]
fn a_spot_without_light_stays_within_the_limits() {
    let mut settings = spot_settings();
    let limits = ExposureKeys { min_ev100: Some(-9.0), max_ev100: Some(4.0), ..Default::default() };
    settings.exposure = limits.over(&settings.exposure);
    let away = snapshot(vec![star(-AHEAD, 1.0)]);
    let dark = draw(&away, &settings, [Wanted::display(); 2], None);
    assert_eq!((dark.exposure_ev100, dark.mean_luminance_cd_m2), (-9.0, 0.0));
    let sun = snapshot(vec![star(AHEAD, -26.7)]);
    assert_eq!(draw(&sun, &settings, [Wanted::display(); 2], None).exposure_ev100, 4.0);
    // With a spot that has no light, for the default glare and other methods, the exposure is within its limits and
    // reproducible.
    for method in [StarMethod::Auto, StarMethod::PackedCasSorted, StarMethod::CellSky, StarMethod::GaussianPsf] {
        let mut settings = RenderSettings { exposure: settings.exposure, ..RenderSettings::default() };
        settings.stars.method = method;
        let [first, second] = [0, 1].map(|_| draw(&away, &settings, [Wanted::display(); 2], None).exposure_ev100);
        assert!((-9.0..=4.0).contains(&first) && first.to_bits() == second.to_bits(), "{method:?}: {first} {second}");
    }
}
