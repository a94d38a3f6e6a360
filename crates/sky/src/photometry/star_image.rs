//! The star image of the method `sprite`.

use glam::DVec2;

use super::psf::bilinear;

/// Texels along a side of the generated sprite.
pub const SPRITE_SIZE: u32 = 64;

/// A square image of a star, in the form that billboards read.
#[derive(Clone, Debug, PartialEq)]
pub struct StarImage {
    /// Texels along each side.
    pub size: u32,
    /// Linear Rec. 709, row by row from the top.
    pub rgb: Vec<[f32; 3]>,
}

impl StarImage {
    /// Bilinear value at `(x, y)` in texels, whose centres are at +0.5; black outside.
    pub fn sample(&self, x: f64, y: f64) -> [f64; 3] {
        bilinear(self.size, &self.rgb, DVec2::new(x, y) - 0.5)
    }
}

/// Generates a white star with four rays; its mean over the square is 1.
pub fn sprite(size: u32) -> StarImage {
    let half = f64::from(size) / 2.0;
    let values: Vec<f64> = (0..size * size)
        .map(|index| {
            let x = ((f64::from(index % size) + 0.5) / half - 1.0).abs();
            let y = ((f64::from(index / size) + 0.5) / half - 1.0).abs();
            let r2 = x * x + y * y;
            let core = (-r2 / (2.0 * 0.12 * 0.12)).exp();
            let rays = 0.25 * ((-(x / 0.03).powi(2) - 3.0 * y).exp() + (-(y / 0.03).powi(2) - 3.0 * x).exp());
            // Black at the edge of the square.
            (core + rays + 0.05 / (1.0 + 40.0 * r2)) * (1.0 - r2.sqrt()).max(0.0)
        })
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    StarImage { size, rgb: values.iter().map(|value| [(value / mean) as f32; 3]).collect() }
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
}
