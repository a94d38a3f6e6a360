//! The inverse-square form: each pixel times the square of its distance from the star.
//!
//! The seed stores textures so, because spikes fall off as 1 / theta^2: here they have constant brightness, and the range
//! of values is small enough to be painted by hand or kept in few bits. The published form is zero in the middle, and
//! what was there cannot be got back. Here the factor is the *mean* of theta^2 over the pixel, the centre's theta^2 plus
//! a sixth of the pixel's angle squared, which is nowhere zero: the form can be turned back everywhere.

use super::Psf;

/// A point-spread function in inverse-square form.
#[derive(Clone, Debug, PartialEq)]
pub struct InverseSquare {
    /// Pixels along a side.
    pub size: u32,
    /// Angle of a pixel, radians.
    pub pixel_rad: f64,
    /// Density per steradian times theta^2 in linear Rec. 709, row by row from the top: no unit.
    pub rgb: Vec<[f32; 3]>,
    /// As [`Psf::covered`].
    pub covered: f64,
}

/// Mean of theta^2 over a pixel, in units of the pixel's angle squared.
fn mean_square_px2(size: u32, index: usize) -> f64 {
    let middle = 0.5 * (f64::from(size) - 1.0);
    let (column, row) = (index as u32 % size, index as u32 / size);
    (f64::from(column) - middle).powi(2) + (f64::from(row) - middle).powi(2) + 1.0 / 6.0
}

impl InverseSquare {
    /// The form of a texture.
    pub fn of(psf: &Psf) -> Self {
        // Share per pixel over the pixel's solid angle, times theta^2: the pixel's angle cancels.
        let rgb = scaled(&psf.rgb, |index| mean_square_px2(psf.size, index));
        Self { size: psf.size, pixel_rad: psf.pixel_rad, rgb, covered: psf.covered }
    }

    /// The texture again.
    pub fn restore(&self) -> Psf {
        let rgb = scaled(&self.rgb, |index| 1.0 / mean_square_px2(self.size, index));
        Psf { size: self.size, pixel_rad: self.pixel_rad, rgb, covered: self.covered }
    }
}

fn scaled(rgb: &[[f32; 3]], factor: impl Fn(usize) -> f64) -> Vec<[f32; 3]> {
    let scale = |(index, pixel): (usize, &[f32; 3])| pixel.map(|channel| (f64::from(channel) * factor(index)) as f32);
    rgb.iter().enumerate().map(scale).collect()
}
