//! First and second moments of light over a plane.

use glam::DVec2;

/// Sum, mean and covariance of weighted points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moments {
    /// Sum of the weights.
    pub sum: f64,
    /// Weighted mean.
    pub mean: DVec2,
    /// Standard deviations along the longest and the shortest axis.
    pub major: f64,
    /// See `major`.
    pub minor: f64,
}

/// Returns the moments of `points` (position, weight); `None` if the total weight is not positive.
pub(super) fn moments(points: &[(DVec2, f64)]) -> Option<Moments> {
    let sum: f64 = points.iter().map(|(_, weight)| weight).sum();
    // Offsets from the first point avoid cancellation for a star far from the origin, and give a single point a width
    // of exactly zero.
    let origin = points.first()?.0;
    if sum.is_nan() || sum <= 0.0 {
        return None;
    }
    let mean = points.iter().map(|(point, weight)| (*point - origin) * *weight).sum::<DVec2>() / sum;
    let [mut xx, mut xy, mut yy] = [0.0; 3];
    for (point, weight) in points {
        let offset = *point - origin - mean;
        xx += offset.x * offset.x * weight / sum;
        xy += offset.x * offset.y * weight / sum;
        yy += offset.y * offset.y * weight / sum;
    }
    // Eigenvalues of the covariance.
    let (middle, half_difference) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
    Some(Moments {
        sum,
        mean: origin + mean,
        major: (middle + half_difference).sqrt(),
        // Rounding may make the variance across a line of points negative.
        minor: (middle - half_difference).max(0.0).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_few_points() {
        assert_eq!(moments(&[]), None);
        assert_eq!(moments(&[(DVec2::ONE, 0.0)]), None);
        let one = moments(&[(DVec2::new(1e3, 0.1), 0.3)]).unwrap();
        assert_eq!((one.mean, one.major, one.minor), (DVec2::new(1e3, 0.1), 0.0, 0.0));
        // A line at 45 degrees, weights 1 and 3: the variance along it is 3/16 of its squared length.
        let line = moments(&[(DVec2::ZERO, 1.0), (DVec2::ONE, 3.0)]).unwrap();
        assert!((line.mean - DVec2::splat(0.75)).length() < 1e-15);
        assert!((line.major - (2.0 * 3.0 / 16.0_f64).sqrt()).abs() < 1e-15 && line.minor < 1e-8);
        // An ellipse rotated by 30 degrees, with the standard deviations 2 and 1.
        let turned = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            (DVec2::new(2.0 * cos, sin).rotate(DVec2::from_angle(0.5)), 1.0)
        };
        let ring: Vec<_> = (0..360).map(|degree| turned(f64::from(degree).to_radians())).collect();
        let ring = moments(&ring).unwrap();
        assert!((ring.major - 2f64.sqrt()).abs() < 1e-12 && (ring.minor - 0.5f64.sqrt()).abs() < 1e-12);
    }
}
