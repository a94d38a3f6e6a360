//! Reported names of the star method and its kernels, and the bounds of their approximations.

use super::{
    kernels::{BSPLINE_FLICKER, GAUSSIAN_FLICKER, KernelPlan, PLANE_GAUSSIAN_FLICKER, TENT_FLICKER_AT_WHITE},
    method::{Accumulator, StarMethod},
    range::Ranges,
};
use crate::{
    plan::{Approximation, settings::RenderSettings},
    view::{Viewport, projection::Projection},
};

/// The star method as configured, and the kernels that it uses.
pub(super) fn reported_method(method: StarMethod, viewports: &[Viewport], kernels: &[KernelPlan]) -> String {
    let name = match method {
        StarMethod::Auto => {
            let tent = kernels.iter().any(|kernels| kernels.tent_below_cd_m2 > 0.0);
            let gaussian = kernels.iter().any(|kernels| kernels.gaussian_from_cd_m2.is_finite());
            match (tent, gaussian) {
                (true, true) => {
                    "auto: bspline; tent for stars too faint for its flicker to be visible, Gaussian for stars so bright that the B-spline's flicker would be visible"
                }
                (true, false) => "auto: bspline; tent for stars too faint for its flicker to be visible",
                (false, true) => "auto: Gaussian on the image plane",
                (false, false) => "auto: bspline",
            }
        }
        StarMethod::CellSky => "cell_sky: a procedural sky, no star of the catalogue is drawn",
        method => method.name(),
    };
    let through_cube =
        |viewport: &Viewport| !matches!(viewport.projection, Projection::Perspective(_) | Projection::CubeFace(_));
    if method.needs_planes() && viewports.iter().any(through_cube) {
        format!("{name}: through cube faces in views that are not flat")
    } else {
        name.to_owned()
    }
}

/// Approximations of the stars of a frame. Published methods have no bounds; the chart measures their errors.
pub(super) fn certificate(settings: &RenderSettings, viewports: &[Viewport], ranges: &Ranges) -> Vec<Approximation> {
    let (method, budget) = (settings.stars.method, &settings.accuracy);
    let mut certificate = Vec::new();
    // Precision of the catalogue's stars and of tabulated pictures.
    if method.draws_catalogue() {
        let bound = Approximation::new;
        certificate.extend([
            bound("a star's illuminance, held in 21 bits", 3.1e-5, "relative", Some(budget.flux)),
            bound("a star's centroid, drawn in f32", 1e-3, "px", Some(budget.centroid_px)),
            bound("a star's temperature, held in 11 bits", 1.3e-3, "relative", None),
            bound("a star's direction, f32 from its chunk", 5e-7, "rad", None),
        ]);
        let off_px = viewports.iter().filter_map(|viewport| match &viewport.projection {
            Projection::Tabulated(table) => Some(table.accuracy().smooth_px),
            _ => None,
        });
        if let Some(off_px) = off_px.reduce(f64::max) {
            let name = "position of a direction in a tabulated picture, where its mapping is smooth";
            certificate.push(bound(name, off_px, "px", Some(budget.centroid_px)));
        }
    }
    if method.accumulator() != Accumulator::FixedPoint {
        return certificate;
    }
    // Rounding of the sums, and flicker of the kernels.
    let rounding = |name: &str, units_per_lx: f64| Approximation::new(name, 1.0 / units_per_lx, "lx", None);
    certificate.push(rounding("rounding of a star's light in a pixel, unbiased", ranges.main.units_per_lx));
    let flicker = |name: &str, most: f64| {
        Approximation::new(name, most, "standard deviation over mean after tone mapping", Some(budget.flicker))
    };
    match method {
        StarMethod::Auto => {
            certificate.push(flicker("flicker of a star, with any kernel", budget.flicker.max(PLANE_GAUSSIAN_FLICKER)));
        }
        StarMethod::BSpline => {
            certificate.push(flicker("flicker of stars ten times as bright as display white", BSPLINE_FLICKER[8].1));
        }
        StarMethod::Tent => certificate.push(flicker("flicker of stars at display white", TENT_FLICKER_AT_WHITE)),
        StarMethod::PixelGaussian => certificate.push(flicker("flicker of a star", GAUSSIAN_FLICKER)),
        _ => {}
    }
    if let Some(bright) = ranges.bright {
        let name = "rounding of the stars that are far brighter than the rest";
        certificate.push(rounding(name, bright.units_per_lx));
    }
    certificate
}
