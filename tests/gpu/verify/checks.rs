//! Tests `verify` as command and as library: correct methods pass, wrong ones fail, and the results are reported as text and as JSON.

use std::{
    path::Path,
    process::{Command, Output, Stdio},
};

use crate::common::{renderer, settings};
use steradian::{
    plan::settings::{GlareSettings, StarMethod},
    render::Renderer,
    verify::{self, Check, CheckResult, Context, Outcome},
};

fn steradian(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(arguments).env_remove("STERADIAN_LOG").stdin(Stdio::null()).output().unwrap()
}

#[track_caller]
fn run(arguments: &[&str], code: i32) -> (String, String) {
    let output = steradian(arguments);
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\nstdout: {out}\nstderr: {err}");
    (out, err)
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_correct_method_passes_with_a_line_per_check_and_json() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("verify.json");
    let file = path.to_str().unwrap();
    let (out, err) = run(&["verify", "--filter", "sums", "--json", file, "--set", "stars.method=bspline"], 0);
    let names: Vec<&str> = verify::select(Some("sums")).unwrap().iter().map(|check| check.name).collect();
    assert_eq!(out.lines().count(), names.len(), "{out}");
    for (line, name) in out.lines().zip(&names) {
        assert!(line.contains(name) && line.contains("  pass  ") && line.contains("(limit "), "{line}");
    }
    assert!(err.contains("(1 of 6)") && err.contains("6 passed, 0 failed"), "{err}");
    let report = json(&path);
    assert_eq!(report["method"], "bspline");
    assert!(report["adapter"].as_str().is_some_and(|adapter| !adapter.is_empty()));
    let checks = report["checks"].as_array().unwrap();
    assert_eq!(checks.len(), names.len());
    for (check, name) in checks.iter().zip(names) {
        assert_eq!((check["name"].as_str(), check["outcome"].as_str()), (Some(name), Some("pass")));
        let figures = check["figures"].as_array().unwrap();
        let bounded = |figure: &serde_json::Value| figure["measured"].as_f64() <= figure["limit"].as_f64();
        assert!(figures.iter().all(|figure| figure["limit"].is_null() || bounded(figure)), "{check}");
        assert!(figures.iter().any(|figure| figure["limit"].is_number()), "{check}");
    }
}

#[test]
fn the_command_reports_the_flicker_of_the_tent() {
    let (out, err) = run(&["verify", "--filter", "10", "--set", "stars.method=tent"], 1);
    assert!(out.starts_with("10  slow-pan-flicker ") && out.contains("  FAIL  flicker at 1 times white 0.08"), "{out}");
    assert!(err.contains("1 of 1 applicable checks"), "{err}");
}

#[test]
fn checks_of_catalogue_stars_do_not_apply_to_the_procedural_sky() {
    let (out, err) = run(&["verify", "--filter", "two-colours", "--set", "stars.method=cell_sky"], 1);
    assert!(out.contains("  n/a   cell_sky draws its own stars"), "{out}");
    assert!(err.contains("0 passed, 0 failed, 1 do not apply"), "{err}");
}

#[test]
fn usage_errors_name_the_valid_values() {
    let (_, err) = run(&["verify", "--filter", "nothing"], 64);
    assert!(err.contains("`nothing`") && err.contains("slow-pan-flicker") && err.contains("star-light"), "{err}");
    let (_, err) = run(&["verify", "--set", "stars.method=dots"], 64);
    assert!(err.contains("stars.method") && err.contains("bspline"), "{err}");
    let (_, err) = run(&["verify", "--set", "star.method=tent"], 64);
    assert!(err.contains("star"), "{err}");
    let (_, err) = run(&["verify", "--adapter", "no such adapter", "--filter", "two-colours"], 69);
    assert!(err.contains("no such adapter"), "{err}");
    let (_, err) = run(&["verify", "--filter", "two-colours", "--json", "/no/such/folder/x.json"], 1);
    assert!(err.contains("/no/such/folder/x.json"), "{err}");
}

/// Returns the result of a check with a renderer that draws no star fainter than the limit.
fn with_limit(renderer: &mut Renderer, name: &str, magnitude_limit: f64) -> CheckResult {
    let mut settings = settings(StarMethod::BSpline);
    settings.glare = GlareSettings::default();
    let check = verify::select(Some(name)).unwrap()[0];
    let mut context = Context::new(renderer, &settings);
    context.settings.stars.magnitude_limit = magnitude_limit;
    match (check.run)(&mut context) {
        Ok(figures) => CheckResult::judge(check, figures),
        Err(error) => CheckResult::without_figures(check, Outcome::Fail, error.to_string()),
    }
}

/// Checks use their own stars, so the magnitude limit of the scene does not apply to them.
#[test]
fn the_magnitude_limit_of_a_scene_does_not_affect_checks() {
    let mut renderer = renderer();
    let check = verify::select(Some("two-colours")).unwrap()[0];
    let mut limited = settings(StarMethod::BSpline);
    limited.stars.magnitude_limit = 1.5;
    let result = verify::run(check, &mut renderer, &limited);
    assert_eq!(result.outcome, Outcome::Pass, "{result}");
    let lost = with_limit(&mut renderer, check.name, 1.5);
    assert_eq!(lost.outcome, Outcome::Fail, "the check fails if the limit applies to its stars: {lost}");
}

/// Whether the default run contains a test that makes this check fail.
fn fails_elsewhere(check: &Check) -> bool {
    check.needs_glare && check.name != "glare-reference"
}

/// Returns the checks that look for stars, except for check 17, which changes the limit itself.
fn looking_for_stars() -> impl Iterator<Item = &'static Check> {
    verify::checks().iter().filter(|check| check.needs_catalogue && check.number != Some(17))
}

/// A renderer that draws no stars must fail every check that looks for stars; one that draws too few must fail the checks of
/// light.
#[test]
#[ignore = "long: make test-all"]
fn a_renderer_that_loses_stars_fails() {
    let mut renderer = renderer();
    let mut check = |name: &str, magnitude_limit: f64| with_limit(&mut renderer, name, magnitude_limit);
    for looks in looking_for_stars().filter(|check| !fails_elsewhere(check)) {
        let black = check(looks.name, -90.0);
        assert_eq!(black.outcome, Outcome::Fail, "{black}");
    }
    for name in
        ["million-faint-stars", "equal-stars-in-a-pixel", "sirius-beside-21", "flux-every-projection", "whole-sky"]
    {
        let some = check(name, 5.5);
        assert_eq!(some.outcome, Outcome::Fail, "{some}");
    }
}

#[test]
#[ignore = "long: make test-all"]
fn a_renderer_that_loses_stars_fails_the_checks_of_glare() {
    let mut renderer = renderer();
    for looks in looking_for_stars().filter(|check| fails_elsewhere(check)) {
        let black = with_limit(&mut renderer, looks.name, -90.0);
        assert_eq!(black.outcome, Outcome::Fail, "{black}");
    }
}

/// The tent has a wrong width and flickers, but its light is correct.
#[test]
fn the_tent_fails_only_the_checks_of_width_and_flicker() {
    let mut renderer = renderer();
    let mut outcome = |name: &str| {
        let check = verify::select(Some(name)).unwrap()[0];
        let result = verify::run(check, &mut renderer, &settings(StarMethod::Tent));
        println!("{result}");
        result
    };
    let sweep = outcome("sub-pixel-sweep");
    assert_eq!(sweep.outcome, Outcome::Fail);
    let passes: Vec<bool> = sweep.figures.iter().map(|figure| figure.pass).collect();
    assert_eq!(passes, [true, false, true], "the centroid is correct, the width is not: {sweep}");
    for name in ["two-colours", "centre-to-corner", "equirectangular-pole", "shuffled-order"] {
        assert_eq!(outcome(name).outcome, Outcome::Pass);
    }
}

/// The check fails for sums that depend on the order of the stars, whether they use atomic exchange or blending.
#[test]
fn order_dependent_sums_fail_the_check_of_shuffles() {
    let mut renderer = renderer();
    let check = verify::select(Some("shuffled-order")).unwrap()[0];
    for method in [StarMethod::PackedCas, StarMethod::PackedCasSorted, StarMethod::HardwarePoint] {
        let result = verify::run(check, &mut renderer, &settings(method));
        println!("{}: {result}", method.name());
        assert_eq!(result.outcome, Outcome::Fail, "{result}");
        assert!(result.figures[0].measured > 90.0, "{result}");
    }
    assert_eq!(renderer.catalogue_order, None, "later checks use the default order");
}
