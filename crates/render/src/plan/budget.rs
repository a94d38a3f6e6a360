//! Error budget of a frame, in the unit of its output.
//!
//! Files of HDR images are exact. HDR images of streams may have an error that is a fraction of a pixel's luminance, with a floor for dark pixels. An
//! 8-bit display image resolves only whole codes. A luminance counts if it changes a display value by `display_codes` codes at the steepest part of
//! the transform from luminance to display value ([`super::settings::ToneMapSettings::greatest_slope`]).

use std::{f64::consts::PI, slice};

use super::{
    Approximation,
    settings::{Accumulator, AccuracySettings, GlareMethod, RenderSettings, StarMethod},
    smooth_light::fit_one_map,
};
use crate::{
    scene::SceneObjects,
    view::{
        Viewport,
        projection::{PlaneMapping, Projection},
    },
};

/// Codes of an 8-bit image above black.
pub(super) const CODES: f64 = 255.0;
/// Fraction of the budget up to which the veil of one source is not drawn individually. Such a veil is part of the smooth remainder, whose error is
/// far smaller than its total.
const SHARE_OF_ONE_VEIL: f64 = 0.2;
/// The same fraction for HDR images. Their budget is a luminance, while the budget of a display image is a step between its darkest codes.
const SHARE_OF_ONE_VEIL_HDR: f64 = 0.04;
/// The same fraction of the allowed relative error, times the glow of the night sky. Every pixel is at least as bright as the glow, and few veils overlap.
const SHARE_OF_ONE_VEIL_OF_GLOW: f64 = 0.2;

/// Number of budget steps per octave. Exposures that differ by less than a step share the data that depends on the budget.
const STEPS_PER_OCTAVE: f64 = 2.0;
/// Greatest pixel angle of a picture for which the smooth part of a veil is smooth from pixel to pixel, rad.
const MOST_PIXEL_OF_VEIL_RAD: f64 = 0.0123;

/// Least budget within which codes are computed with short approximations, codes.
const LEAST_OF_SHORT_CODES: f64 = 0.25;
/// Greatest error of these approximations, codes.
pub const SHORT_CODES_ERROR: f64 = 0.06;

/// Output of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Display images of 8 bits only.
    Display,
    /// HDR images for streams only, within `accuracy.hdr`.
    HdrStream,
    /// Exact HDR images, with or without other images.
    Hdr,
}

/// Error that the images of a frame may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ErrorBudget {
    /// Codes of an 8-bit display image.
    Codes(f64),
    /// Error of an HDR image.
    Hdr {
        /// Relative to the luminance of a pixel.
        relative: f64,
        /// Error that any pixel may have, cd/m^2.
        floor_cd_m2: f64,
    },
}

impl ErrorBudget {
    /// Budget of a frame's images; `None`: they are exact.
    pub fn of_output(accuracy: &AccuracySettings, output: Output) -> Option<Self> {
        match output {
            Output::Display if accuracy.display_codes > 0.0 => Some(Self::Codes(accuracy.display_codes)),
            Output::HdrStream if accuracy.hdr > 0.0 => {
                Some(Self::Hdr { relative: accuracy.hdr, floor_cd_m2: accuracy.hdr_floor_cd_m2 })
            }
            _ => None,
        }
    }

    /// Whether the codes of display images may be computed with the shorter approximations of `shaders/shared/srgb.wgsl`; see
    /// [`SHORT_CODES_ERROR`].
    pub fn allows_short_codes(self) -> bool {
        matches!(self, Self::Codes(codes) if codes >= LEAST_OF_SHORT_CODES)
    }

    /// An approximation whose error is a share of the budget.
    pub fn bound(self, name: &str, share: f64) -> Approximation {
        match self {
            Self::Codes(codes) => Approximation::new(name, share * codes, "codes of 8 bits", Some(codes)),
            Self::Hdr { relative, .. } => {
                Approximation::new(name, share * relative, "relative to the pixel's luminance", Some(relative))
            }
        }
    }

    /// An approximation whose error is `steps` of the least visible steps of luminance, and whose limit is `most` of them.
    pub fn bound_in_steps(self, name: &str, steps: f64, most: f64) -> Approximation {
        let (step, unit) = match self {
            Self::Codes(codes) => (codes, "codes of 8 bits"),
            Self::Hdr { floor_cd_m2, .. } => (floor_cd_m2, "cd/m^2"),
        };
        Approximation::new(name, steps * step, unit, Some(most * step))
    }

    /// Threshold above which the veil of a source is drawn individually, as a fraction of the least luminance that counts.
    pub fn share_of_one_veil(self) -> f64 {
        match self {
            Self::Codes(_) => SHARE_OF_ONE_VEIL,
            Self::Hdr { .. } => SHARE_OF_ONE_VEIL_HDR,
        }
    }

    /// The greatest threshold of the veil of one source, as a fraction of the budget.
    pub fn most_of_one_veil(self) -> f64 {
        match self {
            Self::Codes(_) => SHARE_OF_ONE_VEIL,
            Self::Hdr { .. } => SHARE_OF_ONE_VEIL_OF_GLOW,
        }
    }

    /// Threshold above which the veil of a source is drawn individually in air, as a fraction of the glow of the night sky; 0 for display images, whose
    /// budget is in codes.
    pub fn share_of_glow(self) -> f64 {
        match self {
            Self::Codes(_) => 0.0,
            Self::Hdr { relative, .. } => SHARE_OF_ONE_VEIL_OF_GLOW * relative,
        }
    }

    /// The least luminance that counts, cd/m^2; `None` if there is none. For display images with display white at `white_cd_m2` it is rounded down to half
    /// octaves. `greatest_slope` is that of the display transform ([`super::settings::ToneMapSettings::greatest_slope`]).
    pub fn step_cd_m2(self, greatest_slope: f64, white_cd_m2: f64) -> Option<f64> {
        match self {
            Self::Codes(codes) => {
                let step = codes / CODES / greatest_slope * white_cd_m2;
                (step > 0.0 && step.is_finite())
                    .then(|| ((step.log2() * STEPS_PER_OCTAVE).floor() / STEPS_PER_OCTAVE).exp2())
            }
            Self::Hdr { floor_cd_m2, .. } => Some(floor_cd_m2),
        }
    }
}

/// Whether three kinds of frames may differ: those with display images only, those with HDR images for streams, and those with exact images. Each
/// kind has a separate budget for the veil of single sources and for the faint stars of a map.
pub fn draws_outputs_apart(settings: &RenderSettings, objects: &SceneObjects, viewports: &[Viewport]) -> bool {
    may_have_veil_in_sums(settings, objects, viewports) || may_read_map_alone(settings, objects, viewports)
}

/// Whether any output has a budget. That needs stars that are summed in fixed point, and no asteroid fields.
fn has_budget(settings: &RenderSettings, objects: &SceneObjects) -> bool {
    (settings.accuracy.display_codes > 0.0 || settings.accuracy.hdr > 0.0)
        && settings.stars.method.accumulator() == Accumulator::FixedPoint
        && objects.fields.is_empty()
}

/// Whether frames within a budget may include the veil of single sources in their sums of light.
pub fn may_have_veil_in_sums(settings: &RenderSettings, objects: &SceneObjects, viewports: &[Viewport]) -> bool {
    has_budget(settings, objects)
        && settings.glare.chosen(settings.stars.method) == GlareMethod::SkyCube
        && are_smooth(viewports)
        && !viewports.iter().any(is_coarse)
}

/// Whether frames within a budget and without glare may read their faint stars from a map.
fn may_read_map_alone(settings: &RenderSettings, objects: &SceneObjects, viewports: &[Viewport]) -> bool {
    has_budget(settings, objects)
        && settings.stars.method == StarMethod::Auto
        && settings.glare.chosen(settings.stars.method) == GlareMethod::None
        && viewports.iter().any(|viewport| fit_one_map(slice::from_ref(viewport)))
}

/// Whether adjacent pixels of all pictures are adjacent on the sky, so that smooth light is smooth from pixel to pixel.
pub fn are_smooth(viewports: &[Viewport]) -> bool {
    !viewports.iter().any(surrounds)
}

/// Whether pixels are so large that single sources cover at most a pixel or two.
fn is_coarse(viewport: &Viewport) -> bool {
    viewport.projection.middle_pixel_rad() > MOST_PIXEL_OF_VEIL_RAD
}

/// Whether a picture may show the neighbourhood of a direction in several places: round pictures show the direction behind the view all along their
/// rim, and a table with a cut shows neighbouring directions on both sides of the cut, in different places.
fn surrounds(viewport: &Viewport) -> bool {
    match &viewport.projection {
        Projection::Fisheye(fisheye) => fisheye.half_fov_rad > 0.9 * PI,
        Projection::Tabulated(table) => table.shows_full_sphere() || table.has_cut(),
        _ => false,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::plan::settings::{ToneMapOperator, ToneMapSettings};

    fn display_step_cd_m2(accuracy: &AccuracySettings, greatest_slope: f64, white_cd_m2: f64) -> Option<f64> {
        ErrorBudget::of_output(accuracy, Output::Display)?.step_cd_m2(greatest_slope, white_cd_m2)
    }

    #[test]
    fn streams_of_light_have_their_own_budget() {
        let accuracy = AccuracySettings { hdr: 0.01, hdr_floor_cd_m2: 3e-6, ..AccuracySettings::default() };
        let budget = ErrorBudget::of_output(&accuracy, Output::HdrStream).unwrap();
        assert_eq!(budget.step_cd_m2(8.0, 0.0), Some(3e-6));
        let bound = budget.bound("light", 0.5);
        assert!(bound.bound == 0.005 && bound.within_budget == Some(true), "{bound:?}");
        let beyond = budget.bound_in_steps("star", 1.9, 1.8);
        assert!(beyond.unit == "cd/m^2" && beyond.within_budget == Some(false), "{beyond:?}");
        // Files are exact, and so are streams by default.
        assert_eq!(ErrorBudget::of_output(&accuracy, Output::Hdr), None);
        assert_eq!(ErrorBudget::of_output(&AccuracySettings::default(), Output::HdrStream), None);
    }

    #[test]
    fn a_step_changes_codes_by_at_most_half() {
        let accuracy = AccuracySettings::default();
        for operator in ToneMapOperator::ALL {
            let tone_map = ToneMapSettings::of(operator);
            // `calibrated` uses the display's own white.
            let white = if operator == ToneMapOperator::Calibrated { tone_map.peak_cd_m2 } else { 0.03 };
            let step = display_step_cd_m2(&accuracy, tone_map.greatest_slope(), white).unwrap();
            let code = |luminance: f64| 255.0 * tone_map.display_rgb([luminance; 3], white)[0];
            let mut largest: f64 = 0.0;
            for i in 0..4000 {
                let luminance = white * (-16.0 + f64::from(i) * 0.005).exp2();
                largest = largest.max(code(luminance + step) - code(luminance));
            }
            // Rounded down by half an octave at most.
            assert!(largest <= 0.5 + 1e-9 && largest > 0.34, "{operator:?}: {largest}");
        }
    }

    #[test]
    fn an_exact_budget_has_no_step() {
        let exact = AccuracySettings { display_codes: 0.0, ..AccuracySettings::default() };
        let slope = ToneMapSettings::default().greatest_slope();
        assert_eq!(display_step_cd_m2(&exact, slope, 1.0), None);
        assert_eq!(display_step_cd_m2(&AccuracySettings::default(), slope, 0.0), None);
    }

    #[test]
    fn neighbouring_exposures_share_a_step() {
        let slope = ToneMapSettings::default().greatest_slope();
        let step = |ev100: f64| display_step_cd_m2(&AccuracySettings::default(), slope, ev100.exp2()).unwrap();
        let steps: std::collections::BTreeSet<u64> = (0..100).map(|i| step(f64::from(i) * 0.01).to_bits()).collect();
        assert!(steps.len() <= 3, "{}", steps.len());
        assert!(step(1.0) > step(0.0));
    }
}
