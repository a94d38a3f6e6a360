//! Audits of frames with the stars of a deep store. For them, the exact image reads every star individually.

use std::time::Duration;

use steradian::{
    audit::{AuditedScene, MOST_PIXELS, audit},
    plan::{
        audit::{Audit, AuditedOutput},
        settings::{ExposureSettings, RenderSettings},
    },
    render::{Frame, FrameRequest, Renderer, SkyMapUse, Wanted},
    scene::{SceneSnapshot, loader::StarSource},
    view::Rig,
};

use super::deep::{damaged_store, deep_scene, dome, every_star, scene_of, store, window};
use crate::common::renderer;

/// The settings of a user, with glare.
fn settings() -> RenderSettings {
    RenderSettings { exposure: ExposureSettings::manual(-7.5), ..RenderSettings::default() }
}

/// Returns a scene with the store and, around it, the bright stars of the sky, most of whose light is scattered.
fn sky() -> SceneSnapshot {
    scene_of(&[StarSource::File(store().join("deep")), StarSource::Bright])
}

fn draw(
    renderer: &mut Renderer,
    (scene, rig, settings): (&SceneSnapshot, &Rig, &RenderSettings),
    wanted: Wanted,
    sky_map: SkyMapUse,
) -> Frame {
    renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(wanted).sky_map(sky_map)).unwrap()
}

/// Returns all audits of a frame.
fn audited(renderer: &Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings, frame: &Frame) -> Audit {
    let scene = AuditedScene { scene, rig, settings, exposure_known: true, most_pixels: MOST_PIXELS, numbers: None };
    let [mut audit, exact] = audit(&scene, frame, renderer.limits()).unwrap();
    audit.images.extend(exact.images);
    audit.not_audited.extend(exact.not_audited);
    audit.images.iter().for_each(|image| println!("{}", image.in_words()));
    println!("{:?}", audit.not_audited);
    audit
}

/// Tests display images with composite stars and with a map of faint light, and HDR images that draw every star.
#[test]
fn frames_of_a_deep_store_pass_their_audit() {
    let (scene, mut renderer) = (sky(), renderer());
    for (case, rig, sky_map) in [
        ("dome", dome(), SkyMapUse::Wait),
        ("window", window(25.0), SkyMapUse::Off),
        ("narrow", window(0.8), SkyMapUse::Off),
    ] {
        println!("{case}");
        let settings = settings();
        let frame = draw(&mut renderer, (&scene, &rig, &settings), Wanted::display(), sky_map);
        let report = frame.plan.deep.clone().unwrap();
        assert_eq!(report.cell_px > 0.0 || frame.views[0].stars_in_map > 0, case != "narrow", "{case}: {report:?}");
        let audit = audited(&renderer, &scene, &rig, &settings, &frame);
        assert!(!audit.is_broken() && audit.images.len() == 1 && audit.not_audited.is_empty(), "{case}");
        let settings = every_star(&settings);
        let frame = draw(&mut renderer, (&scene, &rig, &settings), Wanted::hdr(), sky_map);
        let audit = audited(&renderer, &scene, &rig, &settings, &frame);
        assert!(!audit.is_broken() && audit.images.len() == 1 && audit.not_audited.is_empty(), "{case}");
        assert_eq!(audit.images[0].output, AuditedOutput::Hdr);
    }
}

/// The error of composite stars in an exact image is not compared with the budget, which does not apply to it.
#[test]
fn exact_images_with_composite_stars_are_not_audited() {
    let (scene, mut renderer, rig) = (deep_scene(), renderer(), window(25.0));
    let mut settings = settings();
    settings.accuracy.display_codes = 0.0;
    let frame = draw(&mut renderer, (&scene, &rig, &settings), Wanted::both(), SkyMapUse::Off);
    let audit = audited(&renderer, &scene, &rig, &settings, &frame);
    assert!(audit.images.is_empty() && audit.not_audited.len() == 2);
    assert!(audit.not_audited.iter().all(|reason| reason.contains("stars.every_star = true")));
}

/// The frames lack the faint stars, or have a sky that is turned by half a pixel.
#[test]
fn wrong_frames_of_a_deep_store_are_caught() {
    let (scene, mut renderer, rig) = (deep_scene(), renderer(), window(25.0));
    let honest = settings();
    let mut bright_alone = honest.clone();
    bright_alone.stars.magnitude_limit = 14.0;
    let mut turned = scene.clone();
    turned.camera.world_from_camera *= glam::DQuat::from_rotation_y(0.5 * 25_f64.to_radians() / 360.0);
    for (case, scene_drawn, settings) in [("faint stars", &scene, &bright_alone), ("turned", &turned, &honest)] {
        println!("{case}");
        let frame = draw(&mut renderer, (scene_drawn, &rig, settings), Wanted::display(), SkyMapUse::Off);
        assert!(audited(&renderer, &scene, &rig, &honest, &frame).is_broken(), "{case}");
        assert!(!audited(&renderer, scene_drawn, &rig, settings, &frame).is_broken(), "{case}");
    }
}

/// While pages are being read, the audit of a frame passes with the residual that the frame reports, and fails with a
/// smaller residual.
#[test]
fn a_frame_that_lacks_pages_passes_with_its_residual() {
    let (scene, mut renderer, rig, settings) = (deep_scene(), renderer(), window(9.0), settings());
    scene.stars.deep.as_ref().unwrap().set_delay(Duration::from_secs(1));
    let mut frame = draw(&mut renderer, (&scene, &rig, &settings), Wanted::display(), SkyMapUse::InTurn);
    let report = frame.plan.deep.as_mut().unwrap();
    assert!(report.missing > 10 && report.residual_cd_m2 > 0.0, "{report:?}");
    assert!(!audited(&renderer, &scene, &rig, &settings, &frame).is_broken());
    // An audit does not request pages.
    let read = scene.stars.deep.as_ref().unwrap().statistics().pages_read;
    assert!(read < 4, "{read}");
    frame.plan.deep.as_mut().unwrap().residual_cd_m2 *= 0.01;
    assert!(audited(&renderer, &scene, &rig, &settings, &frame).is_broken());
}

/// The exact image does not use a leaf that is damaged.
#[test]
fn a_damaged_leaf_is_the_reason_for_no_audit() {
    let (folder, mut renderer, rig) = (tempfile::tempdir().unwrap(), renderer(), window(25.0));
    let scene = damaged_store(folder.path());
    let mut settings = settings();
    settings.stars.skip_damaged = true;
    let frame = draw(&mut renderer, (&scene, &rig, &settings), Wanted::display(), SkyMapUse::Off);
    let audit = audited(&renderer, &scene, &rig, &settings, &frame);
    assert!(audit.images.is_empty() && audit.not_audited.len() == 1);
    assert!(audit.not_audited[0].contains("leaves-17"), "{:?}", audit.not_audited);
}
