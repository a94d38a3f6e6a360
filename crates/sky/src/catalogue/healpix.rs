//! Reads maps of surface brightness from HEALPix files in FITS (HEALPix FITS specification 3.0), as the CDS and healpy write them.
//!
//! The reader accepts implicit maps, nested or in rings, with f32 or f64 numbers, in celestial (ICRS) or galactic coordinates. If there are several
//! columns, it reads the first. Cells without a value (UNSEEN) give no light; the log reports their number. Between the centres of cells light is
//! interpolated bilinearly.

use std::{
    f64::consts::PI,
    io::{self, Read},
    path::{Path, PathBuf},
};

use cdshealpix::nested::{self, bilinear_interpolation, n_hash};

use super::diffuse::DiffuseSky;
use crate::{
    coordinates::{galactic_from_icrs, lon_lat_from_direction},
    files,
    fits::Header,
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
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file is not a HEALPix map in FITS, or has an unsupported layout.
    #[error(
        "{}: {problem}; a map of light must be a FITS file of HEALPix cells, implicit, nested or in rings, in celestial or galactic coordinates, with \
         f32 or f64 numbers, NSIDE a power of 2 and at most 1024", path.display()
    )]
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

/// Largest NSIDE of a map: cells of 3.4 arcminutes.
const MOST_NSIDE: usize = 1024;
/// Number that marks cells without a value (UNSEEN in the HEALPix software), and tolerance for f32 rounding.
const UNSEEN: f64 = -1.6375e30;
const UNSEEN_WITHIN: f64 = 1e24;
/// Largest and smallest size of the texels with which a map is drawn, rad.
const TEXELS_RAD: [f64; 2] = [0.0035, 0.0012];

/// Luminance of one star of V = 10 per square degree (S10), cd/m^2.
pub fn s10_cd_m2() -> f64 {
    illuminance_lx_from_magnitude(10.0) / 1_f64.to_radians().powi(2)
}

impl BrightnessUnit {
    /// Converts a number of the map to luminance, cd/m^2; `None` if it is not a brightness.
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
        let Cells { depth, values, is_galactic } = read_cells(&self.path)?;
        let cells = n_hash(depth);
        let mut unseen = 0;
        let luminance = |(cell, value): (usize, &f64)| {
            if (value - UNSEEN).abs() < UNSEEN_WITHIN {
                unseen += 1;
                return Ok(0.0);
            }
            let found = self.unit.luminance_cd_m2(*value);
            found.ok_or_else(|| LightMapError::Value { path: self.path.clone(), cell, value: *value })
        };
        let luminance: Vec<f64> = values.iter().enumerate().map(luminance).collect::<Result<_, _>>()?;
        if unseen > 0 {
            tracing::warn!(
                "{}: {unseen} of {cells} cells have no value (UNSEEN) and give no light",
                self.path.display()
            );
        }
        let galactic = galactic_from_icrs();
        let colour = rec709_in_gamut(temperature_k_from_b_v(self.b_v));
        let cell_rad = (4.0 * PI / cells as f64).sqrt();
        let [most, least] = TEXELS_RAD;
        Ok(DiffuseSky::new((0.7 * cell_rad).clamp(least, most), |towards| {
            let (lon, lat) = lon_lat_from_direction(if is_galactic { galactic * towards } else { towards });
            let light: f64 = bilinear_interpolation(depth, lon, lat)
                .iter()
                .map(|(cell, share)| share * luminance[*cell as usize])
                .sum();
            colour.map(|c| c * light)
        }))
    }
}

/// A map as read.
struct Cells {
    depth: u8,
    /// In nested order.
    values: Vec<f64>,
    /// Whether longitude and latitude are galactic.
    is_galactic: bool,
}

/// Reads the first HEALPix table of a FITS file, which may be compressed with gzip.
fn read_cells(path: &Path) -> Result<Cells, LightMapError> {
    let io_error = |source| LightMapError::Io { path: path.to_owned(), source };
    let kind = |problem: String| LightMapError::Kind { path: path.to_owned(), problem };
    let (mut source, _) = files::open_regular(path).and_then(files::expanded).map_err(io_error)?;
    while let Some(header) = Header::next(&mut source).map_err(io_error)? {
        let header = header.map_err(kind)?;
        let length = header.data_bytes().map_err(kind)?;
        let is_map = header.0.get("XTENSION").is_some_and(|text| text == "BINTABLE")
            && header.0.get("PIXTYPE").is_none_or(|text| text == "HEALPIX")
            && header.count("NSIDE").or(header.count("ORDER")).is_some();
        if is_map {
            let layout = Layout::new(&header).map_err(kind)?;
            return layout.read(&mut source, path);
        }
        io::copy(&mut source.by_ref().take(length as u64), &mut io::sink()).map_err(io_error)?;
    }
    Err(kind("it has no HEALPix table".to_owned()))
}

/// Layout of a HEALPix table.
struct Layout {
    depth: u8,
    is_ring: bool,
    is_galactic: bool,
    row_bytes: usize,
    rows: usize,
    /// Number of values of the first column in each row, and whether they are f64.
    repeat: usize,
    is_double: bool,
}

impl Layout {
    /// Reads the layout from a header; the error describes an unsupported layout.
    fn new(header: &Header) -> Result<Self, String> {
        let text = |key: &str| header.0.get(key).map_or("", String::as_str);
        let nside = match (header.count("NSIDE"), header.count("ORDER")) {
            (Some(nside), _) => nside,
            (None, Some(order)) => 1_usize.checked_shl(order as u32).filter(|_| order < 32).unwrap_or(0),
            (None, None) => 0,
        };
        if !nside.is_power_of_two() || nside > MOST_NSIDE {
            return Err(format!("NSIDE is {nside}"));
        }
        let is_ring = match text("ORDERING") {
            "RING" => true,
            "NESTED" | "NEST" => false,
            other => return Err(format!("ORDERING is `{other}`")),
        };
        let is_galactic = match text("COORDSYS") {
            "" | "C" | "CEL" | "Q" | "EQUATORIAL" | "ICRS" => false,
            "G" | "GAL" | "GALACTIC" => true,
            other => return Err(format!("COORDSYS is `{other}`")),
        };
        if text("INDXSCHM") == "EXPLICIT" || text("OBJECT") == "PARTIAL" {
            return Err("it lists only some cells (INDXSCHM = EXPLICIT)".to_owned());
        }
        let form = text("TFORM1");
        let (digits, letter) = form.split_at(form.trim_end_matches(|c: char| c.is_ascii_alphabetic()).len());
        let repeat: Option<usize> = if digits.is_empty() { Some(1) } else { digits.parse().ok() };
        let (Some(repeat @ 1..), true) = (repeat, matches!(letter, "E" | "D")) else {
            return Err(format!("TFORM1 is `{form}`"));
        };
        let [row_bytes, rows] = header.axes()?[..] else { return Err("its table does not have two axes".to_owned()) };
        let is_double = letter == "D";
        let cells = 12 * nside * nside;
        let fits = repeat.checked_mul(if is_double { 8 } else { 4 }).is_some_and(|bytes| bytes <= row_bytes);
        if !fits || repeat.checked_mul(rows) != Some(cells) || row_bytes > 1 << 24 {
            return Err(format!("{rows} rows of {row_bytes} bytes with TFORM1 = `{form}` do not match {cells} cells"));
        }
        let depth = nside.trailing_zeros() as u8;
        Ok(Self { depth, is_ring, is_galactic, row_bytes, rows, repeat, is_double })
    }

    fn read(&self, source: &mut impl Read, path: &Path) -> Result<Cells, LightMapError> {
        let mut row = vec![0; self.row_bytes];
        let mut values = Vec::with_capacity(self.repeat * self.rows);
        for _ in 0..self.rows {
            source.read_exact(&mut row).map_err(|source| LightMapError::Io { path: path.to_owned(), source })?;
            if self.is_double {
                let numbers = row.as_chunks::<8>().0.iter().map(|bytes| f64::from_be_bytes(*bytes));
                values.extend(numbers.take(self.repeat));
            } else {
                let numbers = row.as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_be_bytes(*bytes)));
                values.extend(numbers.take(self.repeat));
            }
        }
        if self.is_ring {
            let layer = nested::get(self.depth);
            values = (0..values.len() as u64).map(|cell| values[layer.to_ring(cell) as usize]).collect();
        }
        Ok(Cells { depth: self.depth, values, is_galactic: self.is_galactic })
    }
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
        // If these numbers are read as magnitudes, the map is practically dark.
        let dark = LightMap { unit: BrightnessUnit::MagnitudePerArcsec2, ..map }.read().unwrap();
        assert!(dark.mean_cd_m2() < 1e-3, "{}", dark.mean_cd_m2());
        let (_folder, path) = written(3, |_| 22.0);
        let even = LightMap { path, unit: BrightnessUnit::MagnitudePerArcsec2, b_v: 0.65 }.read().unwrap();
        assert!((even.mean_cd_m2() / 1.712e-4 - 1.0).abs() < 5e-3, "{}", even.mean_cd_m2());
    }

    fn light(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/light").join(name)
    }

    /// Maps of 192 cells that healpy wrote; their values are linear in the direction. One is in rings with f64 numbers and has one cell without a
    /// value; the other is nested with f32 numbers in galactic coordinates.
    #[test]
    fn maps_of_healpy_have_their_light_in_the_right_place() {
        let value = |towards: DVec3| 100.0 + towards.dot(DVec3::new(60.0, 20.0, -30.0));
        for (name, frame) in [("ring.fits", glam::DMat3::IDENTITY), ("galactic.fits", galactic_from_icrs())] {
            let sky = LightMap { path: light(name), unit: BrightnessUnit::S10, b_v: 0.65 }.read().unwrap();
            let mut dark = 0;
            for cell in 0..192 {
                let (lon, lat) = center(2, cell);
                let centre = direction_from_lon_lat(lon, lat);
                let found = rec709::luminance(sky.luminance_cd_m2(frame.transpose() * centre)) / s10_cd_m2();
                if name == "ring.fits" && found < 0.4 * value(centre) {
                    dark += 1;
                    // The cell that holds longitude 90 and latitude 1.8 degrees, nested: healpy.ang2pix.
                    assert_eq!(cell, 92);
                } else {
                    // Texels of the drawn map are far smaller than a cell; cells next to the dark one lose part of their light.
                    let is_beside = centre.angle_between(DVec3::Y) < 0.6;
                    let lowest = if name == "ring.fits" && is_beside { 0.7 } else { 0.97 };
                    assert!(
                        (lowest..1.03).contains(&(found / value(centre))),
                        "{name} {cell}: {found} {}",
                        value(centre)
                    );
                }
            }
            assert_eq!(dark, u32::from(name == "ring.fits"), "{name}");
        }
    }

    #[test]
    fn layouts_that_cannot_be_read_are_named() {
        let whole = std::fs::read(light("ring.fits")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.fits");
        for (from, to) in [
            ("'RING    '", "'UNIQ    '"),
            ("COORDSYS= 'C       '", "COORDSYS= 'E       '"),
            ("'IMPLICIT'", "'EXPLICIT'"),
            ("NSIDE   =                    4", "NSIDE   =                    3"),
            ("NSIDE   =                    4", "NSIDE   =                    8"),
        ] {
            let mut bytes = whole.clone();
            let place = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
            bytes[place..place + to.len()].copy_from_slice(to.as_bytes());
            std::fs::write(&path, bytes).unwrap();
            let map = LightMap { path: path.clone(), unit: BrightnessUnit::S10, b_v: 0.65 };
            let error = map.read().map(|_| ()).unwrap_err();
            assert!(matches!(error, LightMapError::Kind { .. }), "{from}: {error}");
        }
        std::fs::write(&path, &whole[..7000]).unwrap();
        let map = LightMap { path, unit: BrightnessUnit::S10, b_v: 0.65 };
        assert!(matches!(map.read().map(|_| ()), Err(LightMapError::Io { .. })));
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
