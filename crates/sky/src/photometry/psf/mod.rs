//! Point-spread functions: the picture of a star that an optical system forms.
//!
//! [`Psf::from_aperture`] computes one by diffraction (`aperture`, `diffraction`, `spectrum`). [`read`] and
//! [`write_exr`] exchange them with other programs (`exr_file`, `fits`). [`InverseSquare`] is the form in which
//! spikes have constant brightness. [`CropRule`] gives the part of the picture that a star of some brightness needs
//! (`crop`).
//!
//! A texture is square, x to the right, y up, rows from the top, the star at its centre (between the four central
//! pixels if its size is even). A value is the share of the star's light in that pixel, so values divided by the
//! pixel's solid angle are a density per steradian. The original Godot add-on uses textures without a unit; here the
//! light of a pixel follows from the star's illuminance.
//!
//! **Sums.** The sum of Y over the texture is 1, hence a star drawn with it keeps its light. The sums of the channels
//! ([`Psf::sum`]) are the colour of the star for which the texture was computed. [`Psf::balanced_to_white`] makes
//! each of them 1, for stars of every colour: multiplied by a star's illuminance in R, G and B, the texture keeps all
//! three.

mod aperture;
mod crop;
mod diffraction;
mod exr_file;
mod fits;
mod inverse_square;
mod read;
mod spectrum;

use std::io;
use std::path::PathBuf;

use glam::DVec2;
use thiserror::Error;

pub use aperture::{Aperture, BLADES};
pub use crop::{CropRule, crop_half_angle_rad};
pub use diffraction::{MAX_TRANSFORM, PADDING};
pub use exr_file::write_exr;
pub use inverse_square::InverseSquare;
pub use read::{Loaded, read, read_as_wide};
pub use spectrum::MAX_WAVELENGTHS;

use super::rec709::luminance;

/// Radians in an arcsecond.
pub const ARCSECOND_RAD: f64 = std::f64::consts::PI / 648_000.0;

/// Sizes of textures, pixels along a side.
pub const SIZES: std::ops::RangeInclusive<u32> = 2..=4096;

/// Diameters of apertures, millimetres.
pub const DIAMETERS_MM: std::ops::RangeInclusive<f64> = 0.01..=100_000.0;

/// Temperatures of the star whose light is diffracted, kelvin.
pub const TEMPERATURES_K: std::ops::RangeInclusive<f64> = 500.0..=1e6;

/// Widest texture, radians: beyond it angles and their tangents differ by more than 1 %, and Fraunhofer's formula is
/// inaccurate.
pub const MAX_WIDTH_RAD: f64 = 0.35;

/// Temperature of the black body whose light is closest to the display's white D65, kelvin.
pub const WHITE_K: f64 = 6504.0;

/// Errors from making, reading or writing a point-spread function.
#[derive(Debug, Error)]
pub enum PsfError {
    /// A parameter is out of range.
    #[error("{name} = {value}: must be {allowed}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: String,
        /// Its valid values.
        allowed: String,
    },
    /// Pixels are too coarse for the detail of the picture.
    #[error(
        "a pixel is {needed_steps} steps of half a fringe wide, which needs a transform of {transform} samples; it \
         must be at most {MAX_TRANSFORM} ({allowed_steps} steps at this size): choose a smaller pixel, size or diameter"
    )]
    TooFine {
        /// Number of samples that the transform would need.
        transform: f64,
        /// Number of steps per pixel that this size allows.
        allowed_steps: f64,
        /// Number of steps per pixel that are needed.
        needed_steps: f64,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file does not contain a usable point-spread function.
    #[error("{}: {problem}; must be {allowed}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        problem: String,
        /// Description of a valid file.
        allowed: &'static str,
    },
    /// Neither the file nor the caller gives the angle of its pixels.
    #[error("{}: no pixel scale in the header ({looked_for}); give it in arcseconds", path.display())]
    NoScale {
        /// The file.
        path: PathBuf,
        /// Names of the header entries that give it.
        looked_for: &'static str,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A texture cannot be encoded.
    #[error("cannot encode {}: {source}", path.display())]
    Encode {
        /// The destination file.
        path: PathBuf,
        /// The encoder's error.
        source: exr::error::Error,
    },
}

/// A point-spread function.
#[derive(Clone, Debug, PartialEq)]
pub struct Psf {
    /// Pixels along a side.
    pub size: u32,
    /// Angle of a pixel, radians.
    pub pixel_rad: f64,
    /// Share of the light in each pixel in linear Rec. 709, row by row from the top, never negative; the sum of Y is 1.
    pub rgb: Vec<[f32; 3]>,
    /// Share of all light that falls into the texture, before its sum was made 1; 1 if unknown.
    pub covered: f64,
}

/// Parameters of a diffraction picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// The aperture.
    pub aperture: Aperture,
    /// Diameter of the aperture's enclosing circle, millimetres, in [`DIAMETERS_MM`].
    pub diameter_mm: f64,
    /// Pixels along a side of the texture, in [`SIZES`].
    pub size: u32,
    /// Angle of a pixel, radians; the texture is at most [`MAX_WIDTH_RAD`] wide.
    pub pixel_rad: f64,
    /// Number of wavelengths, 1 to [`MAX_WAVELENGTHS`]. If there are few, fringes far from the centre do not merge.
    pub wavelengths: usize,
    /// Temperature of the star, kelvin, in [`TEMPERATURES_K`].
    pub temperature_k: f64,
}

impl Optics {
    /// A pixel that resolves every fringe in green: a quarter of lambda / D at 550 nm, radians.
    pub fn fine_pixel_rad(diameter_mm: f64) -> f64 {
        0.25 * 550e-9 / (1e-3 * diameter_mm)
    }

    /// Checks whether a picture can be computed.
    ///
    /// # Errors
    /// [`PsfError::Parameter`] for a value outside its range, [`PsfError::TooFine`] for pixels too coarse for the
    /// detail of the picture.
    pub fn check(&self) -> Result<(), PsfError> {
        self.sampling().map(|_| ())
    }

    fn sampling(&self) -> Result<diffraction::Sampling, PsfError> {
        let refuse = |name, value: String, allowed| Err(PsfError::Parameter { name, value, allowed });
        let range = |range: &std::ops::RangeInclusive<f64>| format!("between {} and {}", range.start(), range.end());
        if !DIAMETERS_MM.contains(&self.diameter_mm) {
            return refuse("diameter in mm", self.diameter_mm.to_string(), range(&DIAMETERS_MM));
        }
        if !SIZES.contains(&self.size) {
            return refuse(
                "size in pixels",
                self.size.to_string(),
                format!("between {} and {}", SIZES.start(), SIZES.end()),
            );
        }
        let width_rad = self.pixel_rad * f64::from(self.size);
        if !(self.pixel_rad > 0.0 && width_rad <= MAX_WIDTH_RAD) {
            let largest = MAX_WIDTH_RAD / f64::from(self.size) / ARCSECOND_RAD;
            let allowed = format!("more than 0, at most {largest:.3} at this size");
            return refuse("pixel in arcseconds", (self.pixel_rad / ARCSECOND_RAD).to_string(), allowed);
        }
        if !(1..=MAX_WAVELENGTHS).contains(&self.wavelengths) {
            return refuse("wavelengths", self.wavelengths.to_string(), format!("between 1 and {MAX_WAVELENGTHS}"));
        }
        if !TEMPERATURES_K.contains(&self.temperature_k) {
            return refuse("temperature in K", self.temperature_k.to_string(), range(&TEMPERATURES_K));
        }
        if let Aperture::CurvedBlades { blades } = self.aperture
            && !BLADES.contains(&blades)
        {
            return refuse("blades", blades.to_string(), format!("between {} and {}", BLADES.start(), BLADES.end()));
        }
        let shortest_m = spectrum::lines(self.temperature_k, self.wavelengths)
            .iter()
            .map(|line| line.wavelength_m)
            .fold(f64::INFINITY, f64::min);
        diffraction::Sampling::new(self.size as usize, self.pixel_rad, 1e-3 * self.diameter_mm, shortest_m)
    }
}

impl Psf {
    /// Computes the diffraction picture of a star. `progress` receives the number of wavelengths done and their
    /// total.
    pub fn from_aperture(optics: &Optics, mut progress: impl FnMut(usize, usize)) -> Result<Self, PsfError> {
        let sampling = optics.sampling()?;
        let size = optics.size as usize;
        let diameter_m = 1e-3 * optics.diameter_mm;
        let lines = spectrum::lines(optics.temperature_k, optics.wavelengths);
        let mut xyz = vec![[0.0; 3]; size * size];
        for (done, line) in lines.iter().enumerate() {
            progress(done, lines.len());
            let share = diffraction::monochromatic(optics.aperture, diameter_m, line.wavelength_m, &sampling);
            for (pixel, share) in xyz.iter_mut().zip(share) {
                (0..3).for_each(|c| pixel[c] += line.xyz[c] * share);
            }
        }
        progress(lines.len(), lines.len());
        let covered: f64 = xyz.iter().map(|pixel| pixel[1]).sum();
        let rgb = xyz.into_iter().map(spectrum::rec709_keeping_luminance).collect();
        Ok(Self::normalised(optics.size, optics.pixel_rad, rgb, covered))
    }

    /// Makes a texture and scales the sum of Y to 1. The sum must be positive and finite.
    fn normalised(size: u32, pixel_rad: f64, rgb: Vec<[f64; 3]>, covered: f64) -> Self {
        let total: f64 = rgb.iter().map(|pixel| luminance(*pixel)).sum();
        let rgb = rgb.into_iter().map(|pixel| pixel.map(|channel| (channel / total) as f32)).collect();
        Self { size, pixel_rad, rgb, covered }
    }

    /// Share of the light in a pixel, linear Rec. 709.
    pub fn pixel(&self, column: u32, row: u32) -> [f64; 3] {
        self.rgb[row as usize * self.size as usize + column as usize].map(f64::from)
    }

    /// Angle from the star to a pixel's centre, radians, x to the right and y up.
    pub fn offset_rad(&self, column: u32, row: u32) -> DVec2 {
        let middle = 0.5 * (f64::from(self.size) - 1.0);
        DVec2::new(f64::from(column) - middle, middle - f64::from(row)) * self.pixel_rad
    }

    /// Angle from the star to the texture's edge, radians.
    pub fn half_width_rad(&self) -> f64 {
        0.5 * f64::from(self.size) * self.pixel_rad
    }

    /// Sums of the channels.
    pub fn sum(&self) -> [f64; 3] {
        self.rgb.iter().fold([0.0; 3], |sum, pixel| std::array::from_fn(|c| sum[c] + f64::from(pixel[c])))
    }

    /// The texture with each channel's sum scaled to 1, for stars of every colour. A channel without light gets that
    /// of Y.
    pub fn balanced_to_white(&self) -> Self {
        let sum = self.sum();
        let rgb = self.rgb.iter().map(|pixel| {
            let y = luminance(pixel.map(f64::from));
            std::array::from_fn(|c| if sum[c] > 0.0 { (f64::from(pixel[c]) / sum[c]) as f32 } else { y as f32 })
        });
        Self { rgb: rgb.collect(), ..self.clone() }
    }

    /// Density of the light per steradian at an angle from the star, linear Rec. 709: bilinear between the centres of
    /// pixels, falling to 0 beyond the edge. Its integral is [`Psf::sum`]. The luminance of a star of illuminance E
    /// there is E times this.
    pub fn sample(&self, offset_rad: DVec2) -> [f64; 3] {
        let middle = 0.5 * (f64::from(self.size) - 1.0);
        let position = DVec2::new(middle + offset_rad.x / self.pixel_rad, middle - offset_rad.y / self.pixel_rad);
        bilinear(self.size, &self.rgb, position).map(|channel| channel / (self.pixel_rad * self.pixel_rad))
    }

    /// Share of the texture's Y within `radius_rad` of the star; pixels on the rim count by the part that is inside.
    /// Times [`Psf::covered`] it is the share of all light.
    pub fn encircled_energy(&self, radius_rad: f64) -> f64 {
        const SUBSAMPLES: usize = 16;
        let half_diagonal = std::f64::consts::FRAC_1_SQRT_2 * self.pixel_rad;
        self.places()
            .map(|(offset, rgb)| {
                let y = luminance(rgb);
                let distance = offset.length() - radius_rad;
                if distance.abs() >= half_diagonal {
                    return if distance < 0.0 { y } else { 0.0 };
                }
                let step = |i: usize| ((i as f64 + 0.5) / SUBSAMPLES as f64 - 0.5) * self.pixel_rad;
                let inside = (0..SUBSAMPLES * SUBSAMPLES)
                    .filter(|i| (offset + DVec2::new(step(i % SUBSAMPLES), step(i / SUBSAMPLES))).length() < radius_rad)
                    .count();
                y * inside as f64 / (SUBSAMPLES * SUBSAMPLES) as f64
            })
            .sum()
    }

    /// Iterates over all pixels: the angle of the centre and the share of the light.
    pub fn places(&self) -> impl Iterator<Item = (DVec2, [f64; 3])> {
        self.rgb.iter().enumerate().map(|(index, rgb)| {
            let (column, row) = (index as u32 % self.size, index as u32 / self.size);
            (self.offset_rad(column, row), rgb.map(f64::from))
        })
    }
}

/// Bilinear interpolation in a square image with pixel centres at integers; black outside.
pub(super) fn bilinear(size: u32, rgb: &[[f32; 3]], position: DVec2) -> [f64; 3] {
    let (first, part) = (position.floor(), position - position.floor());
    let mut sum = [0.0; 3];
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (column, row) = (first.x + dx, first.y + dy);
        let last = f64::from(size) - 1.0;
        // Written so that NaN fails too.
        if !((0.0..=last).contains(&column) && (0.0..=last).contains(&row)) {
            continue;
        }
        let weight = (1.0 - (part.x - dx).abs()) * (1.0 - (part.y - dy).abs());
        let pixel = rgb[row as usize * size as usize + column as usize];
        (0..3).for_each(|c| sum[c] += weight * f64::from(pixel[c]));
    }
    sum
}

#[cfg(test)]
mod tests;
