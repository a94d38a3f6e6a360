//! The failure tests: where methods of drawing fail, each a check with a number and a limit.
//!
//! A check renders what it needs with the [`Renderer`] that it is given, with the settings that it is given, so that
//! `stars.method` points it at any method. Images are judged by [`crate::metrics`], solid angles come from f64. Methods of
//! relative brightness are judged after one fitted scale; a check of catalogue stars does not apply to a method that draws
//! stars of its own. A check that cannot be run has failed, and the others go on.
//!
//! Per group of checks one file; [`checks`] lists them all. `scenes` has the made-up skies and views, which the tests share.

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
    /// What was measured.
    pub what: String,
    /// The number.
    pub measured: f64,
    /// The greatest allowed; without one the figure only informs.
    pub limit: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
    /// Whether the limit is kept. A number that is none keeps no limit.
    pub pass: bool,
}

impl Figure {
    /// A figure with a limit: NaN fails.
    pub fn at_most(what: impl Into<String>, measured: f64, limit: f64, unit: &'static str) -> Self {
        Self { what: what.into(), measured, limit: Some(limit), unit, pass: measured <= limit }
    }

    /// A figure without a limit.
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

/// Short, also for the smallest.
fn number(value: f64) -> String {
    let exponential = value != 0.0 && !(1e-3..1e5).contains(&value.abs());
    if exponential { format!("{value:.1e}") } else { format!("{}", (value * 1e4).round() / 1e4) }
}

/// What a check says about a method.
pub type Run = fn(&mut Context<'_>) -> Result<Vec<Figure>, CheckError>;

/// A failure test.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Its number in the design's list of places where methods fail; `None` for the published weaknesses beside it.
    pub number: Option<u8>,
    /// Its name.
    pub name: &'static str,
    /// The group of checks that it belongs to.
    pub group: &'static str,
    /// What it proves, in a sentence.
    pub proves: &'static str,
    /// Whether it looks for stars of the catalogue.
    pub needs_catalogue: bool,
    /// Whether it looks at glare.
    pub needs_glare: bool,
    /// The check itself.
    pub run: Run,
}

/// How a check ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Every figure keeps its limit.
    Pass,
    /// A figure breaks its limit, or there is none.
    Fail,
    /// The check has no meaning for the method.
    NotApplicable,
}

/// A check that was run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckResult {
    /// See [`Check::number`].
    pub number: Option<u8>,
    /// See [`Check::name`].
    pub name: &'static str,
    /// See [`Check::group`].
    pub group: &'static str,
    /// How it ended.
    pub outcome: Outcome,
    /// What was measured.
    pub figures: Vec<Figure>,
    /// Why there are no figures.
    pub message: Option<String>,
    /// Time that it took, s.
    pub seconds: f64,
}

impl CheckResult {
    /// The result of a check that could not be run, or does not apply.
    pub fn without_figures(check: &Check, outcome: Outcome, message: impl Into<String>) -> Self {
        Self { message: Some(message.into()), ..Self::with_figures(check, outcome, Vec::new()) }
    }

    fn with_figures(check: &Check, outcome: Outcome, figures: Vec<Figure>) -> Self {
        let Check { number, name, group, .. } = *check;
        Self { number, name, group, outcome, figures, message: None, seconds: 0.0 }
    }

    /// Judges figures: at least one must have a limit or inform, and all must keep theirs.
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

/// Every check, in the order of the list; checks without a number follow the one that they are nearest to.
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

/// The group of bodies and asteroids, which are drawn with methods that add in fixed point.
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
    numbered(
        2,
        "solid-angle-16k",
        "solid-angle",
        "solid angles at 16384 pixels are those of f64",
        false,
        solid_angle::at_16k,
    ),
    Check {
        number: None,
        name: "triangle-solid-angle",
        group: "solid-angle",
        proves: "solid angles do not cancel as two spherical triangles in f32 do",
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
        "the centre of a fisheye and the rim of the full sphere are finite and right",
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
        "wide flat views are right or refused",
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
        "every brightness has its light in every projection",
        star_light::every_projection,
    ),
    numbered(
        9,
        "sub-pixel-sweep",
        "kernels",
        "place and width of a star do not depend on its place in a pixel",
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
        "a star of magnitude 21 beside Sirius keeps its light",
        true,
        sums::sirius,
    ),
    numbered(
        13,
        "overflow-reported",
        "sums",
        "light beyond the range of sums is reported or right",
        true,
        sums::overflow,
    ),
    numbered(14, "shuffled-order", "sums", "the order of stars does not show in a single bit", true, sums::shuffled),
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
        "a cut by magnitude takes the light of the stars that it names",
        true,
        sky::cut_moved,
    ),
    numbered(18, "parsec-flight", "sky", "nothing pops while the camera flies", true, sky::flight),
    numbered(
        19,
        "near-camera",
        "sky",
        "stars at, behind and near the camera leave nothing that is not finite",
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
    of_glare(Some(20), "glare-roundness", "glare is round in view space, off the axis too", glare::roundness),
    of_glare(None, "glare-profile", "glare falls off as its kernel and holds the light that it should", glare::profile),
    of_glare(
        Some(21),
        "glare-reference",
        "glare is a convolution on the sphere, in every projection",
        glare::against_reference,
    ),
    of_glare(
        Some(22),
        "glare-leaves-frame",
        "a source that leaves the picture goes on glaring into it",
        glare::leaves_frame,
    ),
    of_glare(
        Some(23),
        "glare-cut-into-faces",
        "faces, strips and a rolled head change neither glare nor exposure",
        glare::cut_into_faces,
    ),
    of_glare(None, "glare-eyes", "what is near veils each eye from its own place", glare::two_eyes),
    of_glare(None, "glare-night-to-sun", "no frame shows anything of the one before", glare::night_to_sun),
    of_objects(None, "body-light", "a body has its light at every size in every projection", objects::body_light),
    of_objects(None, "body-shrinks", "a body that shrinks to a point does not pop", objects::shrinks),
    Check {
        needs_catalogue: true,
        ..of_objects(None, "body-hides-stars", "a body hides the stars behind it and no others", objects::hides_stars)
    },
    of_objects(None, "asteroid-light", "meshes, impostors and points have the same light", objects::asteroid_light),
    of_objects(None, "asteroid-seams", "asteroids are whole over edges, poles and rims", objects::seams),
    Check {
        needs_catalogue: true,
        ..of_objects(None, "asteroid-occlusion", "what is nearer hides what is behind it", objects::occlusion)
    },
    of_objects(None, "impostor-tiles", "the tile that is shown is the one for the eye", objects::tiles),
    of_objects(
        Some(24),
        "asteroid-tumbles",
        "an asteroid that tumbles over every pole does not jump",
        objects::tumbles,
    ),
    of_objects(None, "head-motion", "a head that rolls, turns or moves sees what stands there", objects::moves),
    of_objects(
        Some(25),
        "asteroid-stereo",
        "both eyes see an asteroid at one depth through every change of detail",
        objects::in_stereo,
    ),
];

/// No check has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no check `{filter}`: allowed are the names {names}, the groups {groups}, the numbers, and parts of a name")]
pub struct UnknownCheck {
    filter: String,
    names: String,
    groups: String,
}

/// The checks that a filter names: a number, a group, a name, or a part of names; all of them without a filter.
///
/// # Errors
/// [`UnknownCheck`] if there is none.
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

/// Runs one check with the methods that `settings` name. Exposure is the check's own, and there is glare in checks of glare alone.
pub fn run(check: &Check, renderer: &mut Renderer, settings: &RenderSettings) -> CheckResult {
    let start = Instant::now();
    let method = settings.stars.method;
    let scatters_nothing = settings.glare.chosen(method) == GlareMethod::None;
    let mut result = if check.needs_catalogue && !method.draws_catalogue() {
        let message = format!("{} has stars of its own", method.name());
        CheckResult::without_figures(check, Outcome::NotApplicable, message)
    } else if check.group == OBJECTS && method.accumulator() != Accumulator::FixedPoint {
        let message = format!("{} draws stars alone", method.name());
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
    fn names_are_unique_and_filters_find_them() {
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
    fn figures_over_their_limit_fail_and_so_do_none_and_nan() {
        let check = &checks()[0];
        let right = Figure::at_most("error", 0.01, 0.02, "px");
        assert_eq!(right.to_string(), "error 0.01 px (limit 0.02)");
        assert_eq!(CheckResult::judge(check, vec![right.clone()]).outcome, Outcome::Pass);
        for wrong in [0.021, f64::NAN, f64::INFINITY] {
            let figures = vec![right.clone(), Figure::at_most("error", wrong, 0.02, "px")];
            assert_eq!(CheckResult::judge(check, figures).outcome, Outcome::Fail, "{wrong}");
        }
        assert_eq!(CheckResult::judge(check, Vec::new()).outcome, Outcome::Fail);
        let told = Figure::informative("seen", 1.26e-7, "");
        assert!(told.pass && told.to_string() == "seen 1.3e-7", "{told}");
    }
}
