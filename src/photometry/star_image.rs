//! Images of a single star, for billboards that carry one: a drawn sprite, and the image of a point-spread function in the
//! form in which `psf_texture` stores it.
//!
//! A point-spread function spans so many magnitudes that it is stored times the square of the angle from its centre: what
//! falls off with the inverse square (diffraction spikes) becomes constant. Reading divides again by the square, held from
//! half a texel on. Source of the transform: "Rendering star fields in 3D". Units: rad, shares of a star's light per sr.

use std::f64::consts::PI;

use super::rec709::luminance;

/// Texels along a side of the sprite that is drawn.
pub const SPRITE_SIZE: usize = 64;

/// Texels along a side of the built-in point-spread function.
pub const BUILT_IN_PSF_SIZE: usize = 512;

/// A point-spread function: which share of a star's light each pixel of a square image gets.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfImage {
    /// Pixels along each side.
    pub size: usize,
    /// Angle of a pixel, rad.
    pub pixel_rad: f64,
    /// Share of the light in linear Rec. 709, row by row from the top; only the ratios count.
    pub rgb: Vec<[f32; 3]>,
}

/// A square image of a star, as billboards read it.
#[derive(Clone, Debug, PartialEq)]
pub struct StarImage {
    /// Texels along each side.
    pub size: usize,
    /// Linear Rec. 709, row by row from the top.
    pub rgb: Vec<[f32; 3]>,
}

impl StarImage {
    /// The image at `(x, y)` in texels, whose centres are at +0.5, with bilinear interpolation; black outside.
    pub fn sample(&self, x: f64, y: f64) -> [f64; 3] {
        let (first_x, first_y) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (part_x, part_y) = (x - 0.5 - first_x, y - 0.5 - first_y);
        let mut sum = [0.0; 3];
        for (j, weight_y) in [(0, 1.0 - part_y), (1, part_y)] {
            for (i, weight_x) in [(0, 1.0 - part_x), (1, part_x)] {
                let (column, row) = (first_x as i64 + i, first_y as i64 + j);
                let inside = |at: i64| usize::try_from(at).ok().filter(|at| *at < self.size);
                let (Some(column), Some(row)) = (inside(column), inside(row)) else { continue };
                for (sum, texel) in sum.iter_mut().zip(self.rgb[row * self.size + column]) {
                    *sum += weight_x * weight_y * f64::from(texel);
                }
            }
        }
        sum
    }
}

/// A white star with four rays, drawn by formula, whose mean over the square is 1.
pub fn sprite(size: usize) -> StarImage {
    let half = size as f64 / 2.0;
    let values: Vec<f64> = (0..size * size)
        .map(|index| {
            let x = (((index % size) as f64 + 0.5) / half - 1.0).abs();
            let y = (((index / size) as f64 + 0.5) / half - 1.0).abs();
            let r2 = x * x + y * y;
            let core = (-r2 / (2.0 * 0.12 * 0.12)).exp();
            let rays = 0.25 * ((-(x / 0.03).powi(2) - 3.0 * y).exp() + (-(y / 0.03).powi(2) - 3.0 * x).exp());
            // Black where the square ends.
            (core + rays + 0.05 / (1.0 + 40.0 * r2)) * (1.0 - r2.sqrt()).max(0.0)
        })
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    StarImage { size, rgb: values.iter().map(|value| [(value / mean) as f32; 3]).collect() }
}

/// The point-spread function of a small reflector by formula, as wide as `width_rad`: a bright core with faint rings, and
/// four spikes that fall off with the inverse square; red light is spread a little wider than blue.
pub fn built_in_psf(size: usize, width_rad: f64) -> PsfImage {
    let middle = size as f64 / 2.0;
    // Wavelengths of the three channels over the middle one.
    let rgb = (0..size * size).map(|index| {
        let (x, y) = ((index % size) as f64 + 0.5 - middle, (index / size) as f64 + 0.5 - middle);
        [1.11, 1.0, 0.84].map(|wavelength: f64| {
            let r = x.hypot(y) / wavelength;
            // The rings of a round aperture fall off with the third power: their envelope, with a ripple.
            let core = (1.0 + 0.5 * (2.0 * r).cos() * r / (1.0 + r)) / (1.0 + (r / 1.2).powi(3));
            let spike = |along: f64, across: f64| (-(across / 0.9).powi(2)).exp() / (along * along + 4.0);
            ((core + 0.35 * (spike(x, y) + spike(y, x))) / (wavelength * wavelength)) as f32
        })
    });
    PsfImage { size, pixel_rad: width_rad / size as f64, rgb: rgb.collect() }
}

/// A point-spread function in the form in which billboards store it.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredPsf {
    /// Share of the light per sr times the square of the angle from the centre in rad (at least of half a texel).
    pub image: StarImage,
    /// Angle of a texel, rad.
    pub texel_rad: f64,
    /// Greatest luminance among the texels of `image`: with the square of the angle under it no share per sr is greater.
    pub greatest: f64,
}

impl StoredPsf {
    /// Half of the angle that the image covers, rad.
    pub fn half_width_rad(&self) -> f64 {
        0.5 * self.image.size as f64 * self.texel_rad
    }

    /// Share of the light per sr at angles to the right and up, rad.
    pub fn share_per_sr(&self, right_rad: f64, up_rad: f64) -> [f64; 3] {
        let middle = 0.5 * self.image.size as f64;
        let stored = self.image.sample(middle + right_rad / self.texel_rad, middle - up_rad / self.texel_rad);
        let squared = (right_rad * right_rad + up_rad * up_rad).max(0.25 * self.texel_rad * self.texel_rad);
        stored.map(|channel| channel / squared)
    }
}

/// Brings a point-spread function to the stored form. Each channel is scaled so that what is read back, interpolation
/// included, holds the whole light: 1 over all directions that the image covers.
pub fn inverse_square_form(psf: &PsfImage) -> StoredPsf {
    let size = psf.size;
    let middle = size as f64 / 2.0;
    let rgb = psf
        .rgb
        .iter()
        .enumerate()
        .map(|(index, rgb)| {
            let (x, y) = ((index % size) as f64 + 0.5 - middle, (index / size) as f64 + 0.5 - middle);
            let squared = (x * x + y * y).max(0.25) * psf.pixel_rad * psf.pixel_rad;
            rgb.map(|channel| (f64::from(channel) * squared) as f32)
        })
        .collect();
    let mut stored = StoredPsf { image: StarImage { size, rgb }, texel_rad: psf.pixel_rad, greatest: 0.0 };
    // Four points each way in a texel; around the centre, where the division is steep, sixteen.
    let mut sums = [0.0; 3];
    for index in 0..size * size {
        let (x, y) = ((index % size) as f64 - middle, (index / size) as f64 - middle);
        let parts = if x.abs().max(y.abs()) < 4.0 { 16 } else { 4 };
        let cell_sr = (psf.pixel_rad / f64::from(parts)).powi(2);
        for part in 0..parts * parts {
            let at = |cell: f64, part: u32| (cell + (f64::from(part) + 0.5) / f64::from(parts)) * psf.pixel_rad;
            let (right, down) = (at(x, part % parts), at(y, part / parts));
            let theta = right.hypot(down);
            // Solid angle of a cell of the plane of angles.
            let omega = cell_sr * if theta > 0.0 { (theta.min(PI)).sin() / theta } else { 1.0 };
            for (sum, share) in sums.iter_mut().zip(stored.share_per_sr(right, -down)) {
                *sum += share * omega;
            }
        }
    }
    for texel in &mut stored.image.rgb {
        for (channel, sum) in texel.iter_mut().zip(sums) {
            *channel = (f64::from(*channel) / sum) as f32;
        }
    }
    stored.greatest = stored.image.rgb.iter().map(|rgb| luminance(rgb.map(f64::from))).fold(0.0, f64::max);
    stored
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sprite_has_the_mean_one() {
        let image = sprite(64);
        let mean = image.rgb.iter().map(|rgb| f64::from(rgb[1])).sum::<f64>() / 4096.0;
        assert!((mean - 1.0).abs() < 1e-6, "{mean}");
        assert!(image.sample(32.0, 32.0)[0] > 10.0 && image.sample(0.5, 0.5)[0] == 0.0);
        assert_eq!(image.sample(-3.0, 5.0), [0.0; 3]);
    }

    /// Simpson's rule over the picture, with steps that do not divide those of the normalisation.
    #[test]
    fn what_is_read_back_holds_all_the_light() {
        let stored = inverse_square_form(&built_in_psf(96, 0.2));
        let half = stored.half_width_rad();
        assert!((half - 0.1).abs() < 1e-12);
        let steps = 2400;
        let step = 2.0 * half / f64::from(steps);
        let mut sum = [0.0; 3];
        for j in 0..steps {
            for i in 0..steps {
                let at = |k: i32| (f64::from(k) + 0.5) * step - half;
                let theta = at(i).hypot(at(j));
                for (sum, share) in sum.iter_mut().zip(stored.share_per_sr(at(i), at(j))) {
                    *sum += share * step * step * theta.sin() / theta;
                }
            }
        }
        println!("light of the built-in point-spread function: {sum:.5?}");
        assert!(sum.iter().all(|sum| (sum - 1.0).abs() < 1e-3), "{sum:?}");
        // The stored form itself, divided by nothing, does not.
        let texel_sr = stored.texel_rad * stored.texel_rad;
        assert!(stored.image.rgb.iter().map(|rgb| f64::from(rgb[1]) * texel_sr).sum::<f64>() < 0.5);
    }

    #[test]
    fn spikes_are_constant_in_the_stored_form() {
        let stored = inverse_square_form(&built_in_psf(256, 0.1));
        let along = |texels: f64| stored.image.sample(128.0 + texels, 128.5)[1];
        // What the core still adds there falls off with the third power.
        assert!((along(100.5) / along(50.5) - 1.0).abs() < 0.1, "{} {}", along(100.5), along(50.5));
        // Beside the spikes it falls off faster.
        let diagonal = |texels: f64| stored.image.sample(128.0 + texels, 128.0 + texels)[1];
        assert!(diagonal(70.5) < 0.7 * diagonal(35.5));
    }
}
