//! Which kernel draws a star of which brightness in a viewport.
//!
//! Flicker is the standard deviation over mean of what a display shows of a star while it moves through a pixel. It depends on
//! the star's peak k over display white. The tent's grows with k at once; the B-spline's stays below 0.0113 up to k = 5 and then
//! grows to 0.13; a Gaussian's stays small. `auto` takes for each star the cheapest of them that keeps the budget: its Gaussian lies on
//! the image plane and takes the B-spline's place by and by, so that a star that brightens does not jump. `pixel_gaussian` draws all stars
//! with one that is round in view space.

use std::f64::consts::FRAC_PI_4;

use crate::plan::settings::{PixelGaussianSettings, SIGMAS_PX};
use crate::plan::settings::{RenderSettings, StarMethod};
use crate::{
    photometry::{exposure::white_luminance_cd_m2, kernel::GAUSSIAN_CUT},
    view::{Viewport, projection::Projection},
};

/// Flicker of the tent per unit of the star's peak over display white: the standard deviation, over sub-pixel positions, of
/// the sum of its squared weights, sqrt((7/15)^2 - (2/3)^4). For small peaks flicker grows in proportion.
pub const TENT_FLICKER_PER_PEAK: f64 = 0.142_4;

/// Flicker of the tent for stars at display white.
pub const TENT_FLICKER_AT_WHITE: f64 = 0.085;

/// Peak over display white, and the most that the B-spline flickers up to there.
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

/// The most that the Gaussian that is round in view space flickers, whatever the peak.
pub const GAUSSIAN_FLICKER: f64 = 0.005;

/// The most that the Gaussian on the image plane flickers, up to a million times display white; up to a thousand times 0.006.
pub const PLANE_GAUSSIAN_FLICKER: f64 = 0.016;

/// Share of the B-spline's range of peaks up to which it is drawn alone: a little is left for the mixture with the Gaussian, which
/// flickers most just above its beginning.
const BSPLINE_ALONE: f64 = 0.75;

/// Variance of the pixel itself, pixels^2: a Gaussian that is integrated over pixels is wider by this.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// How far the Gaussian on the image plane reaches, pixels.
const PLANE_REACH_PX: f64 = 4.0;

/// Width of a Gaussian that is round in view space: the larger of an angle and of a number of pixels' sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianWidth {
    /// Standard deviation as an angle, rad.
    pub sigma_rad: f64,
    /// Standard deviation in units of the longer side of the pixel at the star, the pixel's own width included.
    pub sigma_px: f64,
}

impl GaussianWidth {
    /// The width that the settings ask for. As an angle it is held above what keeps the light the same at every sub-pixel
    /// position.
    pub fn new(settings: &PixelGaussianSettings) -> Self {
        let in_pixels = |sigma_px: f64| (sigma_px * sigma_px + PIXEL_VARIANCE).sqrt();
        let least_px = SIGMAS_PX[0];
        match settings.sigma_arcmin {
            Some(arcmin) => Self { sigma_rad: (arcmin / 60.0).to_radians(), sigma_px: in_pixels(least_px) },
            None => Self { sigma_rad: 0.0, sigma_px: in_pixels(settings.sigma_px) },
        }
    }

    /// Standard deviation at a place where the pixel's longer side covers that angle, rad.
    pub fn sigma_at_rad(&self, longer_side_rad: f64) -> f64 {
        self.sigma_rad.max(self.sigma_px * longer_side_rad)
    }

    /// How far the kernel reaches at most in a picture, pixels, no farther than the picture is wide: looked for along both diagonals and both axes.
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
                    // Where the plane ends, as far as a kernel may reach.
                    let image = mapping.pixel_from_direction(rim);
                    most = most.max(image.map_or(side, |image| (image - centre).length()));
                }
            }
        }
        most.min(side) + 1.0
    }
}

/// Which Gaussian draws the brightest stars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GaussianKernel {
    /// Round in view space.
    Round(GaussianWidth),
    /// On the image plane, mixed with the B-spline.
    Plane,
}

/// The kernels of one viewport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelPlan {
    /// Stars below this take the tent: illuminance over the solid angle of a pixel at their place, cd/m^2.
    pub tent_below_cd_m2: f64,
    /// Stars from this on take the Gaussian, the same; those between take the B-spline.
    pub gaussian_from_cd_m2: f64,
    /// The Gaussian.
    pub gaussian: GaussianKernel,
    /// How far it reaches, pixels.
    pub gaussian_reach_px: f64,
}

impl KernelPlan {
    /// The B-spline alone.
    pub fn bspline() -> Self {
        Self {
            tent_below_cd_m2: 0.0,
            gaussian_from_cd_m2: f64::INFINITY,
            gaussian: GaussianKernel::Plane,
            gaussian_reach_px: 0.0,
        }
    }
}

/// The Gaussian of a viewport and its reach in pixels, for methods that may draw one.
pub fn gaussian_of(settings: &RenderSettings, viewport: &Viewport) -> Option<(GaussianKernel, f64)> {
    match settings.stars.method {
        StarMethod::PixelGaussian => {
            let width = GaussianWidth::new(&settings.stars.pixel_gaussian);
            Some((GaussianKernel::Round(width), width.reach_px(&viewport.projection)))
        }
        StarMethod::Auto => Some((GaussianKernel::Plane, PLANE_REACH_PX)),
        _ => None,
    }
}

/// The greatest peak over display white in [`BSPLINE_FLICKER`] up to which the B-spline keeps a budget of flicker.
pub fn bspline_peak_within(flicker: f64) -> f64 {
    BSPLINE_FLICKER.into_iter().take_while(|(_, most)| *most <= flicker).map(|(peak, _)| peak).last().unwrap_or(0.0)
}

/// The kernels of a viewport. `expected_ev100` is the exposure that the frame will be shown with, as far as it is known before the
/// frame is drawn; without it stars may be as bright as they like over display white.
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
    fn the_bspline_serves_up_to_where_its_flicker_reaches_the_budget() {
        assert_eq!(bspline_peak_within(1.0), f64::INFINITY);
        assert_eq!(bspline_peak_within(0.0), 0.0);
        assert_eq!(bspline_peak_within(0.02), 6.5);
        assert_eq!(bspline_peak_within(0.004), 0.1);
    }

    #[test]
    fn an_angle_takes_the_place_of_pixels_but_never_becomes_too_narrow() {
        let wide = GaussianWidth::new(&PixelGaussianSettings { sigma_px: 5.0, sigma_arcmin: Some(60.0) });
        assert!((wide.sigma_at_rad(1e-3) - 1f64.to_radians()).abs() < 1e-12);
        let narrow = GaussianWidth::new(&PixelGaussianSettings { sigma_px: 5.0, sigma_arcmin: Some(1e-3) });
        assert!((narrow.sigma_at_rad(1e-3) - 0.757e-3).abs() < 1e-6);
    }
}
