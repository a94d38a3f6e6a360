//! The render settings of a frame: methods by name, exposure, tone mapping and the error budget.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use super::{
    asteroids::{AsteroidSettings, Culling, ImpostorMethod},
    glare::settings::{GlareMethod, GlareSettings, PyramidWeights},
    headset::{AfterExit, HeadsetSettings, ReferenceSpace, SwapchainFormat, SwapchainLayout},
    stars::method::{Accumulator, MethodSource, StarMethod},
    stars::settings::{
        BillboardSettings, CellSkySettings, GaussianPsfSettings, PixelGaussianSettings, PsfTextureSettings,
        StarSettings,
    },
};
use crate::photometry::exposure::{STANDARD_KEY, key_compensation_ev, metered_ev100};
pub use crate::photometry::tone_map::{ToneMapOperator, ToneMapSettings};

/// How the exposure is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExposureMode {
    /// Automatic: by `metering`.
    #[default]
    Auto,
    /// Fixed: `ev100`.
    Manual,
}

/// What the automatic exposure goes by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Metering {
    /// Stars of `limiting_magnitude` are just seen in the first view; less where sunlit bodies or asteroids would be too bright.
    #[default]
    LimitingMagnitude,
    /// The mean luminance of all views, weighted by solid angle.
    Mean,
    /// The mean luminance of a small cone around the middle of the first view's picture, weighted by solid angle.
    Spot,
}

named!(Metering {
    LimitingMagnitude = "limiting_magnitude",
    Mean = "mean",
    Spot = "spot",
});

/// Exposure settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExposureSettings {
    /// How the exposure is chosen.
    pub mode: ExposureMode,
    /// `auto`: what the exposure goes by.
    pub metering: Metering,
    /// Metering `limiting_magnitude`: the faintest stars that the first view shows; they peak at 20 of 255.
    pub limiting_magnitude: f64,
    /// `manual`: exposure value at ISO 100; display white is 1.2 * 2^ev100 cd/m^2. Unit of star methods of relative brightness.
    pub ev100: f64,
    /// Metering `mean` and `spot`: fraction of display white at which the mean luminance is shown; the default is that of ISO 2720 and ISO 12232.
    pub key: f64,
    /// Metering `spot`: angle across the cone whose mean luminance is metered.
    pub spot_deg: f64,
    /// `auto`: exposure compensation, added to the exposure value; positive darkens.
    pub compensation_ev: f64,
    /// `auto`: lowest exposure value, not above `max_ev100`.
    pub min_ev100: f64,
    /// `auto`: highest exposure value.
    pub max_ev100: f64,
    /// Time constant of exposure adaptation in `serve` and `xr`; 0 adapts at once.
    pub adaptation_s: f64,
}

impl ExposureSettings {
    /// The exposure of a frame as far as it is known before the frame is drawn: the manual one, the one that the frames
    /// before have led to, or the one that follows from the plan ([`super::exposure::planned_ev100`]).
    pub fn known_ev100(&self, adapted_ev100: Option<f64>, planned_ev100: Option<f64>) -> Option<f64> {
        match self.mode {
            ExposureMode::Manual => Some(self.ev100),
            ExposureMode::Auto => adapted_ev100.or(planned_ev100),
        }
    }

    /// Whether the exposure goes by that.
    pub fn goes_by(&self, metering: Metering) -> bool {
        self.mode == ExposureMode::Auto && self.metering == metering
    }

    /// Whether a frame that is shown as fully adapted has to be drawn before its exposure is known.
    pub fn is_metered(&self) -> bool {
        self.goes_by(Metering::Mean)
    }

    /// What key and compensation together add to what a meter of the standards reads.
    pub fn offset_ev(&self) -> f64 {
        self.compensation_ev + key_compensation_ev(self.key)
    }

    /// The automatic exposure of a mean luminance, by metering `mean` and `spot`.
    pub fn metered_ev100(&self, mean_cd_m2: f64) -> f64 {
        metered_ev100(mean_cd_m2, self.offset_ev(), self.min_ev100, self.max_ev100)
    }
}

impl Default for ExposureSettings {
    fn default() -> Self {
        Self {
            mode: ExposureMode::Auto,
            metering: Metering::LimitingMagnitude,
            limiting_magnitude: 6.5,
            ev100: -3.0,
            key: STANDARD_KEY,
            spot_deg: 2.0,
            compensation_ev: 0.0,
            min_ev100: -20.0,
            max_ev100: 24.0,
            adaptation_s: 0.5,
        }
    }
}

/// The error budget. `stars.method = "auto"` selects kernels by `flicker`; the certificate of a frame says for each budget
/// whether it is kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AccuracySettings {
    /// Relative error of the flux of a star.
    pub flux: f64,
    /// Error of the centroid of a star.
    pub centroid_px: f64,
    /// Standard deviation over mean of the displayed flux of a star over its sub-pixel positions.
    pub flicker: f64,
    /// `sky_cube`: a source is drawn individually where its veil exceeds this fraction of the veil around it.
    pub glare: f64,
    /// Display images: error against an exact frame, codes of 8 bits; 0 draws them as exactly as HDR images.
    pub display_codes: f64,
    /// Whether sampled pixels are compared with f64: `render` fails where the budget is broken, `serve` warns.
    pub audit: bool,
    /// `serve` alone: how long a frame of display images may take. Where it takes longer, the images of streams give up quality step by step, and every
    /// frame says what; absent: they give up nothing.
    pub frame_ms: Option<f64>,
}

impl Default for AccuracySettings {
    fn default() -> Self {
        Self {
            flux: 1e-3,
            centroid_px: 0.05,
            flicker: 0.02,
            glare: 0.02,
            display_codes: 0.5,
            audit: false,
            frame_ms: None,
        }
    }
}

/// Everything that decides how a snapshot is drawn.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct RenderSettings {
    /// Stars.
    pub stars: StarSettings,
    /// Fields of asteroids.
    pub asteroids: AsteroidSettings,
    /// Glare.
    pub glare: GlareSettings,
    /// Exposure.
    pub exposure: ExposureSettings,
    /// Tone mapping.
    pub tone_map: ToneMapSettings,
    /// Error budget.
    pub accuracy: AccuracySettings,
}

impl RenderSettings {
    /// The exposure whose display white is the luminance that a frame shows white, as far as it is known before the frame is
    /// drawn: the exposure's own, unless the operator does not go by it.
    pub fn known_white_ev100(&self, known_ev100: Option<f64>) -> Option<f64> {
        self.tone_map.white_ev100().or(known_ev100)
    }
}
