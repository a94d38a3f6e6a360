//! The `[stars]` settings: which method, which stars, and one table for each method that has parameters of its own.

use std::{ops::RangeInclusive, path::PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::method::StarMethod;
use crate::photometry::psf::{self, Aperture, Optics, Psf, PsfError, WHITE_K};

/// How stars are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StarSettings {
    /// Star method, see [star-methods.md](star-methods.md).
    pub method: StarMethod,
    /// Stars with a fainter apparent magnitude, at the position of the camera, are not drawn.
    pub magnitude_limit: f64,
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

impl StarSettings {
    /// Range of `magnitude_limit` and of the magnitudes of the methods: beyond it an illuminance leaves the numbers that the
    /// planner works with.
    pub const MAGNITUDES: [f64; 2] = [-100.0, 100.0];
}

impl Default for StarSettings {
    fn default() -> Self {
        Self {
            method: StarMethod::Auto,
            magnitude_limit: 99.0,
            pixel_gaussian: PixelGaussianSettings::default(),
            billboard: BillboardSettings::default(),
            gaussian_psf: GaussianPsfSettings::default(),
            cell_sky: CellSkySettings::default(),
            psf_texture: PsfTextureSettings::default(),
        }
    }
}

/// Parameters of `pixel_gaussian`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PixelGaussianSettings {
    /// Standard deviation in pixels; not used if `sigma_arcmin` is given.
    pub sigma_px: f64,
    /// Standard deviation as an angle on the sky, in place of `sigma_px`; at least 0.7 pixels everywhere.
    pub sigma_arcmin: Option<f64>,
}

impl PixelGaussianSettings {
    /// Standard deviations that may be asked for, pixels. A narrower one flickers more than the certificate of a frame says; of a
    /// wider one every star covers a good part of the picture, and a frame takes as long as it likes.
    pub const SIGMAS_PX: RangeInclusive<f64> = 0.7..=64.0;
    /// Greatest standard deviation as an angle, arcminutes.
    pub const MOST_SIGMA_ARCMIN: f64 = 600.0;
}

impl Default for PixelGaussianSettings {
    fn default() -> Self {
        Self { sigma_px: *Self::SIGMAS_PX.start(), sigma_arcmin: None }
    }
}

/// Parameters of `disc`, `smooth_disc`, `scaled_disc`, `glare_disc`, `sprite` and `screen_billboard`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BillboardSettings {
    /// Angular diameter of discs and sprites, of the core of `glare_disc`; `scaled_disc` uses 0.3 to 3 times this.
    pub diameter_arcmin: f64,
    /// `scaled_disc`: magnitude at and below which the size is the largest; brighter (smaller) than `faintest_magnitude`.
    pub brightest_magnitude: f64,
    /// `scaled_disc`: magnitude at and above which the size is the smallest.
    pub faintest_magnitude: f64,
    /// `screen_billboard`: side of the square.
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
    /// Limiting magnitude: the faintest visible.
    pub limiting_magnitude: f64,
    /// Magnitude at which the centre of a star reaches display white; brighter (smaller) than `limiting_magnitude`.
    pub saturation_magnitude: f64,
    /// Variance of the point-spread function including the pixel response.
    pub sigma2_px2: f64,
    /// Variance of the glare Gaussian.
    pub glare_sigma2_px2: f64,
    /// Brightness of the glare Gaussian relative to the core.
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
    /// Cells along an edge of a cube face.
    pub cells: u32,
    /// Layers of stars.
    pub layers: u32,
    /// Radius of a star, in pixels at the centre of the view.
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
    /// EXR or FITS file of a point-spread function; without it the function of `aperture` is computed.
    pub file: Option<PathBuf>,
    /// Aperture of the computed function; `curved_blades` has six blades.
    pub aperture: String,
    /// Diameter of the circumscribed circle of the aperture. The wider the texture, the smaller it must be.
    pub diameter_mm: f64,
    /// Angular width of the texture; not used if the file gives the angle of its pixels.
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

    /// The texture, balanced for stars of every colour. Computing one takes up to some seconds; a file may be unusable, and
    /// the other settings outside of what is allowed.
    pub fn texture(&self) -> Result<Psf, PsfError> {
        let width_rad = (self.width_arcmin / 60.0).to_radians();
        if let Some(file) = &self.file {
            return Ok(psf::read_as_wide(file, width_rad)?.psf.balanced_to_white());
        }
        Ok(Psf::from_aperture(&self.optics()?, |_, _| {})?.balanced_to_white())
    }

    /// Whether a texture can be computed from these settings, where no file is given: all that can be told without doing it.
    pub fn check(&self) -> Result<(), PsfError> {
        if self.file.is_some() { Ok(()) } else { self.optics()?.check() }
    }

    /// What is computed where no file is given.
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
