//! Blending of projectors: where their pictures overlap, each gives a share of the light, and where only one shines black is lifted to the level of several.

use glam::DVec2;
use rayon::prelude::*;

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

    /// Of weights that are known: alpha and beta of each pixel of the raster, 0 to 1, row by row from the top.
    pub(super) fn from_weights(size: [u32; 2], weights: Vec<[f32; 2]>) -> Self {
        Self { size, weights }
    }

    /// The same of a projector whose white is dimmed to a share, 0 to 1: each pixel's light is multiplied by it.
    #[must_use]
    pub fn dimmed(&self, share: f64) -> Self {
        let weights = self.weights.iter().map(|[alpha, beta]| [alpha * share as f32, *beta]).collect();
        Self { size: self.size, weights }
    }

    /// Light of one share everywhere.
    pub fn uniform(size: [u32; 2], alpha: f64) -> Self {
        Self { size, weights: vec![[alpha as f32, 0.0]; size[0] as usize * size[1] as usize] }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Alpha and beta of each pixel, row by row from the top.
    pub fn weights(&self) -> &[[f32; 2]] {
        &self.weights
    }

    /// Alpha and beta at a place in pixels from the upper left corner, linear between the middles of pixels.
    pub fn at(&self, pixel: DVec2) -> [f64; 2] {
        let [width, height] = self.size.map(|side| side as usize);
        [0, 1].map(|of| between([width, height], pixel.to_array(), |x, y| f64::from(self.weights[y * width + x][of])))
    }

    /// Alpha there.
    pub fn alpha_at(&self, pixel: DVec2) -> f64 {
        self.at(pixel)[0]
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

/// Light that a pixel shows, as a share of the projector's white, of light that it would show alone and its weights.
pub(super) fn shown(light: [f32; 3], [alpha, beta]: [f32; 2]) -> [f32; 3] {
    light.map(|light| light * alpha * (1.0 - beta) + beta)
}

/// The two pixels of a row or column of `side` whose middles are around a place, pixels, and how far it is from the first to the second, 0 to 1.
pub(super) fn middles(at: f64, side: usize) -> ([usize; 2], f64) {
    let at = (at - 0.5).clamp(0.0, (side - 1) as f64);
    let first = (at as usize).min(side.saturating_sub(2));
    ([first, (first + 1).min(side - 1)], at - first as f64)
}

/// A value of a raster at a place in pixels: linear between the middles of pixels, beyond the outermost middles as there.
pub(super) fn between([width, height]: [usize; 2], [x, y]: [f64; 2], value: impl Fn(usize, usize) -> f64) -> f64 {
    let ([left, right], across) = middles(x, width);
    let ([upper, lower], down) = middles(y, height);
    let row = |y: usize| value(left, y) * (1.0 - across) + value(right, y) * across;
    row(upper) * (1.0 - down) + row(lower) * down
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

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
