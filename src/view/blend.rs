//! Blending of projectors: where their pictures overlap, each gives a share of the light, and where only one shines black is lifted to the level of several.
//!
//! Shares are of linear light. A display image is blended after tone mapping and rounding to 8 bits, before it leaves the renderer: light is multiplied by at most
//! one, so the first rounding is at most half a code of the result, as the second one is.

use std::sync::OnceLock;

use glam::DVec2;
use rayon::prelude::*;

use crate::photometry::tone_map::{light_of_codes, linear_from_srgb};

/// Shares of light over a raster.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    size: [u32; 2],
    /// Factor on the light (alpha) and black level (beta) of each pixel, row by row from the top: shown is `L * alpha * (1 - beta) + beta`, as shares of white.
    weights: Vec<[f32; 2]>,
}

/// Values of 0 to 1 on a raster of their own, in linear light, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Weights<'a> {
    /// Width and height.
    pub size: [usize; 2],
    /// As many.
    pub values: &'a [f32],
}

/// Why weights make no blend.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{mask}: {problem}")]
pub struct BlendError {
    /// `alpha` or `beta`.
    pub mask: &'static str,
    /// What is wrong.
    pub problem: String,
}

impl Blend {
    /// Over a raster of `size` pixels; a mask of another size is stretched over it, linear between the middles of its pixels. `None`: alpha 1, beta 0.
    ///
    /// # Errors
    ///
    /// A mask is empty, has not as many values as its size, or one outside of 0 to 1.
    pub fn new(size: [u32; 2], alpha: Option<Weights<'_>>, beta: Option<Weights<'_>>) -> Result<Self, BlendError> {
        for (mask, weights) in [("alpha", alpha), ("beta", beta)] {
            let Some(Weights { size: [width, height], values }) = weights else { continue };
            let wrong = |problem: String| Err(BlendError { mask, problem });
            if width == 0 || height == 0 || values.len() != width * height {
                return wrong(format!("{width} x {height} pixels with {} values", values.len()));
            }
            if let Some(at) = values.iter().position(|value| !(0.0..=1.0).contains(value)) {
                return wrong(format!("pixel ({}, {}) has {}: allowed are 0 to 1", at % width, at / width, values[at]));
            }
        }
        let [width, height] = size.map(|side| side as usize);
        let at = |weights: Option<Weights<'_>>, x: usize, y: usize, none: f32| {
            weights
                .map_or(none, |weights| weights.at([(x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64]))
        };
        let weights = (0..width * height)
            .into_par_iter()
            .map(|index| {
                let [x, y] = [index % width, index / width];
                [at(alpha, x, y, 1.0), at(beta, x, y, 0.0)]
            })
            .collect();
        Ok(Self { size, weights })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Alpha and beta of each pixel, row by row from the top.
    pub fn weights(&self) -> &[[f32; 2]] {
        &self.weights
    }

    /// Alpha at a place in pixels from the upper left corner, linear between the middles of pixels.
    pub fn alpha_at(&self, pixel: DVec2) -> f64 {
        let [width, height] = self.size.map(|side| side as usize);
        between([width, height], pixel.to_array(), |x, y| f64::from(self.weights[y * width + x][0]))
    }

    /// Blends a display image of the raster: R, G, B, A of 8 bits, sRGB.
    pub fn apply(&self, display: &mut [u8]) {
        let tables = Tables::shared();
        display.par_chunks_mut(4 * 4096).zip(self.weights.par_chunks(4096)).for_each(|(pixels, weights)| {
            for (pixel, [alpha, beta]) in pixels.chunks_exact_mut(4).zip(weights) {
                if *alpha == 1.0 && *beta == 0.0 {
                    continue;
                }
                for code in &mut pixel[..3] {
                    *code = tables.code_of(tables.light[usize::from(*code)] * alpha * (1.0 - beta) + beta);
                }
            }
        });
    }
}

impl Weights<'_> {
    /// The value at a point of 0 to 1.
    fn at(&self, [u, v]: [f64; 2]) -> f32 {
        let [width, height] = self.size;
        let place = [u * width as f64, v * height as f64];
        between(self.size, place, |x, y| f64::from(self.values[y * width + x])) as f32
    }
}

/// A value of a raster at a place in pixels: linear between the middles of pixels, beyond the outermost middles as there.
fn between([width, height]: [usize; 2], [x, y]: [f64; 2], value: impl Fn(usize, usize) -> f64) -> f64 {
    let middles = |at: f64, side: usize| {
        let at = (at - 0.5).clamp(0.0, (side - 1) as f64);
        let first = (at as usize).min(side.saturating_sub(2));
        ([first, (first + 1).min(side - 1)], at - first as f64)
    };
    let ([left, right], across) = middles(x, width);
    let ([upper, lower], down) = middles(y, height);
    let row = |y: usize| value(left, y) * (1.0 - across) + value(right, y) * across;
    row(upper) * (1.0 - down) + row(lower) * down
}

/// Codes of a display image and their light.
struct Tables {
    light: &'static [f32; 256],
    /// Least linear value that rounds to each code.
    least: [f32; 256],
    /// Code of each 4096th, to begin with.
    first: Vec<u8>,
}

impl Tables {
    fn shared() -> &'static Self {
        static TABLES: OnceLock<Tables> = OnceLock::new();
        TABLES.get_or_init(|| {
            let between = |code: usize| linear_from_srgb((code as f64 - 0.5) / 255.0) as f32;
            let least: [f32; 256] = std::array::from_fn(|code| if code == 0 { f32::MIN } else { between(code) });
            let first =
                (0..4096).map(|at| (least.partition_point(|least| *least <= at as f32 / 4096.0) - 1) as u8).collect();
            Self { light: light_of_codes(), least, first }
        })
    }

    fn code_of(&self, linear: f32) -> u8 {
        let at = ((linear * 4096.0) as usize).min(4095);
        let mut code = self.first[at];
        while code < 255 && self.least[usize::from(code) + 1] <= linear {
            code += 1;
        }
        code
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn every_code_comes_back_and_shares_are_of_linear_light() {
        let tables = Tables::shared();
        for code in 0..=255_u8 {
            assert_eq!(tables.code_of(tables.light[usize::from(code)]), code);
        }
        assert_eq!((tables.code_of(-0.1), tables.code_of(7.0)), (0, 255));
        for [alpha, beta] in [[0.5, 0.0], [0.25, 0.02], [0.0, 0.0], [0.0, 0.1], [1.0, 0.05]] {
            let [mask, black] = [[alpha], [beta]];
            let weights = |values| Some(Weights { size: [1, 1], values });
            let blend = Blend::new([256, 1], weights(&mask), weights(&black)).unwrap();
            let mut display: Vec<u8> = (0..=255).flat_map(|code| [code, code, 255 - code, 77]).collect();
            blend.apply(&mut display);
            for (code, pixel) in display.chunks_exact(4).enumerate() {
                let share = |code: u8| {
                    linear_from_srgb(f64::from(code) / 255.0) * f64::from(alpha) * (1.0 - f64::from(beta))
                        + f64::from(beta)
                };
                for (found, from) in [(pixel[0], code as u8), (pixel[2], 255 - code as u8)] {
                    // Half a code of the result.
                    let [below, above] = [-0.5, 0.5].map(|by| f64::from(found) + by);
                    let light = |code: f64| linear_from_srgb(code / 255.0);
                    let expected = share(from);
                    assert!(
                        light(below) <= expected + 1e-6 && expected <= light(above) + 1e-6,
                        "{from} {alpha} {beta}: {found}"
                    );
                }
                assert_eq!(pixel[3], 77);
            }
        }
    }

    #[test]
    fn masks_of_another_size_are_stretched() {
        let values: Vec<f32> = (0..5).map(|x| x as f32 / 4.0).collect();
        let blend = Blend::new([10, 3], Some(Weights { size: [5, 1], values: &values }), None).unwrap();
        for (x, [alpha, beta]) in blend.weights()[10..20].iter().enumerate() {
            let expected = ((x as f32 + 0.5) / 2.0 - 0.5).clamp(0.0, 4.0) / 4.0;
            assert!((alpha - expected).abs() < 1e-6 && *beta == 0.0, "{x} {alpha} {expected}");
        }
    }

    #[test]
    fn what_is_no_mask_is_refused() {
        let refused =
            |size, values: &[f32]| Blend::new([4, 4], None, Some(Weights { size, values })).unwrap_err().to_string();
        assert!(refused([2, 2], &[0.0; 3]).contains("beta: 2 x 2 pixels with 3 values"));
        assert!(refused([0, 2], &[]).contains("0 x 2"));
        assert!(refused([2, 1], &[0.5, 1.5]).contains("pixel (1, 0) has 1.5"));
        assert!(refused([2, 1], &[0.5, f32::NAN]).contains("NaN"));
    }
}
