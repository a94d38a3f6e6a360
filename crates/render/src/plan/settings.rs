//! The render settings of a frame: methods by name, exposure, tone mapping and the error budget.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use super::{
    asteroids::{AsteroidSettings, Culling, ImpostorMethod},
    exposure::settings::{AutoExposure, ExposureKeys, ExposureMode, ExposureSettings, ExposureValues, Meter, Metering},
    glare::settings::{GlareKeys, GlareMethod, GlareSettings, PyramidWeights},
    headset::{AfterExit, HeadsetSettings, ReferenceSpace, SwapchainFormat, SwapchainLayout},
    stars::method::{Accumulator, MethodSource, StarMethod},
    stars::settings::{
        BillboardSettings, CellSkySettings, GaussianPsfSettings, MAGNITUDES, PixelGaussianSettings, PsfTextureSettings,
        SIGMAS_PX, StarSettings,
    },
};
pub use crate::photometry::tone_map::{ToneMapKeys, ToneMapOperator, ToneMapSettings};

/// The error budget. `stars.method = "auto"` selects kernels by `flicker`. The certificate of a frame states for each budget whether it is kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AccuracySettings {
    // A budget above its limit (all of the light, or ten pixels) is a mistake.
    /// Relative error of the flux of a star.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub flux: f64,
    /// Error of the centroid of a star.
    #[schemars(range(max = 10.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "pixels"))]
    pub centroid_px: f64,
    /// Standard deviation of the displayed flux of a star over its sub-pixel positions, divided by the mean.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub flicker: f64,
    /// `sky_cube`: a source is drawn individually if its veil exceeds this fraction of the veil around it. In air, a twentieth of the
    /// glow of the night sky counts as veil in exact images.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub glare: f64,
    /// Display images: error compared with an exact frame, codes of 8 bits. 0 draws them as exactly as HDR images.
    #[schemars(range(min = 0.0, max = 64.0), extend("x-unit" = "codes of 8 bits"))]
    pub display_codes: f64,
    /// HDR images that the daemon sends as RGB32F: error of a pixel's light, relative to its luminance. 0 draws them as exactly as EXR files, which
    /// are always exact.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub hdr: f64,
    /// With `hdr`: error that any pixel may have, however dark it is.
    #[schemars(range(max = 1e6), extend("exclusiveMinimum" = 0.0, "x-unit" = "cd/m²"))]
    pub hdr_floor_cd_m2: f64,
    /// Whether sampled pixels are compared with f64. If an error exceeds the budget, `render` fails and `serve` warns.
    pub audit: bool,
    /// Only for `serve`: how long a frame of display images may take. If frames take longer, the quality of the images of streams is reduced step by
    /// step, and every frame reports the reductions. If this is absent, quality is never reduced.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "ms"))]
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
            hdr: 0.0,
            hdr_floor_cd_m2: 2e-6,
            audit: false,
            frame_ms: None,
        }
    }
}

/// All settings that determine how a snapshot is drawn.
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
    /// The exposure whose display white is the luminance that a frame shows as white, if it is known before the frame is drawn: the given exposure,
    /// unless the tone-mapping operator has its own white.
    pub fn known_white_ev100(&self, known_ev100: Option<f64>) -> Option<f64> {
        self.tone_map.white_ev100().or(known_ev100)
    }
}
