//! The `[stars]` settings: which method, which stars, and one table for each method that has parameters of its own.

use std::{ops::RangeInclusive, path::PathBuf};

use serde::{Deserialize, Serialize};

use super::method::StarMethod;
use crate::photometry::psf::{self, Aperture, Optics, Psf, PsfError, WHITE_K};

/// Star settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StarSettings {
    /// The method.
    pub method: StarMethod,
    /// Stars fainter than this apparent magnitude, for the camera's place, are not drawn.
    pub magnitude_limit: f64,
    /// `[stars.pixel_gaussian]`.
    pub pixel_gaussian: PixelGaussianSettings,
    /// `[stars.billboard]`.
    pub billboard: BillboardSettings,
    /// `[stars.gaussian_psf]`.
    pub gaussian_psf: GaussianPsfSettings,
    /// `[stars.cell_sky]`.
    pub cell_sky: CellSkySettings,
    /// `[stars.psf_texture]`.
    pub psf_texture: PsfTextureSettings,
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PixelGaussianSettings {
    /// Standard deviation, pixels, where no angle is given.
    pub sigma_px: f64,
    /// Standard deviation as an angle in the sky, arcminutes; it takes the place of `sigma_px`.
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

/// Parameters of the discs, of `sprite` and `screen_billboard`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BillboardSettings {
    /// Diameter in the sky of discs and sprites, arcminutes; of `glare_disc`: of its core. `scaled_disc` draws from 3 to 0.3
    /// times this.
    pub diameter_arcmin: f64,
    /// `scaled_disc`: magnitude from which on stars are not drawn larger.
    pub brightest_magnitude: f64,
    /// `scaled_disc`: magnitude from which on stars are not drawn smaller.
    pub faintest_magnitude: f64,
    /// Side of `screen_billboard`, pixels.
    pub screen_size_px: f64,
}

impl Default for BillboardSettings {
    fn default() -> Self {
        Self { diameter_arcmin: 12.0, brightest_magnitude: -5.0, faintest_magnitude: 15.0, screen_size_px: 5.0 }
    }
}

/// Parameters of `gaussian_psf` and `gaussian_psf_integrated`, under the names of the proposal; `screen_billboard` reads
/// `saturation_magnitude`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaussianPsfSettings {
    /// Faintest magnitude that is seen.
    pub limiting_magnitude: f64,
    /// Magnitude from which on a star's centre is at display white.
    pub saturation_magnitude: f64,
    /// Variance of the point-spread function with the pixel's response, pixels^2.
    pub sigma2_px2: f64,
    /// Variance of the glare Gaussian, pixels^2.
    pub glare_sigma2_px2: f64,
    /// Brightness of the glare Gaussian.
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CellSkySettings {
    /// Cells along an edge of a cube face, at least 1.
    pub cells: u32,
    /// Layers of stars.
    pub layers: u32,
    /// Radius of a star, in pixels of the middle of the view.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PsfTextureSettings {
    /// EXR or FITS file of a point-spread function; without one, that of `aperture` is computed.
    pub file: Option<PathBuf>,
    /// Name of the aperture where no file is given: circle, hexagon, curved_blades (six of them), jwst or hubble.
    pub aperture: String,
    /// Diameter of the circle about the aperture, mm; the wider the texture, the smaller it must be. The default makes spikes that a wide view shows.
    pub diameter_mm: f64,
    /// Angle that the whole texture covers, arcminutes, where no file tells the angle of its pixels.
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
            allowed: Aperture::NAMES.join(", "),
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
