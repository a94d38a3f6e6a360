//! The checks of bodies and asteroids: correct methods pass, and each fault fails.

use crate::common::{renderer, settings};
use steradian::{
    plan::settings::{ImpostorMethod, RenderSettings, StarMethod},
    render::Renderer,
    verify::{self, CheckResult, Context, Fault, Outcome},
};

fn settings_with(impostor: ImpostorMethod) -> RenderSettings {
    let mut settings = settings(StarMethod::BSpline);
    settings.asteroids.impostor = impostor;
    settings
}

fn run(name: &str, renderer: &mut Renderer, settings: &RenderSettings) -> CheckResult {
    let result = verify::run(verify::select(Some(name)).unwrap()[0], renderer, settings);
    println!("{result}");
    result
}

#[test]
#[ignore = "long: make test-all"]
fn objects_pass_every_check() {
    let mut renderer = renderer();
    for check in verify::select(Some("objects")).unwrap() {
        let result = run(check.name, &mut renderer, &settings_with(ImpostorMethod::Auto));
        assert_eq!(result.outcome, Outcome::Pass, "{result}");
    }
}

/// Pictures with the published atlas depend on the rotation of the camera, and the atlas has poles.
#[test]
#[ignore = "long: make test-all"]
fn the_published_atlas_fails() {
    let mut renderer = renderer();
    for name in ["impostor-tiles", "asteroid-tumbles", "head-motion"] {
        assert_eq!(
            run(name, &mut renderer, &settings_with(ImpostorMethod::EulerAtlas)).outcome,
            Outcome::Fail,
            "{name}"
        );
    }
}

/// Levels of detail change at distances that are eight times too short, so points replace asteroids that are fifteen
/// pixels wide.
#[test]
fn an_eighth_of_the_quality_fails_the_stereo_check() {
    let mut renderer = renderer();
    let mut settings = settings_with(ImpostorMethod::Auto);
    settings.asteroids.quality = 0.13;
    let result = run("asteroid-stereo", &mut renderer, &settings);
    assert_eq!(result.outcome, Outcome::Fail, "{result}");
    assert!(result.figures.iter().all(|figure| figure.measured.is_finite()), "it fails with finite figures: {result}");
}

const ALBEDO: Fault = Fault { albedo: 1.06, ..Fault::NONE };
const RADIUS: Fault = Fault { radius: 1.02, ..Fault::NONE };
const PLACE: Fault = Fault { shift: 0.2, ..Fault::NONE };

/// Tests the checks for which no other test has a failing case.
#[test]
#[ignore = "long: make test-all"]
fn wrong_expected_objects_fail_the_checks() {
    assert_wrong_expectation_fails(&[
        ("body-light", ALBEDO),
        ("body-shrinks", RADIUS),
        ("body-hides-stars", RADIUS),
        ("asteroid-light", ALBEDO),
        ("asteroid-seams", ALBEDO),
        ("asteroid-occlusion", Fault { radius: 8.0, ..Fault::NONE }),
    ]);
}

#[test]
#[ignore = "long: make test-all"]
fn wrong_expected_positions_fail_the_checks() {
    assert_wrong_expectation_fails(&[
        ("body-light", RADIUS),
        ("asteroid-tumbles", PLACE),
        ("head-motion", PLACE),
        ("asteroid-stereo", Fault { shift: 2.0, ..Fault::NONE }),
        ("asteroid-stereo", ALBEDO),
    ]);
}

/// The picture is correct, but the expected albedo, radius or position is wrong.
fn assert_wrong_expectation_fails(cases: &[(&str, Fault)]) {
    let mut renderer = renderer();
    let settings = settings_with(ImpostorMethod::Auto);
    for &(name, fault) in cases {
        let check = verify::select(Some(name)).unwrap()[0];
        let mut context = Context::new(&mut renderer, &settings);
        context.object_fault = fault;
        let result = CheckResult::judge(check, (check.run)(&mut context).unwrap());
        println!("{fault:?}: {result}");
        assert_eq!(result.outcome, Outcome::Fail, "{fault:?}: {result}");
    }
}

/// Published star methods draw no bodies, so the checks do not apply.
#[test]
fn object_checks_do_not_apply_to_methods_with_only_stars() {
    let mut renderer = renderer();
    let result = run("head-motion", &mut renderer, &settings(StarMethod::PackedCas));
    assert_eq!(result.outcome, Outcome::NotApplicable, "{result}");
    assert!(result.message.unwrap().contains("only stars"));
}
