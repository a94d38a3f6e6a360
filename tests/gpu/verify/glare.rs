//! The checks of glare: what is right passes, each fault fails, and glare that is off has nothing to check.

use crate::common::{figures, renderer, settings};
use steradian::{
    photometry::glare::GlareKernelName,
    plan::settings::{GlareMethod, RenderSettings, StarMethod},
    render::Renderer,
    verify::{self, Check, CheckResult, Context, Outcome},
};

/// What `sky_cube` keeps far below the limits of the checks, which are for any method: about four times the figure.
const CLOSER: &[(&str, f64)] = &[
    ("off the kernel's", 2.4e-4),
    ("largest error", 9.2e-3),
    ("light of the own image", 7.6e-5),
    ("between upright and rolled", 8.4e-3),
    ("exposure between views and rolls", 6.8e-4),
    ("at 1 km: between the eyes", 6e-3),
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
fn glare_on_the_sky_passes_every_check() {
    let mut renderer = renderer();
    let mut measured = Vec::new();
    for check in verify::select(Some("glare")).unwrap() {
        let result = run(check.name, &mut renderer, &with_glare(GlareMethod::Auto));
        assert_eq!(result.outcome, Outcome::Pass, "{result}");
        measured.extend(result.figures);
    }
    let found = |what: &str| {
        let of: Vec<f64> = measured.iter().filter(|of| of.what.starts_with(what)).map(|of| of.measured).collect();
        assert!(!of.is_empty(), "no figure begins with `{what}`");
        of.into_iter().fold(0.0_f64, f64::max)
    };
    figures::VEIL_OF_ONE_STAR.check(found("one star: rms"));
    figures::VEIL_OF_9000_STARS.check(found("9000 stars: rms"));
    for (what, limit) in CLOSER {
        let measured = found(what);
        assert!(measured <= *limit, "{what}: {measured:.2e}, limit {limit:.1e}");
    }
}

/// Glare on the screen is no ellipse where it should be, knows nothing beyond the picture, and stops at the edge of a face.
#[test]
fn glare_on_the_screen_fails() {
    let mut renderer = renderer();
    let settings = with_glare(GlareMethod::ScreenPyramid);
    for name in ["glare-roundness", "glare-profile", "glare-leaves-frame", "glare-cut-into-faces", "glare-eyes"] {
        assert_eq!(run(name, &mut renderer, &settings).outcome, Outcome::Fail, "{name}");
    }
}

/// What is drawn is right, what is expected is not: a plateau five times as wide, and another kernel.
#[test]
fn glare_of_another_kernel_fails() {
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
fn glare_that_is_off_has_nothing_to_check() {
    let mut renderer = renderer();
    let off = with_glare(GlareMethod::None);
    let mut nothing = with_glare(GlareMethod::Auto);
    nothing.glare.fraction = 0.0;
    for settings in [off, nothing] {
        let result = run("glare-roundness", &mut renderer, &settings);
        assert_eq!(result.outcome, Outcome::NotApplicable);
        assert!(result.message.unwrap().contains("glare.method"), "where to change it");
    }
    // Other checks go on, whatever the glare.
    assert_eq!(run("two-colours", &mut renderer, &with_glare(GlareMethod::None)).outcome, Outcome::Pass);
}
