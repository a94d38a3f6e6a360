//! Parameters of the published glare pyramids: sizes and weights of the levels, and the blur between levels.
//!
//! Level 0 has half the picture's resolution, and every further level has half the resolution of the previous one. A level is the previous one,
//! averaged over two by two texels and blurred by a Gaussian of [`SIGMA_TEXELS`] texels of the new level along both axes. So the width of the blur
//! doubles from level to level. The weighted sum of the levels is the published sum of Gaussians.
//!
//! A blurred image is normalised to the light it contains, so level i alone has a peak of 1/(2 pi sigma_i^2): equal weights result in
//! the inverse square of the distance, and the published halved weights in the inverse cube (a test measures -2.0 and -3.0).
//!
//! Source: "Smaller than Pixels", section 5. Units: pixels of the picture, texels of a level.

use std::f64::consts::TAU;

use crate::plan::settings::{GlareMethod, PyramidWeights};

/// Standard deviation of the blur that produces a level, texels of the level.
pub const SIGMA_TEXELS: f64 = 1.0;

/// Taps on either side of the central one.
pub const TAPS_ASIDE: usize = 3;

/// Minimum side of a level, except of level 0.
const FEWEST_TEXELS: u32 = 4;

/// Variance of the image of a point in a level, in squares of the level's texels. The cubic B-spline of the lookup contributes 1/3. Every level up to
/// this one contributes the variance of its blur and of the preceding average over two texels (1/16); the contribution of each earlier level is a
/// quarter of that of the next.
const LEVEL_VARIANCE: f64 = SIGMA_TEXELS * SIGMA_TEXELS * 4.0 / 3.0 + 1.0 / 3.0 + 1.0 / 12.0;

/// Axes along which the levels are blurred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PyramidAxes {
    /// The rows of the picture, then its columns.
    Screen,
    /// Two orthogonal great circles of view space.
    View,
}

impl PyramidAxes {
    /// The axes of a method; `None`: it is not a pyramid.
    pub fn for_method(method: GlareMethod) -> Option<Self> {
        match method {
            GlareMethod::ScreenPyramid => Some(Self::Screen),
            GlareMethod::ViewPyramid => Some(Self::View),
            GlareMethod::Auto | GlareMethod::None | GlareMethod::SkyCube => None,
        }
    }
}

/// Levels of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PyramidPlan {
    /// Width and height of every level, texels.
    pub sizes: Vec<[u32; 2]>,
}

impl PyramidPlan {
    /// Returns the levels of a picture of the given size, pixels, down to a few texels along the shorter side. If a side is odd, the last texel of
    /// level 0 repeats the border, and later levels round half the number of texels down, as mipmaps do: each texel is slightly larger.
    pub fn new(picture: [u32; 2]) -> Self {
        let mut size = picture.map(|side| side.div_ceil(2));
        let mut sizes = vec![size];
        while size.iter().all(|side| side / 2 >= FEWEST_TEXELS) {
            size = size.map(|side| side / 2);
            sizes.push(size);
        }
        Self { sizes }
    }

    /// Weights of the levels: their sum is 1.
    pub fn level_weights(&self, weights: PyramidWeights) -> Vec<f64> {
        let ratio = level_ratio(weights);
        let unscaled: Vec<f64> = (0..self.sizes.len()).map(|level| ratio.powi(level as i32)).collect();
        let sum: f64 = unscaled.iter().sum();
        unscaled.into_iter().map(|weight| weight / sum).collect()
    }

    /// Fraction of a point's light that falls on a pixel at the given distance, as a sum of Gaussians. The borders of the picture and averages over
    /// single pixels are ignored.
    pub fn per_px2(&self, weights: PyramidWeights, distance_px: f64) -> f64 {
        let gaussian = |(level, weight): (usize, f64)| {
            let variance = level_sigma_px(level).powi(2);
            weight * (-distance_px * distance_px / (2.0 * variance)).exp() / (TAU * variance)
        };
        self.level_weights(weights).into_iter().enumerate().map(gaussian).sum()
    }
}

/// Weight of every level relative to the previous one.
pub fn level_ratio(weights: PyramidWeights) -> f64 {
    match weights {
        PyramidWeights::Halved => 0.5,
        PyramidWeights::Equal => 1.0,
    }
}

/// Width of a texel of a level, pixels of the picture.
pub fn texel_px(level: usize) -> f64 {
    2.0_f64.powi(level as i32 + 1)
}

/// Standard deviation of the image of a point in a level, in pixels at the centre of the picture: the limit for levels far from
/// the first.
pub fn level_sigma_px(level: usize) -> f64 {
    LEVEL_VARIANCE.sqrt() * texel_px(level)
}

/// Weights of the taps of a blur: the central one, then those on one side. Both sides together sum to 1.
pub fn tap_weights() -> [f64; TAPS_ASIDE + 1] {
    let gaussian = |k: usize| (-(k as f64 / SIGMA_TEXELS).powi(2) / 2.0).exp();
    let sum = gaussian(0) + 2.0 * (1..=TAPS_ASIDE).map(gaussian).sum::<f64>();
    std::array::from_fn(|k| gaussian(k) / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_down_to_a_few_texels() {
        let sizes = |picture| PyramidPlan::new(picture).sizes;
        assert_eq!(sizes([128, 96]), [[64, 48], [32, 24], [16, 12], [8, 6]]);
        assert_eq!(sizes([33, 31]), [[17, 16], [8, 8], [4, 4]]);
        assert_eq!(sizes([1, 1]), [[1, 1]]);
        assert_eq!(sizes([1920, 1080]).len(), 8);
    }

    #[test]
    fn weights_of_taps_and_levels_sum_to_one() {
        let [middle, aside @ ..] = tap_weights();
        assert!((middle + 2.0 * aside.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        let variance: f64 = aside.iter().zip(1..).map(|(weight, k)| 2.0 * weight * f64::from(k * k)).sum();
        // The light beyond the last tap is lost.
        assert!(variance < 1.0 && variance > 0.99, "{variance}");
        let plan = PyramidPlan::new([256, 256]);
        assert!((plan.level_weights(PyramidWeights::Halved)[1] * 63.0 - 16.0).abs() < 1e-12);
        assert!(plan.level_weights(PyramidWeights::Equal).iter().all(|weight| (weight * 6.0 - 1.0).abs() < 1e-12));
    }

    /// Slope of the logarithm over two octaves of distance, far from the narrowest and the widest level.
    fn slope(plan: &PyramidPlan, weights: PyramidWeights) -> f64 {
        let ln_light = |distance_px: f64| plan.per_px2(weights, distance_px).ln();
        (ln_light(128.0) - ln_light(32.0)) / 4.0_f64.ln()
    }

    #[test]
    fn equal_weights_give_the_inverse_square_and_halved_ones_the_inverse_cube() {
        let plan = PyramidPlan { sizes: vec![[1, 1]; 12] };
        let (equal, halved) = (slope(&plan, PyramidWeights::Equal), slope(&plan, PyramidWeights::Halved));
        assert!((equal + 2.0).abs() < 0.02, "{equal}");
        assert!((halved + 3.0).abs() < 0.02, "{halved}");
    }
}
