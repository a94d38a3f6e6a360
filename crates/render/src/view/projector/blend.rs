//! Blending of projectors: where their pictures overlap, each contributes a share of the light; in a region that only one projector lights, its black
//! is raised to the level of several.

use glam::DVec2;
use rayon::prelude::*;

/// Programs such as SGCT multiply display codes by their masks. The masks are made for displays whose light is proportional to this power of the
/// code.
pub const DISPLAY_GAMMA: f64 = 2.2;

/// Light shares and black levels over a raster.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    size: [u32; 2],
    /// Factor on the light (alpha) and black level (beta) of each pixel, row by row from the top: the displayed light
    /// is `L * alpha * (1 - beta) + beta`, in units of white.
    weights: Vec<[f32; 2]>,
    /// Factor on the code of each pixel, if codes are multiplied instead of the light: alpha is this factor to the power [`DISPLAY_GAMMA`].
    code_factors: Option<Vec<f32>>,
    /// Whether a beta is not 0.
    lifts_black: bool,
}

/// Values from 0 to 1 in linear light on their own raster, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Weights<'a> {
    /// Width and height.
    pub size: [usize; 2],
    /// One value per pixel.
    pub values: &'a [f32],
}

/// Reason why weights are not a valid blend.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{mask}: {problem}")]
pub struct BlendError {
    /// `alpha` or `beta`.
    pub mask: &'static str,
    /// The problem.
    pub problem: String,
}

impl Blend {
    /// Builds the blend of a raster of `size` pixels. A mask of another size is stretched over it, bilinearly between
    /// pixel centres. `None` means alpha 1 or beta 0.
    ///
    /// # Errors
    ///
    /// A mask is empty, its number of values differs from its size, or a value is outside of 0 to 1.
    pub fn new(size: [u32; 2], alpha: Option<Weights<'_>>, beta: Option<Weights<'_>>) -> Result<Self, BlendError> {
        for (mask, weights) in [("alpha", alpha), ("beta", beta)] {
            let Some(Weights { size: [width, height], values }) = weights else { continue };
            let wrong = |problem: String| Err(BlendError { mask, problem });
            if width == 0 || height == 0 || values.len() != width * height {
                return wrong(format!("{width} x {height} pixels with {} values", values.len()));
            }
            if let Some(at) = values.iter().position(|value| !(0.0..=1.0).contains(value)) {
                return wrong(format!(
                    "pixel ({}, {}) is {}: must be between 0 and 1",
                    at % width,
                    at / width,
                    values[at]
                ));
            }
        }
        let [width, height] = size.map(|side| side as usize);
        let weight_at = |weights: Option<Weights<'_>>, x: usize, y: usize, none: f32| {
            weights.map_or(none, |weights| {
                weights.value_at([(x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64])
            })
        };
        let weights = (0..width * height)
            .into_par_iter()
            .map(|index| {
                let [x, y] = [index % width, index / width];
                [weight_at(alpha, x, y, 1.0), weight_at(beta, x, y, 0.0)]
            })
            .collect();
        Ok(Self::from_weights(size, weights))
    }

    /// Blend with known weights: alpha and beta of each pixel of the raster, 0 to 1, row by row from the top.
    pub(super) fn from_weights(size: [u32; 2], weights: Vec<[f32; 2]>) -> Self {
        let lifts_black = weights.iter().any(|[_, beta]| *beta != 0.0);
        Self { size, weights, code_factors: None, lifts_black }
    }

    /// The same blend with white dimmed to a share, 0 to 1: each pixel's light is multiplied by it.
    #[must_use]
    pub fn dimmed(&self, share: f64) -> Self {
        let weights = self.weights.iter().map(|[alpha, beta]| [alpha * share as f32, *beta]).collect();
        let dimmed = Self::from_weights(self.size, weights);
        if self.code_factors.is_some() { dimmed.of_codes() } else { dimmed }
    }

    /// The same blend for display images whose codes are multiplied, as in SGCT. For images of light, which have no codes, alpha applies.
    #[must_use]
    pub fn of_codes(self) -> Self {
        let factor = |[alpha, _]: &[f32; 2]| f64::from(*alpha).powf(1.0 / DISPLAY_GAMMA) as f32;
        let code_factors = Some(self.weights.iter().map(factor).collect());
        Self { code_factors, ..self }
    }

    /// Whether a beta is not 0.
    pub(super) fn lifts_black(&self) -> bool {
        self.lifts_black
    }

    /// Factors on the codes of all pixels, if the blend does not also raise black.
    pub(super) fn code_factors_alone(&self) -> Option<&[f32]> {
        self.code_factors.as_deref().filter(|_| !self.lifts_black)
    }

    /// Factor on the codes of a pixel; `None`: its light is multiplied by alpha.
    pub(super) fn code_factor(&self, pixel: usize) -> Option<f32> {
        self.code_factors.as_ref().map(|factors| factors[pixel])
    }

    /// The same share of light everywhere.
    pub fn uniform(size: [u32; 2], alpha: f64) -> Self {
        Self::from_weights(size, vec![[alpha as f32, 0.0]; size[0] as usize * size[1] as usize])
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Alpha and beta of each pixel, row by row from the top.
    pub fn weights(&self) -> &[[f32; 2]] {
        &self.weights
    }

    /// Alpha and beta at a position in pixels from the upper left corner, bilinear between pixel centres.
    pub fn weights_at(&self, pixel: DVec2) -> [f64; 2] {
        let [width, height] = self.size.map(|side| side as usize);
        [0, 1].map(|channel| {
            between([width, height], pixel.to_array(), |x, y| f64::from(self.weights[y * width + x][channel]))
        })
    }

    /// Alpha at a position, as in [`Blend::weights_at`].
    pub fn alpha_at(&self, pixel: DVec2) -> f64 {
        self.weights_at(pixel)[0]
    }
}

impl Weights<'_> {
    /// The value at a position in texture coordinates, 0 to 1.
    fn value_at(&self, [u, v]: [f64; 2]) -> f32 {
        let [width, height] = self.size;
        let place = [u * width as f64, v * height as f64];
        between(self.size, place, |x, y| f64::from(self.values[y * width + x])) as f32
    }
}

/// Returns the displayed light of a pixel, in units of the projector's white, from its weights and the light that it would display without blending.
pub(super) fn blended(light: [f32; 3], [alpha, beta]: [f32; 2]) -> [f32; 3] {
    light.map(|light| light * alpha * (1.0 - beta) + beta)
}

/// The two pixels of a row or column of `side` pixels whose centres enclose a position, and the fraction from the first
/// to the second, 0 to 1.
pub(super) fn middles(position: f64, side: usize) -> ([usize; 2], f64) {
    let position = (position - 0.5).clamp(0.0, (side - 1) as f64);
    let first = (position as usize).min(side.saturating_sub(2));
    ([first, (first + 1).min(side - 1)], position - first as f64)
}

/// A value of a raster at a position in pixels: bilinear between pixel centres, constant beyond the outermost centres.
pub(super) fn between([width, height]: [usize; 2], [x, y]: [f64; 2], value: impl Fn(usize, usize) -> f64) -> f64 {
    let ([left, right], across) = middles(x, width);
    let ([upper, lower], down) = middles(y, height);
    let row = |y: usize| value(left, y) * (1.0 - across) + value(right, y) * across;
    row(upper) * (1.0 - down) + row(lower) * down
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
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
    fn invalid_masks_are_refused() {
        let refused =
            |size, values: &[f32]| Blend::new([4, 4], None, Some(Weights { size, values })).unwrap_err().to_string();
        assert!(refused([2, 2], &[0.0; 3]).contains("beta: 2 x 2 pixels with 3 values"));
        assert!(refused([0, 2], &[]).contains("0 x 2"));
        assert!(refused([2, 1], &[0.5, 1.5]).contains("pixel (1, 0) is 1.5"));
        assert!(refused([2, 1], &[0.5, f32::NAN]).contains("NaN"));
    }
}
