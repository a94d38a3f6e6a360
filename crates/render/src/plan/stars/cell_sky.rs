//! Parameters of the procedural sky, used by its shader and its f64 twin.

use super::settings::CellSkySettings;
use crate::photometry::exposure::white_luminance_cd_m2;

/// Maximum distance of a star from the centre of its cell along each axis, as a fraction of half the cell's side.
pub const JITTER: f64 = 0.5;
/// Brightness of the faintest star. The brightest star has brightness 1, and the number of stars falls as brightness^-2.5.
pub const FAINTEST: f64 = 0.02;
/// Fraction of the cells that contain a star, far from the galactic equator. At the equator every cell contains one.
pub const EVEN_DENSITY: f64 = 0.25;
/// Sine of the latitude at which the density of the band has fallen to 1/e.
pub const BAND_SINE: f64 = 0.2;

/// The procedural sky of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSkyPlan {
    /// Grid and size of the stars.
    pub settings: CellSkySettings,
    /// Luminance of brightness 1: the white of the configured exposure, cd/m^2.
    pub unit_cd_m2: f64,
}

impl CellSkyPlan {
    /// The sky of these settings, with the white of the configured exposure as its unit.
    pub fn new(settings: &CellSkySettings, ev100: f64) -> Self {
        Self { settings: *settings, unit_cd_m2: white_luminance_cd_m2(ev100) }
    }
}
