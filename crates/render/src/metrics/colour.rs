//! Colour: distance of chromaticities in the CIE 1976 uniform chromaticity scale u', v' (CIE 15). A difference of 0.003
//! is about the smallest that an eye can distinguish side by side. Brightness does not matter.

use super::{HdrView, MetricError};
use crate::photometry::rec709::{luminance, uv_prime};

/// Returns the distance of two colours (linear Rec. 709, any scale) in u', v'. Returns `None` if one of them is black, because black has no colour.
pub fn uv_distance(a: [f64; 3], b: [f64; 3]) -> Option<f64> {
    if !(luminance(a) > 0.0 && luminance(b) > 0.0) {
        return None;
    }
    let ([ua, va], [ub, vb]) = (uv_prime(a), uv_prime(b));
    let distance = (ua - ub).hypot(va - vb);
    distance.is_finite().then_some(distance)
}

/// Differences between the colours of an image and the expected ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourDifference {
    /// Mean distance in u', v', weighted by the expected luminance.
    pub mean: f64,
    /// Largest distance in u', v'.
    pub largest: f64,
    /// Column and row of the largest distance.
    pub largest_at: [u32; 2],
    /// Share of the expected luminance in pixels that have no colour in the image: they should be lit and are not.
    pub missing: f64,
}

/// Compares the colours of an image with those of an `expected` image of the same size, over the pixels whose expected
/// luminance is at least `floor_cd_m2` (below it, rounding by a few units can produce any colour).
///
/// # Errors
/// [`MetricError::Sizes`] if the sizes differ, [`MetricError::NoLight`] if no pixel has a colour in both images.
pub fn colour_difference(
    image: &HdrView<'_>,
    expected: &HdrView<'_>,
    floor_cd_m2: f64,
) -> Result<ColourDifference, MetricError> {
    if image.size() != expected.size() {
        return Err(MetricError::Sizes(image.size(), expected.size()));
    }
    let [width, height] = image.size();
    let (mut sum, mut compared, mut missing) = (0.0, 0.0, 0.0);
    let mut largest: Option<(f64, [u32; 2])> = None;
    for y in 0..height {
        for x in 0..width {
            let right = expected.rgb_cd_m2(x, y);
            let weight = luminance(right);
            if weight <= 0.0 || weight < floor_cd_m2 {
                continue;
            }
            let Some(distance) = uv_distance(image.rgb_cd_m2(x, y), right) else {
                missing += weight;
                continue;
            };
            sum += weight * distance;
            compared += weight;
            if largest.is_none_or(|(found, _)| distance > found) {
                largest = Some((distance, [x, y]));
            }
        }
    }
    let (largest, largest_at) = largest.ok_or(MetricError::NoLight("a colour"))?;
    Ok(ColourDifference { mean: sum / compared, largest, largest_at, missing: missing / (compared + missing) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::projection::Perspective;

    /// u', v' of D65 white and of the red primary follow from their x, y (ITU-R BT.709): (0.19783, 0.46832) and
    /// (0.45070, 0.52289).
    const WHITE_TO_RED: f64 = 0.258_69;

    #[test]
    fn white_and_red_are_as_far_apart_as_their_chromaticities() {
        let found = uv_distance([3.0; 3], [1e-6, 0.0, 0.0]).unwrap();
        assert!((found - WHITE_TO_RED).abs() < 1e-5, "{found}");
        // Only the scale differs: the distance is a rounding error.
        assert!(uv_distance([0.1, 0.2, 0.3], [10.0, 20.0, 30.0]).unwrap() < 1e-15);
        assert_eq!(uv_distance([0.0; 3], [1.0; 3]), None);
        assert_eq!(uv_distance([1.0; 3], [f64::NAN; 3]), None);
    }

    #[test]
    fn a_swapped_channel_is_found_with_its_place() {
        let mapping = Perspective::symmetric([4, 2], 1.0).unwrap();
        let expected: Vec<[f64; 3]> = (0..8).map(|i| [1.0 + f64::from(i), 1.0, 0.5]).collect();
        let right: Vec<[f32; 4]> = expected.iter().map(|p| [p[0] as f32, p[1] as f32, p[2] as f32, 0.0]).collect();
        let view = |pixels| HdrView::new(&mapping, pixels).unwrap();
        let truth = HdrView::new(&mapping, &expected).unwrap();
        let same = colour_difference(&view(&right), &truth, 0.0).unwrap();
        assert!(same.largest < 1e-7 && same.missing == 0.0, "{same:?}");

        let mut swapped = right.clone();
        for pixel in &mut swapped {
            pixel.swap(0, 2);
        }
        let found = colour_difference(&view(&swapped), &truth, 0.0).unwrap();
        assert!(found.mean > 0.1 && found.largest > found.mean, "{found:?}");
        assert_eq!(found.largest_at, [3, 1]);

        // A single wrong pixel contributes to the mean by its share of the luminance.
        let mut one = right.clone();
        one[5].swap(0, 2);
        let found = colour_difference(&view(&one), &truth, 0.0).unwrap();
        let distance = uv_distance([6.0, 1.0, 0.5], [0.5, 1.0, 6.0]).unwrap();
        let share = luminance(expected[5]) / expected.iter().map(|p| luminance(*p)).sum::<f64>();
        assert!((found.largest - distance).abs() < 1e-6 && found.largest_at == [1, 1], "{found:?}");
        assert!((found.mean - share * distance).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn lost_pixels_count_as_missing_and_black_never_as_right() {
        let mapping = Perspective::symmetric([2, 1], 1.0).unwrap();
        let expected = vec![[3.0_f64; 3], [1.0; 3]];
        let truth = HdrView::new(&mapping, &expected).unwrap();
        let half = vec![[3.0_f64; 3], [0.0; 3]];
        let found = colour_difference(&HdrView::new(&mapping, &half).unwrap(), &truth, 0.0).unwrap();
        assert!((found.missing - 0.25).abs() < 1e-15 && found.largest < 1e-15, "{found:?}");
        // Below the floor the missing pixel does not count.
        let found = colour_difference(&HdrView::new(&mapping, &half).unwrap(), &truth, 2.0).unwrap();
        assert!(found.missing == 0.0, "{found:?}");
        let black = vec![[0.0_f64; 3]; 2];
        let black = HdrView::new(&mapping, &black).unwrap();
        assert_eq!(colour_difference(&black, &truth, 0.0), Err(MetricError::NoLight("a colour")));
        assert_eq!(colour_difference(&truth, &black, 0.0), Err(MetricError::NoLight("a colour")));
        let other = Perspective::symmetric([1, 2], 1.0).unwrap();
        let other = HdrView::new(&other, &expected).unwrap();
        assert_eq!(colour_difference(&truth, &other, 0.0), Err(MetricError::Sizes([2, 1], [1, 2])));
    }
}
