//! Maps of surface brightness in files: HEALPix in FITS, as the CDS publishes them.
//!
//! The reader accepts implicit maps in nested order with one column of f32 or f64 numbers and celestial coordinates
//! (ICRS). Between the centres of cells light is interpolated bilinearly.

use std::{
    f64::consts::PI,
    path::{Path, PathBuf},
};

use cdshealpix::nested::{
    bilinear_interpolation,
    map::{
        fits::error::FitsError,
        skymap::{SkyMap, SkyMapEnum},
    },
    n_hash,
};

use super::diffuse::DiffuseSky;
use crate::{
    coordinates::lon_lat_from_direction,
    photometry::{blackbody::rec709_in_gamut, colour_index::temperature_k_from_b_v},
    units::{illuminance_lx_from_magnitude, luminance_from_mag_per_arcsec2},
};

/// Unit of a map's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrightnessUnit {
    /// cd/m^2.
    Luminance,
    /// Stars of V = 10 per square degree.
    S10,
    /// V magnitudes per square arcsecond; infinity means no light.
    MagnitudePerArcsec2,
}

/// A map of surface brightness in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LightMap {
    /// The file.
    pub path: PathBuf,
    /// Unit of its numbers.
    pub unit: BrightnessUnit,
    /// Its colour, as the B-V of a star, magnitudes.
    pub b_v: f64,
}

/// Reasons why a map cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightMapError {
    /// The file is not a HEALPix map in FITS.
    #[error(
        "{}: {source}; a map of light is a FITS file of HEALPix cells: nested, implicit, celestial coordinates, one column of f32 or f64", path.display()
    )]
    Fits {
        /// The file.
        path: PathBuf,
        /// The FITS reader's error.
        source: FitsError,
    },
    /// The map has an unsupported layout.
    #[error("{}: {problem}; a map of light has one number of f32 or f64 for each cell, at most depth {MOST_DEPTH}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// The layout that was found.
        problem: String,
    },
    /// The value of a cell is not a brightness.
    #[error("{}: cell {cell} has {value}; values must be finite, not negative for luminance and S10, and at least -30 for magnitudes", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Number of the cell, nested.
        cell: usize,
        /// Its value.
        value: f64,
    },
}

/// Largest depth of a map: cells of 3.4 arcminutes.
const MOST_DEPTH: u8 = 10;
/// Largest and smallest size of the texels that a map is drawn with, rad.
const TEXELS_RAD: [f64; 2] = [0.0035, 0.0012];

/// Luminance of one star of V = 10 per square degree (S10), cd/m^2.
pub fn s10_cd_m2() -> f64 {
    illuminance_lx_from_magnitude(10.0) / 1_f64.to_radians().powi(2)
}

impl BrightnessUnit {
    /// Luminance of a map's number, cd/m^2; `None` if it is not a brightness.
    fn luminance_cd_m2(self, value: f64) -> Option<f64> {
        let luminance = match self {
            Self::Luminance => value,
            Self::S10 => value * s10_cd_m2(),
            Self::MagnitudePerArcsec2 if value < -30.0 => return None,
            Self::MagnitudePerArcsec2 => luminance_from_mag_per_arcsec2(value),
        };
        (luminance.is_finite() && luminance >= 0.0).then_some(luminance)
    }
}

impl LightMap {
    /// Reads the map.
    ///
    /// # Errors
    ///
    /// See [`LightMapError`]; every message names the file.
    pub fn read(&self) -> Result<DiffuseSky, LightMapError> {
        let kind = |problem: String| LightMapError::Kind { path: self.path.clone(), problem };
        let map = read_fits(&self.path)?;
        let (depth, values): (u8, Vec<f64>) = match &map {
            SkyMapEnum::ImplicitU64F32(map) => (map.depth(), map.values().map(|value| f64::from(*value)).collect()),
            SkyMapEnum::ImplicitU64F64(map) => (map.depth(), map.values().copied().collect()),
            _ => return Err(kind("its layout is not supported".to_owned())),
        };
        if depth > MOST_DEPTH {
            return Err(kind(format!("it has depth {depth}")));
        }
        let cells = n_hash(depth);
        if values.len() as u64 != cells {
            return Err(kind(format!("it has {} cells of {cells}", values.len())));
        }
        let luminance = |(cell, value): (usize, &f64)| {
            let found = self.unit.luminance_cd_m2(*value);
            found.ok_or_else(|| LightMapError::Value { path: self.path.clone(), cell, value: *value })
        };
        let luminance: Vec<f64> = values.iter().enumerate().map(luminance).collect::<Result<_, _>>()?;
        let colour = rec709_in_gamut(temperature_k_from_b_v(self.b_v));
        let cell_rad = (4.0 * PI / cells as f64).sqrt();
        let [most, least] = TEXELS_RAD;
        Ok(DiffuseSky::new((0.7 * cell_rad).clamp(least, most), |towards| {
            let (lon, lat) = lon_lat_from_direction(towards);
            let light: f64 = bilinear_interpolation(depth, lon, lat)
                .iter()
                .map(|(cell, share)| share * luminance[*cell as usize])
                .sum();
            colour.map(|c| c * light)
        }))
    }
}

fn read_fits(path: &Path) -> Result<SkyMapEnum, LightMapError> {
    SkyMapEnum::from_fits_file(path).map_err(|source| LightMapError::Fits { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use cdshealpix::nested::{center, map::fits::write::write_implicit_skymap_fits};
    use glam::DVec3;

    use super::*;
    use crate::{coordinates::direction_from_lon_lat, photometry::rec709};

    fn written(depth: u8, value: impl Fn(DVec3) -> f32) -> (tempfile::TempDir, PathBuf) {
        let values: Vec<f32> = (0..n_hash(depth))
            .map(|cell| {
                let (lon, lat) = center(depth, cell);
                value(direction_from_lon_lat(lon, lat))
            })
            .collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.fits");
        write_implicit_skymap_fits(std::fs::File::create(&path).unwrap(), &values).unwrap();
        (folder, path)
    }

    #[test]
    fn a_map_is_read_back_at_its_directions() {
        let (_folder, path) = written(5, |towards| (100.0 + 80.0 * towards.dot(DVec3::new(0.6, 0.0, 0.8))) as f32);
        let map = LightMap { path: path.clone(), unit: BrightnessUnit::S10, b_v: 0.65 };
        let sky = map.read().unwrap();
        for i in 0..500 {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 500.0;
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            let towards = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            let expected = (100.0 + 80.0 * towards.dot(DVec3::new(0.6, 0.0, 0.8))) * s10_cd_m2();
            let found = rec709::luminance(sky.luminance_cd_m2(towards));
            assert!((found / expected - 1.0).abs() < 0.02, "{towards}: {found} {expected}");
        }
        // Read as magnitudes, these numbers are practically dark.
        let dark = LightMap { unit: BrightnessUnit::MagnitudePerArcsec2, ..map }.read().unwrap();
        assert!(dark.mean_cd_m2() < 1e-3, "{}", dark.mean_cd_m2());
        let (_folder, path) = written(3, |_| 22.0);
        let even = LightMap { path, unit: BrightnessUnit::MagnitudePerArcsec2, b_v: 0.65 }.read().unwrap();
        assert!((even.mean_cd_m2() / 1.712e-4 - 1.0).abs() < 5e-3, "{}", even.mean_cd_m2());
    }

    #[test]
    fn errors_name_files_that_are_not_maps() {
        let message = |path: &Path, unit| {
            LightMap { path: path.to_owned(), unit, b_v: 0.8 }.read().map(|_| ()).unwrap_err().to_string()
        };
        let (folder, path) = written(2, |towards| if towards.z > 0.9 { f32::NAN } else { 1.0 });
        let found = message(&path, BrightnessUnit::Luminance);
        assert!(found.contains("sky.fits") && found.contains("has NaN"), "{found}");
        let (_folder, negative) = written(2, |towards| towards.x as f32);
        assert!(message(&negative, BrightnessUnit::S10).contains("not negative"));
        let text = folder.path().join("text.fits");
        std::fs::write(&text, "SIMPLE  = no").unwrap();
        let found = message(&text, BrightnessUnit::S10);
        assert!(found.contains("text.fits") && found.contains("HEALPix"), "{found}");
        assert!(message(&folder.path().join("none.fits"), BrightnessUnit::S10).contains("none.fits"));
    }
}
