//! The checks of glare: correct glare passes, each faulty one fails, and without glare the checks do not apply.

use crate::common::{figures, renderer, settings};
use steradian::{
    photometry::glare::GlareKernelName,
    plan::settings::{GlareMethod, RenderSettings, StarMethod},
    render::Renderer,
    verify::{self, Check, CheckResult, Context, Outcome},
};

/// Limits for `sky_cube`, about four times the measured values. They are far below the limits of the checks, which are for
/// any method.
const CLOSER: &[(&str, f64)] = &[
    ("off the kernel's", 2.4e-4),
    ("largest error", 9.2e-3),
    ("light of the star's own image", 7.6e-5),
    ("between upright and rolled", 8.4e-3),
    ("exposure between views and rolls", 6.8e-4),
    ("star at 1 km: difference between the eyes", 6e-3),
    ("at infinity", 1e-6),
];

fn with_glare(method: GlareMethod) -> RenderSettings {
    let mut settings = settings(StarMethod::BSpline);
    settings.glare.method = method;
    settings
}

fn check(name: &str) -> &'static Check {
    verify::select(Some(name)).unwrap()[0]
}

fn run(name: &str, renderer: &mut Renderer, settings: &RenderSettings) -> CheckResult {
    let result = verify::run(check(name), renderer, settings);
    println!("{result}");
    result
}

#[test]
fn sky_cube_glare_passes_every_check() {
    let mut renderer = renderer();
    let mut measured = Vec::new();
    for check in verify::select(Some("glare")).unwrap() {
        let result = run(check.name, &mut renderer, &with_glare(GlareMethod::Auto));
        assert_eq!(result.outcome, Outcome::Pass, "{result}");
        measured.extend(result.figures);
    }
    let found = |prefix: &str| {
        let values: Vec<f64> =
            measured.iter().filter(|figure| figure.what.starts_with(prefix)).map(|figure| figure.measured).collect();
        assert!(!values.is_empty(), "no figure begins with `{prefix}`");
        values.into_iter().fold(0.0_f64, f64::max)
    };
    figures::VEIL_OF_ONE_STAR.check(found("one star: rms"));
    figures::VEIL_OF_9000_STARS.check(found("9000 stars: rms"));
    for (prefix, limit) in CLOSER {
        let measured = found(prefix);
        assert!(measured <= *limit, "{prefix}: {measured:.2e}, limit {limit:.1e}");
    }
}

/// Glare in screen space has the wrong shape off the axis, lacks light from outside of the picture, and ends at the edges of cube faces.
#[test]
fn screen_space_glare_fails() {
    let mut renderer = renderer();
    let settings = with_glare(GlareMethod::ScreenPyramid);
    for name in ["glare-roundness", "glare-profile", "glare-leaves-frame", "glare-cut-into-faces", "glare-eyes"] {
        assert_eq!(run(name, &mut renderer, &settings).outcome, Outcome::Fail, "{name}");
    }
}

/// The picture is correct, but the expectation is wrong: a plateau five times as wide, or another kernel.
#[test]
fn glare_with_another_kernel_fails() {
    let mut renderer = renderer();
    let settings = with_glare(GlareMethod::Auto);
    for name in ["glare-profile", "glare-eyes", "glare-night-to-sun"] {
        for wrong in [(0.5, GlareKernelName::InverseSquare), (0.1, GlareKernelName::Cie)] {
            let mut context = Context::new(&mut renderer, &settings);
            (context.expected_glare.inner_deg, context.expected_glare.kernel) = wrong;
            let result = CheckResult::judge(check(name), (check(name).run)(&mut context).unwrap());
            assert_eq!(result.outcome, Outcome::Fail, "{wrong:?}: {result}");
        }
    }
}

#[test]
fn glare_checks_do_not_apply_without_glare() {
    let mut renderer = renderer();
    let off = with_glare(GlareMethod::None);
    let mut nothing = with_glare(GlareMethod::Auto);
    nothing.glare.fraction = 0.0;
    for settings in [off, nothing] {
        let result = run("glare-roundness", &mut renderer, &settings);
        assert_eq!(result.outcome, Outcome::NotApplicable);
        assert!(result.message.unwrap().contains("glare.method"), "the message names the key");
    }
    // Checks of other subjects run without glare.
    assert_eq!(run("two-colours", &mut renderer, &with_glare(GlareMethod::None)).outcome, Outcome::Pass);
}
