//! Parameters of the star methods that blend, from the settings and the exposure. They are explained, method by method,
//! in `docs/star-methods.md`.
//!
//! Methods of relative brightness use units of the display's white. A frame with automatic exposure is metered on their
//! output, so their unit must not follow the meter: it is the white of the configured `ev100`, whatever the mode.

use std::f64::consts::PI;

use crate::plan::settings::{GaussianPsfSettings, StarMethod, StarSettings};
use crate::{
    photometry::{
        exposure::white_luminance_cd_m2,
        psf::{InverseSquare, Psf},
    },
    units::illuminance_lx_from_magnitude,
};

/// Relative brightness below which the published Gaussian is cut off: half a step of eight bits.
pub const THRESHOLD_BRIGHTNESS: f64 = 1.0 / 512.0;

/// Base of the magnitude scale as published: 100^(1/5), rounded.
pub const PUBLISHED_POGSON: f64 = 2.512;

/// Limit of the relative brightness of a Gaussian. With the published exponent, the brightness exceeds the range of f32 for magnitudes slightly below
/// zero.
pub const GREATEST_BRIGHTNESS: f64 = 1e20;

/// Diameters of `scaled_disc` at the brightest and the faintest magnitude, relative to the configured one.
pub const SCALED_DISC_RANGE: [f64; 2] = [3.0, 0.3];

/// The point-spread function of `psf_texture`, prepared for drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnPsf {
    /// The function.
    pub form: InverseSquare,
    /// [`InverseSquare::largest`] of it.
    pub largest: f64,
}

impl DrawnPsf {
    /// Prepares a texture.
    pub fn new(psf: &Psf) -> Self {
        let form = InverseSquare::holding_light(psf);
        Self { largest: form.largest(), form }
    }
}

/// Parameters of a method that blends, except the stars and the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct BillboardPlan {
    /// The method.
    pub method: StarMethod,
    /// Fainter stars are not drawn, lx.
    pub faintest_lx: f64,
    /// Discs and sprites: radius, rad.
    pub radius_rad: f64,
    /// Discs and sprites: solid angle, sr; in the flat form of the published program, pi times the radius squared.
    pub solid_angle_sr: f64,
    /// `scaled_disc`: magnitudes of the largest and the smallest disc.
    pub magnitudes: [f64; 2],
    /// `screen_billboard`: half of the side, pixels.
    pub half_side_px: f64,
    /// Gaussians.
    pub gaussian: GaussianPsfSettings,
    /// Luminance of relative brightness 1, cd/m^2.
    pub white_cd_m2: f64,
    /// `psf_texture`: half angle of a star of 1 lx, rad; that of other stars is proportional to the root of their illuminance.
    pub crop_rad: f64,
}

impl BillboardPlan {
    /// Parameters for `stars`. `configured_ev100` determines the unit of relative methods. `shown_ev100` is the exposure with which the frame will be
    /// shown, or an estimate of it: `psf_texture` is cropped where it is invisible at that exposure.
    pub fn new(stars: &StarSettings, configured_ev100: f64, shown_ev100: f64, psf: Option<&DrawnPsf>) -> Self {
        let radius_rad = (stars.billboard.diameter_arcmin / 120.0).to_radians();
        let gaussian = stars.gaussian_psf;
        let limit_lx = illuminance_lx_from_magnitude(stars.magnitude_limit);
        let faintest_lx = match stars.method {
            StarMethod::GaussianPsf | StarMethod::GaussianPsfIntegrated => {
                // Beyond this, neither Gaussian reaches the threshold, and the published point size is 0.
                let steps = (gaussian.glare_brightness.max(1.0) / THRESHOLD_BRIGHTNESS).ln() / PUBLISHED_POGSON.ln();
                let of_saturation = gaussian.limiting_magnitude - gaussian.saturation_magnitude;
                limit_lx.max(illuminance_lx_from_magnitude(gaussian.saturation_magnitude + steps / of_saturation))
            }
            _ => limit_lx,
        };
        Self {
            method: stars.method,
            faintest_lx,
            radius_rad,
            solid_angle_sr: PI * radius_rad * radius_rad,
            magnitudes: [stars.billboard.brightest_magnitude, stars.billboard.faintest_magnitude],
            half_side_px: stars.billboard.screen_size_px / 2.0,
            gaussian,
            white_cd_m2: white_luminance_cd_m2(configured_ev100),
            crop_rad: psf
                .map_or(0.0, |psf| (psf.largest / (THRESHOLD_BRIGHTNESS * white_luminance_cd_m2(shown_ev100))).sqrt()),
        }
    }

    /// The least half angle to which `psf_texture` is cropped: two texels, or a pixel at the centre of the plane if that is larger. So cropping does
    /// not make a faint star vanish between pixels more often than it would without cropping.
    pub fn least_crop_rad(psf: &DrawnPsf, pixel_rad: f64) -> f64 {
        (2.0 * psf.form.pixel_rad).max(pixel_rad).min(psf.form.half_width_rad())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::magnitude_from_illuminance_lx;

    #[test]
    fn the_faintest_star_of_the_gaussian_just_reaches_the_threshold() {
        let stars = StarSettings { method: StarMethod::GaussianPsf, ..StarSettings::default() };
        let plan = BillboardPlan::new(&stars, 0.0, 0.0, None);
        let magnitude = magnitude_from_illuminance_lx(plan.faintest_lx);
        let brightness = PUBLISHED_POGSON.powf((7.0 - 1.0) * (1.0 - magnitude));
        assert!((brightness / THRESHOLD_BRIGHTNESS - 1.0).abs() < 1e-9, "{magnitude} {brightness}");
        // The published exponent is a product of two ranges of magnitudes. Here it is six times too steep, so a star of magnitude 2.13 is the
        // faintest visible one although the limit is 7.
        assert!((magnitude - 2.129).abs() < 1e-3, "{magnitude}");
        let disc = StarSettings { method: StarMethod::Disc, magnitude_limit: 6.0, ..StarSettings::default() };
        let plan = BillboardPlan::new(&disc, 0.0, 0.0, None);
        assert!((magnitude_from_illuminance_lx(plan.faintest_lx) - 6.0).abs() < 1e-9);
        assert!((plan.radius_rad.to_degrees() - 0.1).abs() < 1e-12);
    }
}
