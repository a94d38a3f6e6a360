//! The `[stars]` settings: method, limiting magnitude, and one table for each method with parameters.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::method::StarMethod;
use crate::memory_size::MemorySize;
use crate::photometry::psf::{self, Aperture, DIAMETERS_MM, Optics, Psf, PsfError, WHITE_K};

/// Range of `magnitude_limit` and of the magnitudes of the methods. An illuminance beyond it is outside the planner's numerical range.
pub const MAGNITUDES: [f64; 2] = [-100.0, 100.0];

/// How stars are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StarSettings {
    /// Star method, see [star-methods.md](star-methods.md).
    pub method: StarMethod,
    /// Stars with a fainter apparent magnitude, at the position of the camera, are not drawn.
    #[schemars(range(min = MAGNITUDES[0], max = MAGNITUDES[1]))]
    pub magnitude_limit: f64,
    /// Deep stores: memory for stars, which are read when views need them, such as `512MiB`. At least 64 MiB.
    pub memory: MemorySize,
    /// Deep stores: draw every star instead of composite stars. `render` and `film` read the stars that do not fit into `memory` while they draw; `serve`
    /// cannot draw such views.
    pub every_star: bool,
    /// Deep stores: draw frames without the leaves and tiles that are damaged. Otherwise such a frame is an error.
    pub skip_damaged: bool,
    /// Parameters of `pixel_gaussian`.
    pub pixel_gaussian: PixelGaussianSettings,
    /// Parameters of billboard methods.
    pub billboard: BillboardSettings,
    /// Parameters of `gaussian_psf` and `gaussian_psf_integrated`.
    pub gaussian_psf: GaussianPsfSettings,
    /// Parameters of `cell_sky`.
    pub cell_sky: CellSkySettings,
    /// Parameters of `psf_texture`.
    pub psf_texture: PsfTextureSettings,
}

impl Default for StarSettings {
    fn default() -> Self {
        Self {
            method: StarMethod::Auto,
            magnitude_limit: 99.0,
            memory: MemorySize::gib(1),
            every_star: false,
            skip_damaged: false,
            pixel_gaussian: PixelGaussianSettings::default(),
            billboard: BillboardSettings::default(),
            gaussian_psf: GaussianPsfSettings::default(),
            cell_sky: CellSkySettings::default(),
            psf_texture: PsfTextureSettings::default(),
        }
    }
}

impl StarSettings {
    /// The methods that use a key of one of the tables; empty: there is no such key.
    pub fn methods_with(table: &str, key: &str) -> &'static [StarMethod] {
        use StarMethod::{
            CellSky, Disc, GaussianPsf, GaussianPsfIntegrated, GlareDisc, PixelGaussian, PsfTexture, ScaledDisc,
            ScreenBillboard, SmoothDisc, Sprite,
        };
        match (table, key) {
            ("pixel_gaussian", _) => &[PixelGaussian],
            ("billboard", "diameter_arcmin") => &[Disc, SmoothDisc, ScaledDisc, GlareDisc, Sprite],
            ("billboard", "brightest_magnitude" | "faintest_magnitude") => &[ScaledDisc],
            ("billboard", "screen_size_px") => &[ScreenBillboard],
            ("gaussian_psf", "saturation_magnitude") => &[GaussianPsf, GaussianPsfIntegrated, ScreenBillboard],
            ("gaussian_psf", _) => &[GaussianPsf, GaussianPsfIntegrated],
            ("cell_sky", _) => &[CellSky],
            ("psf_texture", _) => &[PsfTexture],
            _ => &[],
        }
    }
}

/// Standard deviations of `pixel_gaussian`, pixels. A narrower kernel flickers more than the certificate of a frame states. With a
/// wider one, every star covers much of the picture, and the time of a frame is unbounded.
pub const SIGMAS_PX: [f64; 2] = [0.7, 64.0];
/// Greatest standard deviation as an angle, arcminutes.
const MOST_SIGMA_ARCMIN: f64 = 600.0;

/// Parameters of `pixel_gaussian`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PixelGaussianSettings {
    /// Standard deviation in pixels; not used if `sigma_arcmin` is given.
    #[schemars(range(min = SIGMAS_PX[0], max = SIGMAS_PX[1]), extend("x-unit" = "pixels"))]
    pub sigma_px: f64,
    /// Standard deviation as an angle on the sky, instead of `sigma_px`; at least 0.7 pixels everywhere.
    #[schemars(range(max = MOST_SIGMA_ARCMIN), extend("exclusiveMinimum" = 0.0, "x-unit" = "arcminutes"))]
    pub sigma_arcmin: Option<f64>,
}

impl Default for PixelGaussianSettings {
    fn default() -> Self {
        Self { sigma_px: SIGMAS_PX[0], sigma_arcmin: None }
    }
}

/// Parameters of `disc`, `smooth_disc`, `scaled_disc`, `glare_disc`, `sprite` and `screen_billboard`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BillboardSettings {
    // The brightest scaled discs have three times this diameter, which must stay below 90 degrees.
    /// Angular diameter of discs and sprites, and of the core of `glare_disc`. `scaled_disc` uses 0.3 to 3 times this.
    #[schemars(range(max = 1800.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "arcminutes"))]
    pub diameter_arcmin: f64,
    /// `scaled_disc`: magnitude at and below which the size is the largest; brighter (smaller) than `faintest_magnitude`.
    #[schemars(range(min = MAGNITUDES[0], max = MAGNITUDES[1]))]
    pub brightest_magnitude: f64,
    /// `scaled_disc`: magnitude at and above which the size is the smallest.
    #[schemars(range(min = MAGNITUDES[0], max = MAGNITUDES[1]))]
    pub faintest_magnitude: f64,
    /// `screen_billboard`: side of the square.
    #[schemars(range(max = 1024.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "pixels"))]
    pub screen_size_px: f64,
}

impl Default for BillboardSettings {
    fn default() -> Self {
        Self { diameter_arcmin: 12.0, brightest_magnitude: -5.0, faintest_magnitude: 15.0, screen_size_px: 5.0 }
    }
}

/// Parameters of `gaussian_psf` and `gaussian_psf_integrated`, under the names of the publication; `screen_billboard` uses
/// `saturation_magnitude` too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaussianPsfSettings {
    /// Limiting magnitude: the magnitude of the faintest visible stars.
    #[schemars(range(min = MAGNITUDES[0], max = MAGNITUDES[1]))]
    pub limiting_magnitude: f64,
    /// Magnitude at which the centre of a star reaches display white; brighter (smaller) than `limiting_magnitude`.
    #[schemars(range(min = MAGNITUDES[0], max = MAGNITUDES[1]))]
    pub saturation_magnitude: f64,
    /// Variance of the point-spread function including the pixel response.
    #[schemars(range(min = 0.01, max = 10_000.0), extend("x-unit" = "pixels^2"))]
    pub sigma2_px2: f64,
    /// Variance of the glare Gaussian.
    #[schemars(range(min = 0.01, max = 10_000.0), extend("x-unit" = "pixels^2"))]
    pub glare_sigma2_px2: f64,
    /// Brightness of the glare Gaussian relative to the core.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "of the core's brightness"))]
    pub glare_brightness: f64,
}

impl Default for GaussianPsfSettings {
    fn default() -> Self {
        Self {
            limiting_magnitude: 7.0,
            saturation_magnitude: 1.0,
            sigma2_px2: 0.49,
            glare_sigma2_px2: 9.0,
            glare_brightness: 0.01,
        }
    }
}

/// Parameters of `cell_sky`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CellSkySettings {
    // Cells of a face are numbered in 32 bits.
    /// Cells along an edge of a cube face.
    #[schemars(range(min = 1, max = 65_535))]
    pub cells: u32,
    // Every pixel evaluates each layer.
    /// Layers of stars.
    #[schemars(range(min = 1, max = 64))]
    pub layers: u32,
    /// Radius of a star, in pixels at the centre of the view.
    #[schemars(range(max = 1024.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "pixels"))]
    pub radius_px: f64,
    /// Seed of the sky.
    pub seed: u32,
}

impl Default for CellSkySettings {
    fn default() -> Self {
        Self { cells: 200, layers: 9, radius_px: 1.0, seed: 1 }
    }
}

/// Parameters of `psf_texture`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PsfTextureSettings {
    /// EXR or FITS file of a point-spread function. Without it, the function of `aperture` is computed.
    pub file: Option<PathBuf>,
    /// Aperture of the computed function; `curved_blades` has six blades.
    pub aperture: String,
    /// Diameter of the circumscribed circle of the aperture. The wider the texture, the smaller the aperture must be.
    #[schemars(range(min = *DIAMETERS_MM.start(), max = *DIAMETERS_MM.end()), extend("x-unit" = "mm"))]
    pub diameter_mm: f64,
    // `photometry::psf::MAX_WIDTH_RAD` as a round number.
    /// Angular width of the texture; not used if the file gives the angle of its pixels.
    #[schemars(range(max = 1200.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "arcminutes"))]
    pub width_arcmin: f64,
}

impl Default for PsfTextureSettings {
    fn default() -> Self {
        Self { file: None, aperture: "hexagon".to_owned(), diameter_mm: 1.0, width_arcmin: 240.0 }
    }
}

impl PsfTextureSettings {
    /// Pixels along a side of a computed texture, and its number of wavelengths.
    const COMPUTED: (u32, usize) = (512, 24);

    /// The texture, balanced for stars of every colour. Computing it takes up to several seconds. Errors: the file is invalid, or
    /// the other settings are outside their ranges.
    pub fn texture(&self) -> Result<Psf, PsfError> {
        let width_rad = (self.width_arcmin / 60.0).to_radians();
        if let Some(file) = &self.file {
            return Ok(psf::read_as_wide(file, width_rad)?.psf.balanced_to_white());
        }
        Ok(Psf::from_aperture(&self.optics()?, |_, _| {})?.balanced_to_white())
    }

    /// Checks whether a texture can be computed from these settings, if no file is given, without computing it.
    pub fn check(&self) -> Result<(), PsfError> {
        if self.file.is_some() { Ok(()) } else { self.optics()?.check() }
    }

    /// Parameters of the computed texture.
    fn optics(&self) -> Result<Optics, PsfError> {
        let aperture = Aperture::from_name(&self.aperture, 6).ok_or_else(|| PsfError::Parameter {
            name: "stars.psf_texture.aperture",
            value: self.aperture.clone(),
            allowed: format!("one of {}", Aperture::NAMES.join(", ")),
        })?;
        let (size, wavelengths) = Self::COMPUTED;
        let width_rad = (self.width_arcmin / 60.0).to_radians();
        Ok(Optics {
            aperture,
            diameter_mm: self.diameter_mm,
            size,
            pixel_rad: width_rad / f64::from(size),
            wavelengths,
            temperature_k: WHITE_K,
        })
    }
}
