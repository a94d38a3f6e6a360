//! The inverse-square form: each pixel times the square of its distance from the star.
//!
//! The seed stores textures so, because spikes fall off as 1 / theta^2: here they have constant brightness, and the range
//! of values is small enough to be painted by hand or kept in few bits. The published form is zero in the middle, and
//! what was there cannot be got back. Here the factor is the *mean* of theta^2 over the pixel, the centre's theta^2 plus
//! a sixth of the pixel's angle squared, which is nowhere zero: the form can be turned back everywhere.
//!
//! **Drawn with**, the form is read between the centres of pixels: interpolated, then divided by theta^2 plus that sixth
//! ([`InverseSquare::density`]). Next to the star this is not what interpolating the texture itself would give, and its
//! integral is not the star's light; [`InverseSquare::holding_light`] scales each channel so that it is.

use glam::DVec2;
use rayon::prelude::*;

use super::{Psf, bilinear};
use crate::photometry::rec709::luminance;

/// Pixels from the star within which the division is steep.
const STEEP_PX: f64 = 4.0;
/// Points along a side of a pixel that the integral takes there, and elsewhere.
const POINTS: [u32; 2] = [16, 4];

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

    /// The form of a texture, scaled to be drawn with: the integral of [`InverseSquare::density`] over all directions that
    /// it covers is the texture's own sum, channel by channel.
    pub fn holding_light(psf: &Psf) -> Self {
        let mut form = Self::of(psf);
        let (wanted, found) = (psf.sum(), form.light());
        let factors: [f64; 3] = std::array::from_fn(|c| if found[c] > 0.0 { wanted[c] / found[c] } else { 0.0 });
        for rgb in &mut form.rgb {
            *rgb = std::array::from_fn(|c| (f64::from(rgb[c]) * factors[c]) as f32);
        }
        form
    }

    /// Angle from the star to the texture's edge, radians.
    pub fn half_width_rad(&self) -> f64 {
        0.5 * f64::from(self.size) * self.pixel_rad
    }

    /// What is added to theta^2 where the form is read: a sixth of the pixel's angle squared.
    pub fn softening_rad2(&self) -> f64 {
        self.pixel_rad * self.pixel_rad / 6.0
    }

    /// The largest luminance in the form: with theta^2 under it no density is larger.
    pub fn largest(&self) -> f64 {
        self.rgb.iter().map(|rgb| luminance(rgb.map(f64::from))).fold(0.0, f64::max)
    }

    /// Density of the light per steradian at an angle from the star, x to the right and y up, radians; linear Rec. 709.
    pub fn density(&self, offset_rad: DVec2) -> [f64; 3] {
        let middle = 0.5 * (f64::from(self.size) - 1.0);
        let at = DVec2::new(middle + offset_rad.x / self.pixel_rad, middle - offset_rad.y / self.pixel_rad);
        let squared = offset_rad.length_squared() + self.softening_rad2();
        bilinear(self.size, &self.rgb, at).map(|channel| channel / squared)
    }

    /// Integral of the density over the directions that the form covers, by midpoints.
    fn light(&self) -> [f64; 3] {
        let middle = 0.5 * f64::from(self.size);
        let rows = (0..self.size).into_par_iter().map(|row| {
            let mut sum = [0.0; 3];
            for column in 0..self.size {
                let corner = DVec2::new(f64::from(column), f64::from(row)) - middle;
                let points = POINTS[usize::from(corner.abs().max_element() >= STEEP_PX)];
                let cell_sr = (self.pixel_rad / f64::from(points)).powi(2);
                for point in 0..points * points {
                    let part = DVec2::new(f64::from(point % points), f64::from(point / points)) + 0.5;
                    let offset = (corner + part / f64::from(points)) * DVec2::new(1.0, -1.0) * self.pixel_rad;
                    let theta = offset.length();
                    // A cell of the plane of angles about the star has this solid angle over its area.
                    let omega = if theta > 0.0 { theta.sin() / theta } else { 1.0 };
                    let density = self.density(offset);
                    (0..3).for_each(|c| sum[c] += density[c] * omega * cell_sr);
                }
            }
            sum
        });
        // Rows are summed in order, so that the result is the same on any number of cores.
        let rows: Vec<[f64; 3]> = rows.collect();
        rows.into_iter().fold([0.0; 3], |sum, row| std::array::from_fn(|c| sum[c] + row[c]))
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
