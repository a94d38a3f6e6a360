//! Silhouettes: what two pictures of one thing cover, pixel by pixel, as shares from 0 to 1.
//!
//! The intersection over the union is the usual figure, but says little without the size: half a pixel along the
//! outline of a disc of two pixels is far more of it than of a disc of a hundred. The mean displacement of the outline,
//! in pixels, is the area that only one of both covers over the outline's length; it compares with bounds that are in
//! pixels.

use super::error::{MetricError, not_negative};

/// What two pictures cover together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Area that both cover, px.
    pub both_px: f64,
    /// Area that at least one covers, px.
    pub either_px: f64,
    /// Area that the second one covers, px.
    pub second_px: f64,
}

impl Overlap {
    /// Intersection over union: 1 of equal silhouettes, 0 of disjoint ones.
    pub fn iou(&self) -> f64 {
        self.both_px / self.either_px
    }

    /// Mean displacement of the outline, px: the area that one alone covers, over the girth of a disc of the second
    /// one's area.
    pub fn outline_px(&self) -> f64 {
        (self.either_px - self.both_px) / (2.0 * (std::f64::consts::PI * self.second_px).sqrt())
    }
}

/// Compares the coverage of two pictures; the second one is the truth.
///
/// # Errors
/// [`MetricError::TooFew`] if the first has fewer pixels than the second or more, [`MetricError::NotPositive`] for a
/// share that is negative or not finite, [`MetricError::NoLight`] if the second covers nothing.
pub fn overlap(first: &[f64], second: &[f64]) -> Result<Overlap, MetricError> {
    if first.len() != second.len() {
        return Err(MetricError::TooFew {
            what: "pixels of a silhouette",
            found: first.len().min(second.len()),
            least: first.len().max(second.len()),
        });
    }
    let mut overlap = Overlap { both_px: 0.0, either_px: 0.0, second_px: 0.0 };
    for (a, b) in first.iter().zip(second) {
        let (a, b) = (not_negative("coverage", *a)?, not_negative("coverage", *b)?);
        overlap.both_px += a.min(b);
        overlap.either_px += a.max(b);
        overlap.second_px += b;
    }
    if overlap.second_px > 0.0 { Ok(overlap) } else { Err(MetricError::NoLight("a silhouette")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coverage of a disc, by 16 x 16 samples per pixel.
    fn disc(x: f64, y: f64, radius: f64) -> Vec<f64> {
        let covered = |px: usize| {
            let samples = (0..256).filter(|s| {
                let at = |place: usize, sample: usize| place as f64 + (sample as f64 + 0.5) / 16.0;
                (at(px % 40, s % 16) - x).hypot(at(px / 40, s / 16) - y) <= radius
            });
            samples.count() as f64 / 256.0
        };
        (0..1600).map(covered).collect()
    }

    #[test]
    fn equal_silhouettes_have_no_error_and_wrong_ones_have_that_of_the_closed_form() {
        let truth = disc(20.0, 20.0, 10.0);
        let same = overlap(&truth, &truth).unwrap();
        assert_eq!((same.iou(), same.outline_px()), (1.0, 0.0));
        // Half a pixel too large all around: (10 / 10.5)^2, and half a pixel of outline.
        let wide = overlap(&disc(20.0, 20.0, 10.5), &truth).unwrap();
        assert!((wide.iou() - (10.0 / 10.5_f64).powi(2)).abs() < 2e-3, "{}", wide.iou());
        assert!((wide.outline_px() - 0.5 * 10.25 / 10.0).abs() < 0.01, "{}", wide.outline_px());
        // Moved by s, both sides together lose 4 r s.
        let moved = overlap(&disc(21.0, 20.0, 10.0), &truth).unwrap();
        assert!((moved.outline_px() - 4.0 / std::f64::consts::TAU).abs() < 0.01, "{}", moved.outline_px());
        assert_eq!(overlap(&disc(5.0, 5.0, 3.0), &disc(30.0, 30.0, 3.0)).unwrap().iou(), 0.0);
        assert_eq!(overlap(&vec![0.0; 1600], &truth).unwrap().iou(), 0.0);
    }

    #[test]
    fn what_is_no_silhouette_is_refused() {
        let truth = disc(20.0, 20.0, 10.0);
        assert_eq!(overlap(&truth, &vec![0.0; 1600]).err(), Some(MetricError::NoLight("a silhouette")));
        assert!(overlap(&truth[1..], &truth).is_err());
        assert!(overlap(&vec![f64::NAN; 1600], &truth).is_err());
        assert!(overlap(&truth, &vec![-0.1; 1600]).is_err());
    }
}
