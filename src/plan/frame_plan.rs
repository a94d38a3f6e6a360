//! The plan of a frame: which star kernel serves which brightness, and the certificate of every approximation.

use serde::Serialize;

use super::{
    range::Ranges,
    settings::{RenderSettings, StarMethod},
};
use crate::{photometry::exposure::white_luminance_cd_m2, view::Viewport};

/// Flicker of the tent per unit of the star's peak over display white: the standard deviation, over sub-pixel positions, of
/// the sum of its squared weights, sqrt((7/15)^2 - (2/3)^4). For small peaks flicker grows in proportion.
pub const TENT_FLICKER_PER_PEAK: f64 = 0.142_4;

/// Flicker of the tent for stars at display white.
pub const TENT_FLICKER_AT_WHITE: f64 = 0.085;

/// Flicker of the B-spline for stars up to ten times display white.
pub const BSPLINE_FLICKER: f64 = 0.04;

/// One approximation that a frame makes, with its bound.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Approximation {
    /// What is approximated.
    pub what: String,
    /// Bound of the error.
    pub bound: f64,
    /// Unit of the bound.
    pub unit: String,
    /// Whether the bound keeps the error budget, where the budget has a figure for it.
    pub within_budget: Option<bool>,
}

/// The methods chosen for a frame, and what they cost in accuracy.
#[derive(Clone, Debug, PartialEq, Serialize, Default)]
pub struct FramePlan {
    /// Star method: the one asked for, and what it became.
    pub stars: String,
    /// How splats add up.
    pub accumulator: String,
    /// Glare method.
    pub glare: String,
    /// Every approximation with its bound.
    pub certificate: Vec<Approximation>,
}

/// How the stars of a frame are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct StarPlan {
    /// Per viewport: stars fainter than this take the tent, lx.
    pub tent_below_lx: Vec<f64>,
    /// What is reported.
    pub report: FramePlan,
}

/// Plans the stars of a frame. `expected_ev100` is the exposure that the frame will be shown with, as far as it is known
/// before the frame is drawn.
pub fn plan_stars(
    settings: &RenderSettings,
    viewports: &[Viewport],
    ranges: &Ranges,
    expected_ev100: Option<f64>,
    accumulator: &str,
) -> StarPlan {
    let tent_below_lx: Vec<f64> = viewports
        .iter()
        .map(|viewport| match settings.stars.method {
            StarMethod::Tent => f64::INFINITY,
            StarMethod::Auto => expected_ev100.map_or(0.0, |ev100| {
                let peak = settings.accuracy.flicker / TENT_FLICKER_PER_PEAK;
                peak * white_luminance_cd_m2(ev100) * viewport.projection.smallest_pixel_sr()
            }),
            _ => 0.0,
        })
        .collect();
    let stars = match settings.stars.method {
        StarMethod::Auto if tent_below_lx.iter().all(|lx| *lx == 0.0) => "auto: bspline",
        StarMethod::Auto => "auto: bspline, tent for stars too faint for their flicker to be seen",
        method => method.name(),
    };
    let budget = &settings.accuracy;
    let bound = |what: &str, bound: f64, unit: &str, allowed: Option<f64>| Approximation {
        what: what.to_owned(),
        bound,
        unit: unit.to_owned(),
        within_budget: allowed.map(|allowed| bound <= allowed),
    };
    let flicker_unit = "standard deviation over mean after tone mapping";
    let mut certificate = vec![
        bound("a star's illuminance, held in 21 bits", 3.1e-5, "relative", Some(budget.flux)),
        bound("a star's centroid, drawn in f32", 1e-3, "px", Some(budget.centroid_px)),
        bound("a star's temperature, held in 11 bits", 1.3e-3, "relative", None),
        bound("a star's direction, f32 from its chunk", 5e-7, "rad", None),
        bound("rounding of a star's light in a pixel, unbiased", 1.0 / ranges.main.units_per_lx, "lx", None),
    ];
    if settings.stars.method != StarMethod::Tent {
        // It grows with the peak, to 0.13 at a hundred times display white.
        let what = "flicker of stars drawn with the B-spline, up to ten times display white";
        certificate.push(bound(what, BSPLINE_FLICKER, flicker_unit, Some(budget.flicker)));
    }
    match settings.stars.method {
        StarMethod::Auto if stars.contains("tent") => {
            let what = "flicker of stars drawn with the tent";
            certificate.push(bound(what, budget.flicker, flicker_unit, Some(budget.flicker)));
        }
        StarMethod::Tent => {
            certificate.push(bound(
                "flicker of the tent at display white",
                TENT_FLICKER_AT_WHITE,
                flicker_unit,
                Some(budget.flicker),
            ));
        }
        _ => {}
    }
    if let Some(bright) = ranges.bright {
        certificate.push(bound("rounding of the stars that outshine the rest", 1.0 / bright.units_per_lx, "lx", None));
    }
    let report = FramePlan {
        stars: stars.to_owned(),
        accumulator: accumulator.to_owned(),
        glare: "none".to_owned(),
        certificate,
    };
    StarPlan { tent_below_lx, report }
}
