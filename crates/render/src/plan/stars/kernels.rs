//! Kernels that draw the stars of a viewport, by brightness.
//!
//! Flicker is the standard deviation of the displayed light of a star while it moves through a pixel, divided by its mean. It depends on the ratio k
//! of the star's peak to display white. The flicker of the tent grows with k from the start. That of the B-spline stays below 0.0113 up to k = 5 and
//! then grows to 0.13. That of a Gaussian stays small. `auto` draws each star with the cheapest kernel that keeps the budget. Its Gaussian is defined
//! on the image plane and gradually replaces the B-spline, so that a brightening star does not jump. `pixel_gaussian` draws all stars with a Gaussian
//! that is round in view space.

use std::f64::consts::FRAC_PI_4;

use crate::plan::settings::{PixelGaussianSettings, SIGMAS_PX};
use crate::plan::settings::{RenderSettings, StarMethod};
use crate::{
    photometry::{exposure::white_luminance_cd_m2, kernel::GAUSSIAN_CUT},
    view::{Viewport, projection::Projection},
};

/// Flicker of the tent per unit of the star's peak relative to display white: the standard deviation, over sub-pixel positions, of
/// the sum of its squared weights, sqrt((7/15)^2 - (2/3)^4). For small peaks flicker grows in proportion.
pub const TENT_FLICKER_PER_PEAK: f64 = 0.142_4;

/// Flicker of the tent for stars at display white.
pub const TENT_FLICKER_AT_WHITE: f64 = 0.085;

/// Pairs of a peak relative to display white and the greatest flicker of the B-spline up to that peak.
pub const BSPLINE_FLICKER: [(f64, f64); 13] = [
    (0.03, 0.0008),
    (0.1, 0.0024),
    (0.3, 0.0060),
    (1.0, 0.0113),
    (5.0, 0.0113),
    (6.0, 0.0162),
    (6.5, 0.0196),
    (8.0, 0.0283),
    (10.0, 0.0382),
    (15.0, 0.0582),
    (30.0, 0.0908),
    (100.0, 0.1279),
    (f64::INFINITY, 0.1365),
];

/// Greatest flicker of the Gaussian that is round in view space, for any peak.
pub const GAUSSIAN_FLICKER: f64 = 0.005;

/// Greatest flicker of the Gaussian on the image plane, for peaks up to a million times display white. Up to a thousand times display white it is
/// 0.006.
pub const PLANE_GAUSSIAN_FLICKER: f64 = 0.016;

/// Fraction of the B-spline's range of peaks in which it is drawn alone. Above this fraction it is mixed with the Gaussian. The rest of the range is
/// a margin, because the mixture flickers most just above its beginning.
const BSPLINE_ALONE: f64 = 0.75;

/// Variance of the pixel itself, pixels^2, which integration over pixels adds to that of the Gaussian.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// Reach of the Gaussian on the image plane, pixels.
const PLANE_REACH_PX: f64 = 4.0;

/// Width of a Gaussian that is round in view space: the larger of an angle and a number of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianWidth {
    /// Standard deviation as an angle, rad.
    pub sigma_rad: f64,
    /// Standard deviation in units of the longer side of the pixel at the star, including the pixel's own width.
    pub sigma_px: f64,
}

impl GaussianWidth {
    /// The width from the settings. An angle is limited to the width that keeps the light constant over sub-pixel
    /// positions.
    pub fn new(settings: &PixelGaussianSettings) -> Self {
        let in_pixels = |sigma_px: f64| (sigma_px * sigma_px + PIXEL_VARIANCE).sqrt();
        let least_px = SIGMAS_PX[0];
        match settings.sigma_arcmin {
            Some(arcmin) => Self { sigma_rad: (arcmin / 60.0).to_radians(), sigma_px: in_pixels(least_px) },
            None => Self { sigma_rad: 0.0, sigma_px: in_pixels(settings.sigma_px) },
        }
    }

    /// Standard deviation at a position where the longer side of a pixel has the given angle, rad.
    pub fn sigma_at_rad(&self, longer_side_rad: f64) -> f64 {
        self.sigma_rad.max(self.sigma_px * longer_side_rad)
    }

    /// Greatest reach of the kernel in a picture, pixels, at most the size of the picture. It is sampled along both diagonals and both axes.
    pub(crate) fn reach_px(&self, projection: &Projection) -> f64 {
        let mapping = projection.mapping();
        let [width, height] = mapping.size();
        let mut most: f64 = 0.0;
        let side = f64::from(width.max(height));
        for step in 0..=32 {
            let along = |side: u32| (f64::from(step) / 32.0 * f64::from(side - 1)) as u32;
            let (x, y) = (along(width), along(height));
            for (x, y) in [(x, y), (x, height - 1 - y), (x, height / 2), (width / 2, y)] {
                let centre = crate::view::projection::pixel_centre(x, y);
                let Some(direction) = mapping.direction_from_pixel(centre) else { continue };
                let Some([longer, _]) = mapping.pixel_extent_rad(direction) else { continue };
                let cut = GAUSSIAN_CUT * self.sigma_at_rad(longer);
                let (right, up) = direction.any_orthonormal_pair();
                for eighth in 0..8 {
                    let (sin, cos) = (f64::from(eighth) * FRAC_PI_4).sin_cos();
                    let rim = direction * cut.cos() + (right * cos + up * sin) * cut.sin();
                    // If the rim of the kernel is not in the image, use the longer side of the picture.
                    let image = mapping.pixel_from_direction(rim);
                    most = most.max(image.map_or(side, |image| (image - centre).length()));
                }
            }
        }
        most.min(side) + 1.0
    }
}

/// Gaussian that draws the brightest stars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GaussianKernel {
    /// Round in view space.
    Round(GaussianWidth),
    /// On the image plane, mixed with the B-spline.
    Plane,
}

/// Kernels of one viewport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelPlan {
    /// Fainter stars are drawn with the tent: illuminance divided by the solid angle of a pixel at their position, cd/m^2.
    pub tent_below_cd_m2: f64,
    /// Brighter stars are drawn with the Gaussian, in the same unit; those in between with the B-spline.
    pub gaussian_from_cd_m2: f64,
    /// The Gaussian.
    pub gaussian: GaussianKernel,
    /// Reach of the Gaussian, pixels.
    pub gaussian_reach_px: f64,
}

impl KernelPlan {
    /// Only the B-spline.
    pub fn bspline() -> Self {
        Self {
            tent_below_cd_m2: 0.0,
            gaussian_from_cd_m2: f64::INFINITY,
            gaussian: GaussianKernel::Plane,
            gaussian_reach_px: 0.0,
        }
    }
}

/// The Gaussian of a viewport and its reach in pixels; `None`: the method draws none.
pub fn gaussian_of(settings: &RenderSettings, viewport: &Viewport) -> Option<(GaussianKernel, f64)> {
    match settings.stars.method {
        method if method.has_round_kernel() => {
            let width = GaussianWidth::new(&settings.stars.pixel_gaussian);
            Some((GaussianKernel::Round(width), width.reach_px(&viewport.projection)))
        }
        StarMethod::Auto => Some((GaussianKernel::Plane, PLANE_REACH_PX)),
        _ => None,
    }
}

/// Distance beyond the border of a picture from which the widest kernel of these viewports reaches into it, pixels.
pub fn margin_px(settings: &RenderSettings, viewports: &[Viewport]) -> f64 {
    let gaussians = viewports.iter().filter_map(|viewport| gaussian_of(settings, viewport));
    gaussians.map(|(_, reach_px)| reach_px).fold(super::cull::SPLAT_MARGIN_PX, f64::max)
}

/// The greatest peak relative to display white in [`BSPLINE_FLICKER`] up to which the B-spline keeps a budget of flicker.
pub fn bspline_peak_within(flicker: f64) -> f64 {
    BSPLINE_FLICKER.into_iter().take_while(|(_, most)| *most <= flicker).map(|(peak, _)| peak).last().unwrap_or(0.0)
}

/// Kernels of a viewport. `expected_ev100` is the exposure that the frame will be shown with, if it is known before the
/// frame is drawn; without it, stars may be arbitrarily brighter than display white.
pub fn kernels_of(settings: &RenderSettings, viewport: &Viewport, expected_ev100: Option<f64>) -> KernelPlan {
    let mut kernels = KernelPlan::bspline();
    if let Some((gaussian, reach_px)) = gaussian_of(settings, viewport) {
        (kernels.gaussian, kernels.gaussian_reach_px) = (gaussian, reach_px);
    }
    match settings.stars.method {
        StarMethod::Tent => kernels.tent_below_cd_m2 = f64::INFINITY,
        StarMethod::PixelGaussian => kernels.gaussian_from_cd_m2 = 0.0,
        StarMethod::Auto => {
            let white_cd_m2 = expected_ev100.map_or(0.0, white_luminance_cd_m2);
            kernels.tent_below_cd_m2 = settings.accuracy.flicker / TENT_FLICKER_PER_PEAK * white_cd_m2;
            let peak = bspline_peak_within(settings.accuracy.flicker);
            if peak.is_finite() {
                kernels.gaussian_from_cd_m2 = BSPLINE_ALONE * peak * white_cd_m2;
            }
        }
        _ => {}
    }
    kernels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bspline_is_used_until_its_flicker_reaches_the_budget() {
        assert_eq!(bspline_peak_within(1.0), f64::INFINITY);
        assert_eq!(bspline_peak_within(0.0), 0.0);
        assert_eq!(bspline_peak_within(0.02), 6.5);
        assert_eq!(bspline_peak_within(0.004), 0.1);
    }

    #[test]
    fn an_angle_replaces_pixels_but_is_never_too_narrow() {
        let wide = GaussianWidth::new(&PixelGaussianSettings { sigma_px: 5.0, sigma_arcmin: Some(60.0) });
        assert!((wide.sigma_at_rad(1e-3) - 1f64.to_radians()).abs() < 1e-12);
        let narrow = GaussianWidth::new(&PixelGaussianSettings { sigma_px: 5.0, sigma_arcmin: Some(1e-3) });
        assert!((narrow.sigma_at_rad(1e-3) - 0.757e-3).abs() < 1e-6);
    }
}
