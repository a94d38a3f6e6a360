//! Order dependence: whether the same stars in another order give the same image bit for bit, and if not, how much the images differ.

use super::{HdrView, MetricError};

/// How two images differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Whether all channels of all pixels have the same bits (0 and -0 count as different).
    pub identical: bool,
    /// Number of pixels with different bits.
    pub pixels: u64,
    /// Largest difference of a channel divided by the larger of its two absolute values, 0 to 2. It is 1 if one image is black there.
    pub largest_relative: f64,
    /// Largest difference of a channel divided by the largest absolute channel of the two images: the visible size of the difference.
    pub largest_of_brightest: f64,
}

impl Difference {
    const NONE: Self = Self { identical: true, pixels: 0, largest_relative: 0.0, largest_of_brightest: 0.0 };

    fn worst(self, other: Self) -> Self {
        Self {
            identical: self.identical && other.identical,
            pixels: self.pixels.max(other.pixels),
            largest_relative: self.largest_relative.max(other.largest_relative),
            largest_of_brightest: self.largest_of_brightest.max(other.largest_of_brightest),
        }
    }
}

/// Compares R, G and B of every pixel in two images of the same size.
///
/// # Errors
/// [`MetricError::Sizes`] if the sizes differ.
pub fn difference(a: &HdrView<'_>, b: &HdrView<'_>) -> Result<Difference, MetricError> {
    if a.size() != b.size() {
        return Err(MetricError::Sizes(a.size(), b.size()));
    }
    let [width, height] = a.size();
    let mut found = Difference::NONE;
    let (mut largest_difference, mut brightest) = (0.0_f64, 0.0_f64);
    for y in 0..height {
        for x in 0..width {
            let (rgb_a, rgb_b) = (a.rgb_cd_m2(x, y), b.rgb_cd_m2(x, y));
            // f32 converts to f64 without loss, so a comparison of these bits is one of the original bits.
            let same = rgb_a.map(f64::to_bits) == rgb_b.map(f64::to_bits);
            found.pixels += u64::from(!same);
            for (a, b) in rgb_a.into_iter().zip(rgb_b) {
                let larger = a.abs().max(b.abs());
                brightest = brightest.max(larger);
                if a != b {
                    largest_difference = largest_difference.max((a - b).abs());
                    found.largest_relative = found.largest_relative.max((a - b).abs() / larger);
                }
            }
        }
    }
    found.identical = found.pixels == 0;
    if largest_difference > 0.0 {
        found.largest_of_brightest = largest_difference / brightest;
    }
    Ok(found)
}

/// Compares all images of shuffled input with the first of them; returns the largest value of each field of [`Difference`].
///
/// # Errors
/// [`MetricError::TooFew`] below two images, [`MetricError::Sizes`] if a size differs.
pub fn order_dependence(images: &[HdrView<'_>]) -> Result<Difference, MetricError> {
    let [first, rest @ ..] = images else {
        return Err(MetricError::TooFew { what: "images to compare", found: 0, least: 2 });
    };
    if rest.is_empty() {
        return Err(MetricError::TooFew { what: "images to compare", found: 1, least: 2 });
    }
    rest.iter().try_fold(Difference::NONE, |worst, image| Ok(worst.worst(difference(first, image)?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::projection::Perspective;

    #[test]
    fn one_bit_in_one_image_is_found() {
        let mapping = Perspective::symmetric([3, 2], 1.0).unwrap();
        let first: Vec<[f32; 4]> = (0..6).map(|i| [1.0 + i as f32, 0.5, 0.0, 1.0]).collect();
        let mut changed = first.clone();
        changed[4][1] = 0.5_f32.next_up();
        let (a, b) = (HdrView::new(&mapping, &first).unwrap(), HdrView::new(&mapping, &changed).unwrap());
        assert_eq!(order_dependence(&[a; 5]), Ok(Difference::NONE));
        let found = order_dependence(&[a, a, b, a]).unwrap();
        assert!(!found.identical && found.pixels == 1);
        let step = f64::from(f32::EPSILON) / 2.0;
        assert!((found.largest_relative / (step / 0.5) - 1.0).abs() < 1e-6, "{found:?}");
        assert!((found.largest_of_brightest / (step / 6.0) - 1.0).abs() < 1e-6, "{found:?}");
    }

    /// This is the reason for the metric: a sum in f32 depends on its order.
    #[test]
    fn floating_sums_in_another_order_are_found() {
        let mapping = Perspective::symmetric([1, 1], 1.0).unwrap();
        // The spacing of f32 at 2^24 is 2: adding 1 is rounded away, so each of the two faint stars is lost.
        let stars = [1.0_f32, 1.0, 16_777_216.0];
        let pixel = |sum: f32| vec![[sum, sum, sum, 1.0]];
        let (forwards, backwards) = (pixel(stars.iter().sum()), pixel(stars.iter().rev().sum()));
        let images = [&forwards, &backwards].map(|pixels| HdrView::new(&mapping, pixels).unwrap());
        let found = order_dependence(&images).unwrap();
        assert!(!found.identical && found.largest_relative == 2.0 / 16_777_218.0, "{found:?}");
    }

    #[test]
    fn a_star_missing_in_one_image_and_the_sign_of_zero_are_differences() {
        let mapping = Perspective::symmetric([2, 1], 1.0).unwrap();
        let images = [[[4.0_f64; 3], [0.0; 3]], [[4.0; 3], [1e-9; 3]], [[4.0; 3], [-0.0; 3]]];
        let [black, lit, negative] = images.each_ref().map(|pixels| HdrView::new(&mapping, &pixels[..]).unwrap());
        let found = difference(&black, &lit).unwrap();
        assert!((found.largest_relative, found.pixels) == (1.0, 1), "{found:?}");
        assert!((found.largest_of_brightest / 2.5e-10 - 1.0).abs() < 1e-12);
        let found = difference(&black, &negative).unwrap();
        assert!(!found.identical && found.largest_relative == 0.0, "{found:?}");
    }

    #[test]
    fn too_few_images_and_other_sizes_are_refused() {
        let [wide, high] = [[2, 1], [1, 2]].map(|size| Perspective::symmetric(size, 1.0).unwrap());
        let pixels = vec![[1.0_f64; 3]; 2];
        let (a, b) = (HdrView::new(&wide, &pixels).unwrap(), HdrView::new(&high, &pixels).unwrap());
        assert!(matches!(order_dependence(&[]), Err(MetricError::TooFew { found: 0, .. })));
        assert!(matches!(order_dependence(&[a]), Err(MetricError::TooFew { found: 1, .. })));
        assert_eq!(order_dependence(&[a, b]), Err(MetricError::Sizes([2, 1], [1, 2])));
    }
}
