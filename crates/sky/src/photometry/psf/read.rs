//! Reader of point-spread functions made by other programs: OpenEXR or FITS, recognised by their first bytes.

use std::path::Path;

use glam::DVec2;

use super::{ARCSECOND_RAD, MAX_WIDTH_RAD, Psf, PsfError, SIZES, exr_file, fits};
use crate::{files, photometry::rec709::luminance};

/// Largest file of a point-spread function, bytes.
const MOST_BYTES: u64 = 1 << 30;

const ALLOWED: &str = "an OpenEXR file or a FITS file with a square image of finite values";

/// A picture as stored in a file.
pub(super) struct Plane {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue, row by row from the top.
    pub values: Vec<[f64; 3]>,
    /// Angle of a pixel, if the header has it.
    pub pixel_arcsec: Option<f64>,
    /// See [`Psf::covered`].
    pub covered: f64,
}

/// A point-spread function from a file, with the corrections that were made.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The texture, with its sum of Y scaled to 1.
    pub psf: Psf,
    /// Number of negative pixels (the noise of a measurement) that were set to 0.
    pub negative_pixels: usize,
    /// Position of the brightest pixel relative to the centre of the picture: pixels to the right and up. The centre
    /// is used as the star's position in any case.
    pub peak_offset_px: DVec2,
}

/// Reads an OpenEXR or FITS file. `pixel_arcsec` is the angle of a pixel; if it is missing, the header must give it.
pub fn read(path: &Path, pixel_arcsec: Option<f64>) -> Result<Loaded, PsfError> {
    let (plane, looked_for) = decode(path)?;
    let no_scale = PsfError::NoScale { path: path.to_owned(), looked_for };
    let pixel_arcsec = pixel_arcsec.or(plane.pixel_arcsec).ok_or(no_scale)?;
    loaded(path, plane, pixel_arcsec)
}

/// Reads an OpenEXR or FITS file; if its header does not give the angle of a pixel, the picture is `width_rad` wide.
pub fn read_as_wide(path: &Path, width_rad: f64) -> Result<Loaded, PsfError> {
    let (plane, _) = decode(path)?;
    let pixel_arcsec = plane.pixel_arcsec.unwrap_or(width_rad / ARCSECOND_RAD / plane.width as f64);
    loaded(path, plane, pixel_arcsec)
}

/// Decodes the picture in a file; also returns the header entries that would give the angle of a pixel.
fn decode(path: &Path) -> Result<(Plane, &'static str), PsfError> {
    let bytes =
        files::read_bounded(path, MOST_BYTES).map_err(|source| PsfError::Read { path: path.to_owned(), source })?;
    // OpenEXR's magic number 20000630; the first card of every FITS file.
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        Ok((exr_file::decode(path, &bytes)?, exr_file::SCALE))
    } else if bytes.starts_with(b"SIMPLE  =") {
        Ok((fits::decode(path, &bytes)?, fits::SCALES))
    } else {
        let problem = "neither OpenEXR nor FITS by its first bytes".to_owned();
        Err(PsfError::File { path: path.to_owned(), problem, allowed: ALLOWED })
    }
}

/// Returns the size of a picture if it can be a point-spread function, otherwise the problem. Called before pixels
/// are allocated: a header may announce any size.
pub(super) fn checked_size(width: usize, height: usize) -> Result<u32, String> {
    u32::try_from(width)
        .ok()
        .filter(|size| width == height && SIZES.contains(size))
        .ok_or_else(|| format!("{width} x {height} pixels; must be a square of {} to {}", SIZES.start(), SIZES.end()))
}

fn loaded(path: &Path, plane: Plane, pixel_arcsec: f64) -> Result<Loaded, PsfError> {
    let bad = |problem: String| PsfError::File { path: path.to_owned(), problem, allowed: ALLOWED };
    let Plane { width, height, mut values, covered, .. } = plane;
    let size = checked_size(width, height).map_err(bad)?;
    let pixel_rad = pixel_arcsec * ARCSECOND_RAD;
    if !(pixel_rad > 0.0 && pixel_rad * f64::from(size) <= MAX_WIDTH_RAD) {
        let most = MAX_WIDTH_RAD / f64::from(size) / ARCSECOND_RAD;
        return Err(bad(format!("pixels of {pixel_arcsec} arcseconds; must be more than 0 and at most {most:.3}")));
    }
    if let Some(index) = values.iter().position(|rgb| rgb.iter().any(|channel| !channel.is_finite())) {
        return Err(bad(format!("column {} of row {} (from 0) is not finite", index % width, index / width)));
    }
    let mut negative_pixels = 0;
    for rgb in &mut values {
        if rgb.iter().any(|channel| *channel < 0.0) {
            negative_pixels += 1;
            *rgb = rgb.map(|channel| channel.max(0.0));
        }
    }
    let total: f64 = values.iter().map(|rgb| luminance(*rgb)).sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(bad(format!("the sum over all pixels is {total}")));
    }
    let brightest = values
        .iter()
        .enumerate()
        .max_by(|a, b| luminance(*a.1).total_cmp(&luminance(*b.1)))
        .map_or(0, |(index, _)| index);
    let psf = Psf::normalised(size, pixel_rad, values, covered);
    let peak = psf.offset_rad(brightest as u32 % size, brightest as u32 / size);
    Ok(Loaded { peak_offset_px: peak / pixel_rad, psf, negative_pixels })
}
