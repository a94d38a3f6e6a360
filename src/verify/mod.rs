//! The failure tests: known weaknesses of drawing methods, each a check with a number and a limit.
//!
//! A check renders with the given [`Renderer`] and settings, so that `stars.method` selects the method under test. [`crate::metrics`] measures the
//! images; solid angles are computed in f64. Methods of relative brightness are compared after fitting one scale; a check of catalogue stars does not
//! apply to a method that draws its own stars. A check that cannot run counts as failed, and the others continue.
//!
//! There is one file per group of checks; [`checks`] lists all of them. `scenes` contains the artificial skies and
//! views, which tests also use.

mod context;
mod exposure;
mod glare;
mod kernels;
mod objects;
pub mod scenes;
mod sky;
pub mod solid_angle;
mod star_light;
mod sums;

use std::{fmt, time::Instant};

use serde::Serialize;

pub use self::{
    context::{CheckError, Context},
    objects::Fault,
};
use crate::{
    plan::settings::{Accumulator, GlareMethod, RenderSettings},
    render::Renderer,
};

/// One measured number of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// Measured quantity.
    pub what: String,
    /// Measured value.
    pub measured: f64,
    /// Largest allowed value. A figure without a limit is for information only.
    pub limit: Option<f64>,
    /// Unit of the value and the limit.
    pub unit: &'static str,
    /// Whether the value is within its limit. NaN never is.
    pub pass: bool,
}

impl Figure {
    /// Returns a figure with a limit; NaN fails.
    pub fn at_most(what: impl Into<String>, measured: f64, limit: f64, unit: &'static str) -> Self {
        Self { what: what.into(), measured, limit: Some(limit), unit, pass: measured <= limit }
    }

    /// Returns a figure without a limit.
    pub fn informative(what: impl Into<String>, measured: f64, unit: &'static str) -> Self {
        Self { what: what.into(), measured, limit: None, unit, pass: true }
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.what, number(self.measured))?;
        if !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        match self.limit {
            Some(limit) => write!(f, " (limit {})", number(limit)),
            None => Ok(()),
        }
    }
}

/// Formats a number briefly, even if it is very small.
fn number(value: f64) -> String {
    let exponential = value != 0.0 && !(1e-3..1e5).contains(&value.abs());
    if exponential { format!("{value:.1e}") } else { format!("{}", (value * 1e4).round() / 1e4) }
}

/// Function that measures the figures of a method.
pub type Run = fn(&mut Context<'_>) -> Result<Vec<Figure>, CheckError>;

/// A failure test.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Number in the list of failure cases in the design; `None` for published weaknesses that are not in the list.
    pub number: Option<u8>,
    /// Name.
    pub name: &'static str,
    /// Group of checks.
    pub group: &'static str,
    /// Property that the check proves, in one sentence.
    pub proves: &'static str,
    /// Whether it needs stars of the catalogue.
    pub needs_catalogue: bool,
    /// Whether it needs glare.
    pub needs_glare: bool,
    /// Function that runs the check.
    pub run: Run,
}

/// Outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Every figure is within its limit.
    Pass,
    /// A figure exceeds its limit, or there are no figures.
    Fail,
    /// The check does not apply to the method.
    NotApplicable,
}

/// Result of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckResult {
    /// See [`Check::number`].
    pub number: Option<u8>,
    /// See [`Check::name`].
    pub name: &'static str,
    /// See [`Check::group`].
    pub group: &'static str,
    /// Outcome.
    pub outcome: Outcome,
    /// Measured figures.
    pub figures: Vec<Figure>,
    /// The reason why there are no figures.
    pub message: Option<String>,
    /// Duration, s.
    pub seconds: f64,
}

impl CheckResult {
    /// Returns the result of a check that could not run or does not apply.
    pub fn without_figures(check: &Check, outcome: Outcome, message: impl Into<String>) -> Self {
        Self { message: Some(message.into()), ..Self::with_figures(check, outcome, Vec::new()) }
    }

    fn with_figures(check: &Check, outcome: Outcome, figures: Vec<Figure>) -> Self {
        let Check { number, name, group, .. } = *check;
        Self { number, name, group, outcome, figures, message: None, seconds: 0.0 }
    }

    /// Judges figures: there must be at least one, and all must be within their limits.
    pub fn judge(check: &Check, figures: Vec<Figure>) -> Self {
        let pass = !figures.is_empty() && figures.iter().all(|figure| figure.pass);
        Self::with_figures(check, if pass { Outcome::Pass } else { Outcome::Fail }, figures)
    }
}

impl fmt::Display for CheckResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let outcome = match self.outcome {
            Outcome::Pass => "pass",
            Outcome::Fail => "FAIL",
            Outcome::NotApplicable => "n/a ",
        };
        let number = self.number.map_or("-".to_owned(), |number| number.to_string());
        write!(f, "{number:>2}  {:<24}  {outcome}  ", self.name)?;
        if let Some(message) = &self.message {
            return f.write_str(message);
        }
        for (index, figure) in self.figures.iter().enumerate() {
            write!(f, "{}{figure}", if index == 0 { "" } else { "; " })?;
        }
        Ok(())
    }
}

/// Returns all checks in the order of the list. A check without a number follows the check to which it is most similar.
pub fn checks() -> &'static [Check] {
    &ALL
}

const fn numbered(
    number: u8,
    name: &'static str,
    group: &'static str,
    proves: &'static str,
    needs_catalogue: bool,
    run: Run,
) -> Check {
    Check { number: Some(number), name, group, proves, needs_catalogue, needs_glare: false, run }
}

const fn published(name: &'static str, group: &'static str, proves: &'static str, run: Run) -> Check {
    Check { number: None, name, group, proves, needs_catalogue: true, needs_glare: false, run }
}

const fn of_glare(number: Option<u8>, name: &'static str, proves: &'static str, run: Run) -> Check {
    Check { number, name, group: "glare", proves, needs_catalogue: true, needs_glare: true, run }
}

/// The group of checks of bodies and asteroids. They are drawn with methods that use fixed-point sums.
const OBJECTS: &str = "objects";

const fn of_objects(number: Option<u8>, name: &'static str, proves: &'static str, run: Run) -> Check {
    Check { number, name, group: OBJECTS, proves, needs_catalogue: false, needs_glare: false, run }
}

static ALL: [Check; 42] = [
    numbered(
        1,
        "solid-angle-sum",
        "solid-angle",
        "the solid angles of a picture's pixels sum to that of the picture",
        false,
        solid_angle::sum,
    ),
    numbered(2, "solid-angle-16k", "solid-angle", "solid angles at 16384 pixels match f64", false, solid_angle::at_16k),
    Check {
        number: None,
        name: "triangle-solid-angle",
        group: "solid-angle",
        proves: "solid angles do not lose precision, unlike two spherical triangles in f32",
        needs_catalogue: false,
        needs_glare: false,
        run: solid_angle::triangles,
    },
    numbered(
        3,
        "off-axis-window",
        "solid-angle",
        "an off-axis frustum is a sub-window of the symmetric one",
        true,
        solid_angle::off_axis_window,
    ),
    numbered(
        4,
        "fisheye-centre-and-rim",
        "solid-angle",
        "the centre of a fisheye and the rim of the full sphere are finite and correct",
        true,
        solid_angle::fisheye_centre_and_rim,
    ),
    numbered(
        5,
        "equirectangular-pole",
        "star-light",
        "a star on the pole of an equirectangular view is whole",
        true,
        star_light::pole,
    ),
    numbered(
        6,
        "wide-perspective",
        "star-light",
        "wide flat views are correct or refused",
        true,
        star_light::wide_perspective,
    ),
    numbered(
        7,
        "centre-to-corner",
        "star-light",
        "a star keeps its light from the centre to the corner",
        true,
        star_light::centre_to_corner,
    ),
    numbered(
        8,
        "edges-corners-poles",
        "star-light",
        "a star is whole on every edge, corner, pole and on the date line",
        true,
        star_light::edges_corners_poles,
    ),
    published(
        "flux-every-projection",
        "star-light",
        "stars of every brightness have the correct light in every projection",
        star_light::every_projection,
    ),
    numbered(
        9,
        "sub-pixel-sweep",
        "kernels",
        "position and width of a star do not depend on its sub-pixel position",
        true,
        kernels::sub_pixel_sweep,
    ),
    numbered(
        10,
        "slow-pan-flicker",
        "kernels",
        "a star does not flicker while it pans slowly",
        true,
        kernels::slow_pan,
    ),
    published(
        "view-space-roundness",
        "kernels",
        "a star that is resolved is round in the sky off axis",
        kernels::roundness,
    ),
    numbered(
        11,
        "million-faint-stars",
        "sums",
        "a million stars of magnitude 20 in a pixel add up",
        true,
        sums::million_faint,
    ),
    published("equal-stars-in-a-pixel", "sums", "20,000 stars in a pixel keep their light", sums::equal_stars),
    numbered(
        12,
        "sirius-beside-21",
        "sums",
        "a star of magnitude 21 next to Sirius keeps its light",
        true,
        sums::sirius,
    ),
    numbered(
        13,
        "overflow-reported",
        "sums",
        "light beyond the range of sums is reported or correct",
        true,
        sums::overflow,
    ),
    numbered(14, "shuffled-order", "sums", "the order of stars does not change a single bit", true, sums::shuffled),
    numbered(15, "two-colours", "sums", "two colours in a pixel add as light", true, sums::two_colours),
    numbered(
        16,
        "resolution-doubled",
        "sky",
        "the mean luminance does not depend on the resolution",
        true,
        sky::resolution_doubled,
    ),
    numbered(
        17,
        "cut-moved",
        "sky",
        "a magnitude limit removes exactly the light of the stars beyond it",
        true,
        sky::cut_moved,
    ),
    numbered(18, "parsec-flight", "sky", "nothing pops while the camera flies", true, sky::flight),
    numbered(
        19,
        "near-camera",
        "sky",
        "stars at, behind and near the camera give finite values only",
        true,
        sky::near_camera,
    ),
    published("whole-sky", "sky", "three views of the whole sky have the same light", sky::whole_sky),
    published(
        "picture-cut",
        "exposure",
        "a picture cut into faces or windows has the same light and exposure",
        exposure::picture_cut,
    ),
    of_glare(Some(20), "glare-roundness", "glare is round in view space, even off the axis", glare::roundness),
    of_glare(None, "glare-profile", "glare falls off like its kernel and has the correct light", glare::profile),
    of_glare(
        Some(21),
        "glare-reference",
        "glare is a convolution on the sphere, in every projection",
        glare::against_reference,
    ),
    of_glare(
        Some(22),
        "glare-leaves-frame",
        "a source that leaves the picture still scatters light into it",
        glare::leaves_frame,
    ),
    of_glare(
        Some(23),
        "glare-cut-into-faces",
        "faces, strips and a rolled head change neither glare nor exposure",
        glare::cut_into_faces,
    ),
    of_glare(None, "glare-eyes", "a near source has a different veil in each eye", glare::two_eyes),
    of_glare(None, "glare-night-to-sun", "no frame shows a remainder of the previous one", glare::night_to_sun),
    of_objects(
        None,
        "body-light",
        "a body has the correct light at every size in every projection",
        objects::body_light,
    ),
    of_objects(None, "body-shrinks", "a body that shrinks to a point does not pop", objects::shrinks),
    Check {
        needs_catalogue: true,
        ..of_objects(None, "body-hides-stars", "a body hides only the stars behind it", objects::hides_stars)
    },
    of_objects(None, "asteroid-light", "meshes, impostors and points have the same light", objects::asteroid_light),
    of_objects(None, "asteroid-seams", "asteroids are whole across edges, poles and rims", objects::seams),
    Check {
        needs_catalogue: true,
        ..of_objects(None, "asteroid-occlusion", "near objects hide objects behind them", objects::occlusion)
    },
    of_objects(None, "impostor-tiles", "the displayed tile matches the position of the eye", objects::tiles),
    of_objects(
        Some(24),
        "asteroid-tumbles",
        "an asteroid does not jump while it tumbles past every pole",
        objects::tumbles,
    ),
    of_objects(None, "head-motion", "a head that rolls, turns or moves sees the correct silhouette", objects::moves),
    of_objects(
        Some(25),
        "asteroid-stereo",
        "both eyes see an asteroid at the same depth at every change of detail",
        objects::in_stereo,
    ),
];

/// No check matches the filter.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no check `{filter}`: must be a name ({names}), a group ({groups}), a number, or part of a name")]
pub struct UnknownCheck {
    filter: String,
    names: String,
    groups: String,
}

/// Returns the checks that match a filter: a number, a group, a name, or part of a name; all of them without a filter.
///
/// # Errors
/// [`UnknownCheck`] if none matches.
pub fn select(filter: Option<&str>) -> Result<Vec<&'static Check>, UnknownCheck> {
    let Some(filter) = filter else { return Ok(checks().iter().collect()) };
    let all = |matches: &dyn Fn(&Check) -> bool| checks().iter().filter(|check| matches(check)).collect::<Vec<_>>();
    let number = filter.parse::<u8>().ok();
    let found = [
        all(&|check| check.name == filter || (number.is_some() && check.number == number)),
        all(&|check| check.group == filter),
        all(&|check| !filter.is_empty() && check.name.contains(filter)),
    ];
    found.into_iter().find(|checks| !checks.is_empty()).ok_or_else(|| {
        let mut groups: Vec<&str> = checks().iter().map(|check| check.group).collect();
        groups.dedup();
        UnknownCheck {
            filter: filter.to_owned(),
            names: checks().iter().map(|check| check.name).collect::<Vec<_>>().join(", "),
            groups: groups.join(", "),
        }
    })
}

/// Runs one check with the methods in `settings`. The check sets the exposure; glare is on only in glare checks.
pub fn run(check: &Check, renderer: &mut Renderer, settings: &RenderSettings) -> CheckResult {
    let start = Instant::now();
    let method = settings.stars.method;
    let scatters_nothing = settings.glare.chosen(method) == GlareMethod::None;
    let mut result = if check.needs_catalogue && !method.draws_catalogue() {
        let message = format!("{} draws its own stars", method.name());
        CheckResult::without_figures(check, Outcome::NotApplicable, message)
    } else if check.group == OBJECTS && method.accumulator() != Accumulator::FixedPoint {
        let message = format!("{} draws only stars", method.name());
        CheckResult::without_figures(check, Outcome::NotApplicable, message)
    } else if check.needs_glare && scatters_nothing {
        CheckResult::without_figures(
            check,
            Outcome::NotApplicable,
            "no glare: glare.method is none, or glare.fraction is 0",
        )
    } else {
        match (check.run)(&mut Context::new(renderer, settings)) {
            Ok(figures) => CheckResult::judge(check, figures),
            Err(error) => CheckResult::without_figures(check, Outcome::Fail, error.to_string()),
        }
    };
    result.seconds = start.elapsed().as_secs_f64();
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_filters_match_them() {
        for (index, check) in checks().iter().enumerate() {
            assert!(
                checks()[..index]
                    .iter()
                    .all(|other| other.name != check.name && (check.number.is_none() || other.number != check.number))
            );
            assert_eq!(select(Some(check.name)).unwrap().len(), 1, "{}", check.name);
        }
        for number in 1..=25 {
            assert_eq!(select(Some(&number.to_string())).unwrap()[0].number, Some(number));
        }
        assert_eq!(select(Some("sums")).unwrap().len(), 6);
        assert_eq!(select(Some("glare")).unwrap().len(), 7);
        assert_eq!(select(Some("objects")).unwrap().len(), 10);
        assert_eq!(select(Some("fisheye")).unwrap().len(), 1);
        assert_eq!(select(None).unwrap().len(), checks().len());
        for wrong in ["", "nothing", "0", "99"] {
            let message = select(Some(wrong)).unwrap_err().to_string();
            assert!(message.contains("slow-pan-flicker") && message.contains("star-light"), "{message}");
        }
    }

    #[test]
    fn figures_over_the_limit_nan_and_no_figures_fail() {
        let check = &checks()[0];
        let right = Figure::at_most("error", 0.01, 0.02, "px");
        assert_eq!(right.to_string(), "error 0.01 px (limit 0.02)");
        assert_eq!(CheckResult::judge(check, vec![right.clone()]).outcome, Outcome::Pass);
        for wrong in [0.021, f64::NAN, f64::INFINITY] {
            let figures = vec![right.clone(), Figure::at_most("error", wrong, 0.02, "px")];
            assert_eq!(CheckResult::judge(check, figures).outcome, Outcome::Fail, "{wrong}");
        }
        assert_eq!(CheckResult::judge(check, Vec::new()).outcome, Outcome::Fail);
        let informative = Figure::informative("seen", 1.26e-7, "");
        assert!(informative.pass && informative.to_string() == "seen 1.3e-7", "{informative}");
    }
}
