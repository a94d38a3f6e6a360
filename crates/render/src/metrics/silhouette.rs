//! Silhouettes: the coverage of the same object in two pictures, pixel by pixel, from 0 to 1.
//!
//! Intersection over union is the usual figure, but it depends on the size: half a pixel along the outline weighs far
//! more for a disc of two pixels than for a disc of a hundred. The mean displacement of the outline in pixels is the
//! area that only one of the two covers, divided by the length of the outline; it can be compared with bounds in
//! pixels.

use super::error::{MetricError, not_negative};

/// Areas that two pictures cover alone and together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Area that both cover, px^2.
    pub both_px: f64,
    /// Area that at least one covers, px^2.
    pub either_px: f64,
    /// Area that the second one covers, px^2.
    pub second_px: f64,
}

impl Overlap {
    /// Returns the intersection over union: 1 for equal silhouettes, 0 for disjoint ones.
    pub fn iou(&self) -> f64 {
        self.both_px / self.either_px
    }

    /// Returns the mean displacement of the outline, px: the area that only one picture covers, divided by the circumference of a disc with the area
    /// of the second one.
    pub fn outline_px(&self) -> f64 {
        (self.either_px - self.both_px) / (2.0 * (std::f64::consts::PI * self.second_px).sqrt())
    }
}

/// Compares the coverage of two pictures; the second one is the reference.
///
/// # Errors
/// [`MetricError::TooFew`] if the numbers of pixels differ, [`MetricError::NotPositive`] for a coverage that is
/// negative or not finite, [`MetricError::NoLight`] if the second covers nothing.
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

    /// Returns the coverage of a disc, with 16 x 16 samples per pixel.
    fn disc(x: f64, y: f64, radius: f64) -> Vec<f64> {
        let covered = |px: usize| {
            let samples = (0..256).filter(|s| {
                let sample_position = |place: usize, sample: usize| place as f64 + (sample as f64 + 0.5) / 16.0;
                (sample_position(px % 40, s % 16) - x).hypot(sample_position(px / 40, s / 16) - y) <= radius
            });
            samples.count() as f64 / 256.0
        };
        (0..1600).map(covered).collect()
    }

    #[test]
    fn silhouette_errors_match_their_closed_forms() {
        let truth = disc(20.0, 20.0, 10.0);
        let same = overlap(&truth, &truth).unwrap();
        assert_eq!((same.iou(), same.outline_px()), (1.0, 0.0));
        // The disc is half a pixel too large all around: the overlap is (10 / 10.5)^2, and the outline is displaced by half a pixel.
        let wide = overlap(&disc(20.0, 20.0, 10.5), &truth).unwrap();
        assert!((wide.iou() - (10.0 / 10.5_f64).powi(2)).abs() < 2e-3, "{}", wide.iou());
        assert!((wide.outline_px() - 0.5 * 10.25 / 10.0).abs() < 0.01, "{}", wide.outline_px());
        // A displacement by s changes an area of 4 r s, counted on both sides.
        let moved = overlap(&disc(21.0, 20.0, 10.0), &truth).unwrap();
        assert!((moved.outline_px() - 4.0 / std::f64::consts::TAU).abs() < 0.01, "{}", moved.outline_px());
        assert_eq!(overlap(&disc(5.0, 5.0, 3.0), &disc(30.0, 30.0, 3.0)).unwrap().iou(), 0.0);
        assert_eq!(overlap(&vec![0.0; 1600], &truth).unwrap().iou(), 0.0);
    }

    #[test]
    fn invalid_silhouettes_are_refused() {
        let truth = disc(20.0, 20.0, 10.0);
        assert_eq!(overlap(&truth, &vec![0.0; 1600]).err(), Some(MetricError::NoLight("a silhouette")));
        assert!(overlap(&truth[1..], &truth).is_err());
        assert!(overlap(&vec![f64::NAN; 1600], &truth).is_err());
        assert!(overlap(&truth, &vec![-0.1; 1600]).is_err());
    }
}
