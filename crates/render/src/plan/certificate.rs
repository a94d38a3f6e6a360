//! The plan of a frame: which star kernel serves which brightness, and the certificate of every approximation.

use serde::Serialize;

use super::{
    audit::Audit,
    settings::{Accumulator, GlareMethod, RenderSettings, StarMethod},
    stars::{
        kernels::{
            BSPLINE_FLICKER, GAUSSIAN_FLICKER, KernelPlan, PLANE_GAUSSIAN_FLICKER, TENT_FLICKER_AT_WHITE, kernels_of,
        },
        range::Ranges,
    },
};
use crate::view::{Viewport, projection::Projection};

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
    /// What comparing sampled pixels with f64 has found, where `accuracy.audit` asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub audit: Option<Audit>,
}

/// How the stars of a frame are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct StarPlan {
    /// Kernels of each viewport.
    pub kernels: Vec<KernelPlan>,
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
    let kernels: Vec<KernelPlan> =
        viewports.iter().map(|viewport| kernels_of(settings, viewport, expected_ev100)).collect();
    let stars = match settings.stars.method {
        StarMethod::Auto => {
            let tent = kernels.iter().any(|kernels| kernels.tent_below_cd_m2 > 0.0);
            let gaussian = kernels.iter().any(|kernels| kernels.gaussian_from_cd_m2.is_finite());
            match (tent, gaussian) {
                (true, true) => {
                    "auto: bspline; tent for stars too faint, Gaussian for stars too bright for its flicker not to be seen"
                }
                (true, false) => "auto: bspline, tent for stars too faint for their flicker to be seen",
                (false, true) => "auto: Gaussian on the image plane",
                (false, false) => "auto: bspline",
            }
        }
        StarMethod::CellSky => "cell_sky: a procedural sky, no star of the catalogue is drawn",
        method => method.name(),
    };
    let through_cube =
        |viewport: &Viewport| !matches!(viewport.projection, Projection::Perspective(_) | Projection::CubeFace(_));
    let stars = if settings.stars.method.needs_planes() && viewports.iter().any(through_cube) {
        format!("{stars}: through cube faces where a view is not flat")
    } else {
        stars.to_owned()
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
    ];
    let off_px = viewports.iter().filter_map(|viewport| match &viewport.projection {
        Projection::Tabulated(table) => Some(table.accuracy().smooth_px),
        _ => None,
    });
    if let Some(off_px) = off_px.reduce(f64::max) {
        let what = "a direction's place in a tabulated picture, where its mapping is smooth";
        certificate.push(bound(what, off_px, "px", Some(budget.centroid_px)));
    }
    if !settings.stars.method.draws_catalogue() {
        // All of these are of stars of the catalogue.
        certificate.clear();
    }
    if settings.stars.method.accumulator() != Accumulator::FixedPoint {
        // Published methods come without bounds of their own: the chart has their measured errors.
        let accumulator = accumulator.to_owned();
        let glare = plan_glare(settings, &mut certificate);
        let report = FramePlan { stars, accumulator, glare, certificate, audit: None };
        return StarPlan { kernels, report };
    }
    let what = "rounding of a star's light in a pixel, unbiased";
    certificate.push(bound(what, 1.0 / ranges.main.units_per_lx, "lx", None));
    let flicker = |what: &str, most: f64| bound(what, most, flicker_unit, Some(budget.flicker));
    match settings.stars.method {
        StarMethod::Auto => {
            certificate.push(flicker(
                "flicker of a star, whichever kernel draws it",
                budget.flicker.max(PLANE_GAUSSIAN_FLICKER),
            ));
        }
        StarMethod::BSpline => {
            certificate.push(flicker("flicker of stars ten times as bright as display white", BSPLINE_FLICKER[8].1));
        }
        StarMethod::Tent => certificate.push(flicker("flicker of stars at display white", TENT_FLICKER_AT_WHITE)),
        StarMethod::PixelGaussian => certificate.push(flicker("flicker of a star", GAUSSIAN_FLICKER)),
        _ => {}
    }
    if let Some(bright) = ranges.bright {
        certificate.push(bound("rounding of the stars that outshine the rest", 1.0 / bright.units_per_lx, "lx", None));
    }
    let glare = plan_glare(settings, &mut certificate);
    let report = FramePlan { stars, accumulator: accumulator.to_owned(), glare, certificate, audit: None };
    StarPlan { kernels, report }
}

/// Error of the kernel where the map of the sky takes over from the sources: its interpolation, measured over all projections.
const GLARE_MAP_ERROR: f64 = 0.01;

/// The glare method of a frame, as plans report it, and what it approximates. Published methods come without bounds.
fn plan_glare(settings: &RenderSettings, certificate: &mut Vec<Approximation>) -> String {
    let chosen = settings.glare.chosen(settings.stars.method);
    if chosen == GlareMethod::SkyCube {
        let unit = "relative to what is scattered there";
        let bound = |what: &str, bound: f64| Approximation {
            what: what.to_owned(),
            bound,
            unit: unit.to_owned(),
            within_budget: Some(bound <= settings.accuracy.glare),
        };
        certificate.push(bound("glare of a source too faint to be drawn by itself", settings.accuracy.glare));
        certificate.push(bound("glare far from its source, from a map of the sky", GLARE_MAP_ERROR));
    }
    if settings.glare.method == GlareMethod::Auto {
        format!("auto: {}", chosen.name())
    } else {
        chosen.name().to_owned()
    }
}
