//! The exposure that follows from the plan alone: stars of the limiting magnitude are just visible, unless sunlit bodies or asteroids
//! require a higher one ([`guard`]).
//!
//! It depends on the pixels of the first view, on the tone mapping and on lit objects, but not on the catalogue, the
//! orientation of the camera, or the glare of stars. So it is known before a pixel is drawn: the resolve pass writes the display image
//! directly, and the same plan has the same exposure on every adapter.

pub mod guard;
pub mod origin;
pub mod pictures;
pub mod settings;
mod technique;

pub(super) use technique::{Exposure, exposure_of_views};
pub use technique::{ExposurePlan, MeteringPlan};

use self::{
    guard::{Lit, white_for_lit_cd_m2},
    pictures::Picture,
};
use super::settings::{Accumulator, ExposureSettings, Meter, RenderSettings};
use crate::{
    photometry::exposure::{WHITE_LUMINANCE_AT_EV0_CD_M2, limiting_ev100, limiting_illuminance_lx},
    units::{ARCSECOND_RAD, illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
    view::Viewport,
};

/// Display code (of 255) that is just visible in a dark room: the peak of a star of the limiting magnitude.
pub const JUST_SEEN_CODE: f64 = 20.0;

/// Limits of the stars that are visible in the views of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisplayedStars {
    /// Mean solid angle of each view's pixels, weighted by solid angle, sr.
    pub pixels_sr: Vec<f64>,
    /// Peak of a star that is just visible, relative to display white.
    pub just_seen: f64,
    /// Exposure value of display white, if the tone mapping does not use the exposure.
    pub white_ev100: Option<f64>,
    /// Whether stars are drawn with their physical light in kernels of pixels; other methods have no known limit.
    pub are_physical: bool,
}

impl DisplayedStars {
    /// Limits for views whose viewports have the given pictures.
    pub fn new(settings: &RenderSettings, viewports: &[Viewport], pictures: &[Picture]) -> Self {
        let views = viewports.iter().map(|viewport| viewport.view + 1).max().unwrap_or(0);
        let mut sums = vec![[0.0; 2]; views];
        for (viewport, picture) in viewports.iter().zip(pictures) {
            let [solid_angle, squares] = picture.pixel_sums;
            sums[viewport.view][0] += solid_angle;
            sums[viewport.view][1] += squares;
        }
        Self {
            pixels_sr: sums.into_iter().map(|[sum, squares]| squares / sum).collect(),
            just_seen: settings.tone_map.light_of_code(JUST_SEEN_CODE),
            white_ev100: settings.tone_map.white_ev100(),
            are_physical: settings.stars.method.accumulator() == Accumulator::FixedPoint,
        }
    }

    /// Magnitude of the faintest visible stars of a view at a given exposure; `None`: no limit is known.
    pub fn limiting_magnitude(&self, view: usize, ev100: f64) -> Option<f64> {
        let pixel_sr = self.pixels_sr.get(view).filter(|_| self.are_physical)?;
        let lx = limiting_illuminance_lx(self.white_ev100.unwrap_or(ev100), *pixel_sr, self.just_seen);
        Some(magnitude_from_illuminance_lx(lx)).filter(|magnitude| magnitude.is_finite())
    }

    /// The exposure at which stars of a magnitude are just visible in pixels of a solid angle, sr; `None`: in those of the first view.
    fn ev100_for(&self, magnitude: f64, pixel_sr: Option<f64>) -> Option<f64> {
        let pixel_sr = pixel_sr.or_else(|| self.pixels_sr.first().copied())?;
        Some(limiting_ev100(illuminance_lx_from_magnitude(magnitude), pixel_sr, self.just_seen))
    }
}

/// The exposure from the plan alone; `None`: it is manual or metered.
///
/// A calibrated display determines the exposure itself.
pub fn planned_ev100(
    settings: &RenderSettings,
    stars: &DisplayedStars,
    pictures: &[Picture],
    lit: Option<&Lit<'_>>,
) -> Option<f64> {
    let exposure = &settings.exposure;
    let ExposureSettings::Auto(auto) = exposure else { return None };
    let Meter::LimitingMagnitude { limiting_magnitude, reference_arcmin } = auto.meter else { return None };
    if let Some(white_ev100) = stars.white_ev100 {
        return Some(white_ev100);
    }
    let reference_sr = reference_arcmin.map(|side| (side * 60.0 * ARCSECOND_RAD).powi(2));
    let dark = stars.ev100_for(limiting_magnitude, reference_sr)?;
    let white_cd_m2 = lit.map_or(0.0, |lit| white_for_lit_cd_m2(lit, pictures));
    // This is minus infinity without lit objects.
    let bright = (white_cd_m2 / WHITE_LUMINANCE_AT_EV0_CD_M2).log2();
    Some((dark.max(bright) + auto.compensation_ev).clamp(auto.min_ev100, auto.max_ev100))
}

#[cfg(test)]
mod tests;
