//! The inverse-square form: each pixel times the square of its distance from the star.
//!
//! The original Godot add-on stores textures in this form, because spikes fall off as 1 / theta^2: here they have
//! constant brightness, and the range of values is small enough to be painted by hand or stored in few bits. The
//! published form is zero at the centre, and the value there is lost. Here the factor is the *mean* of theta^2 over
//! the pixel, the centre's theta^2 plus a sixth of the pixel's angle squared. It is never zero, so the form can be
//! inverted everywhere.
//!
//! **For drawing**, the form is interpolated between the centres of pixels, then divided by theta^2 plus that sixth
//! ([`InverseSquare::density`]). Near the star this differs from interpolation of the texture itself, and its integral
//! is not the star's light; [`InverseSquare::holding_light`] scales each channel so that the integral is the star's
//! light.

use glam::DVec2;
use rayon::prelude::*;

use super::{Psf, bilinear};
use crate::photometry::rec709::luminance;

/// Distance from the star within which the division is steep, pixels.
const STEEP_PX: f64 = 4.0;
/// Numbers of integration points along a side of a pixel, within that distance and beyond it.
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
    /// See [`Psf::covered`].
    pub covered: f64,
}

/// Mean of theta^2 over a pixel, in units of the pixel's angle squared.
fn mean_square_px2(size: u32, index: usize) -> f64 {
    let middle = 0.5 * (f64::from(size) - 1.0);
    let (column, row) = (index as u32 % size, index as u32 / size);
    (f64::from(column) - middle).powi(2) + (f64::from(row) - middle).powi(2) + 1.0 / 6.0
}

impl InverseSquare {
    /// Converts a texture.
    pub fn from_psf(psf: &Psf) -> Self {
        // Share per pixel over the pixel's solid angle, times theta^2: the pixel's angle cancels.
        let rgb = scaled(&psf.rgb, |index| mean_square_px2(psf.size, index));
        Self { size: psf.size, pixel_rad: psf.pixel_rad, rgb, covered: psf.covered }
    }

    /// Converts a texture and scales it for drawing: the integral of [`InverseSquare::density`] over all directions
    /// that it covers is the texture's sum, channel by channel.
    pub fn holding_light(psf: &Psf) -> Self {
        let mut form = Self::from_psf(psf);
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

    /// Term that is added to theta^2 when the form is evaluated: a sixth of the pixel's angle squared.
    pub fn softening_rad2(&self) -> f64 {
        self.pixel_rad * self.pixel_rad / 6.0
    }

    /// The largest luminance in the form: divided by theta^2, it is an upper bound of the density.
    pub fn largest(&self) -> f64 {
        self.rgb.iter().map(|rgb| luminance(rgb.map(f64::from))).fold(0.0, f64::max)
    }

    /// Density of the light per steradian at an angle from the star, x to the right and y up, radians; linear Rec.
    /// 709.
    pub fn density(&self, offset_rad: DVec2) -> [f64; 3] {
        let middle = 0.5 * (f64::from(self.size) - 1.0);
        let position = DVec2::new(middle + offset_rad.x / self.pixel_rad, middle - offset_rad.y / self.pixel_rad);
        let squared = offset_rad.length_squared() + self.softening_rad2();
        bilinear(self.size, &self.rgb, position).map(|channel| channel / squared)
    }

    /// Integral of the density over the directions that the form covers, with the midpoint rule.
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
                    // Ratio of solid angle to area of a cell in the plane of angles around the star.
                    let omega = if theta > 0.0 { theta.sin() / theta } else { 1.0 };
                    let density = self.density(offset);
                    (0..3).for_each(|c| sum[c] += density[c] * omega * cell_sr);
                }
            }
            sum
        });
        // Rows are summed in order, so that the result does not depend on the number of cores.
        let rows: Vec<[f64; 3]> = rows.collect();
        rows.into_iter().fold([0.0; 3], |sum, row| std::array::from_fn(|c| sum[c] + row[c]))
    }

    /// Converts back to a texture.
    pub fn restore(&self) -> Psf {
        let rgb = scaled(&self.rgb, |index| 1.0 / mean_square_px2(self.size, index));
        Psf { size: self.size, pixel_rad: self.pixel_rad, rgb, covered: self.covered }
    }
}

fn scaled(rgb: &[[f32; 3]], factor: impl Fn(usize) -> f64) -> Vec<[f32; 3]> {
    let scale = |(index, pixel): (usize, &[f32; 3])| pixel.map(|channel| (f64::from(channel) * factor(index)) as f32);
    rgb.iter().enumerate().map(scale).collect()
}
