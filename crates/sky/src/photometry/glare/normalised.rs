//! Kernels whose integral over the sphere has no closed form: any shape of fall-off, integrated once and scaled to 1.
//!
//! The integral of the shape times 2 pi sin(t) is computed in the logarithm of the angle, over panels a hundredth of
//! the angle wide, by two-point Gauss-Legendre quadrature. Panels end at the kinks of the shape. The share within an
//! angle is the sum of the complete panels and a partial one, computed in the same way: it is consistent with the
//! total at any angle, without interpolation.

use std::f64::consts::{PI, TAU};

use super::GlareKernel;

/// Fall-off of a kernel, in arbitrary units.
pub trait Shape: Send + Sync {
    /// Density at an angle from 0 to pi, finite and not negative.
    fn relative(&self, angle_rad: f64) -> f64;

    /// Angle below which the shape is practically constant, rad, above 0.
    fn inner_rad(&self) -> f64;

    /// Angles between which the shape is smooth, rad, in any order.
    fn kinks_rad(&self) -> Vec<f64>;
}

/// A shape scaled to an integral of 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalised<S> {
    shape: S,
    /// Ends of the panels, rad; the first is practically 0, the last pi.
    knots_rad: Vec<f64>,
    /// Integral of the shape from 0 to each knot, sr times its unit.
    within: Vec<f64>,
}

/// Integral of the shape over a ring, sr times its unit; `from_rad` above 0.
fn ring(shape: &impl Shape, from_rad: f64, to_rad: f64) -> f64 {
    let half = 0.5 * (to_rad / from_rad).ln();
    let middle = (from_rad * to_rad).sqrt();
    let node = (half / 3.0_f64.sqrt()).exp();
    let value = |t: f64| shape.relative(t) * TAU * t.sin() * t;
    half * (value(middle / node) + value(middle * node))
}

impl<S: Shape> Normalised<S> {
    /// Creates the kernel of a shape; `None` if its integral is not a positive number.
    pub fn new(shape: S) -> Option<Self> {
        const PANELS_PER_E: f64 = 100.0;
        // The disc within the first knot has 1e-8 of the light within the inner angle.
        let first = 1e-4 * shape.inner_rad();
        let mut ends = shape.kinks_rad();
        ends.retain(|kink| *kink > first && *kink < PI);
        ends.push(PI);
        ends.sort_by(f64::total_cmp);
        let mut knots_rad = vec![first];
        let mut within = vec![shape.relative(0.0) * PI * first * first];
        let (mut from, mut sum) = (first, within[0]);
        for end in ends {
            let panels = ((end / from).ln() * PANELS_PER_E).ceil() as usize;
            let ratio = (end / from).powf(1.0 / panels.max(1) as f64);
            for panel in 1..=panels {
                // The last panel ends exactly at the kink.
                let to = if panel == panels { end } else { from * ratio };
                sum += ring(&shape, from, to);
                knots_rad.push(to);
                within.push(sum);
                from = to;
            }
        }
        (sum > 0.0 && sum.is_finite()).then_some(Self { shape, knots_rad, within })
    }

    /// Integral of the shape over the sphere, sr times its unit.
    pub fn integral(&self) -> f64 {
        self.within.last().copied().unwrap_or_default()
    }
}

impl<S: Shape> GlareKernel for Normalised<S> {
    fn per_sr(&self, angle_rad: f64) -> f64 {
        self.shape.relative(angle_rad) / self.integral()
    }

    fn share_within(&self, angle_rad: f64) -> f64 {
        let angle_rad = angle_rad.clamp(0.0, PI);
        let after = self.knots_rad.partition_point(|knot| *knot <= angle_rad);
        let within = match after.checked_sub(1) {
            None => self.within[0] * (angle_rad / self.knots_rad[0]).powi(2),
            Some(before) if self.knots_rad[before] < angle_rad => {
                self.within[before] + ring(&self.shape, self.knots_rad[before], angle_rad)
            }
            Some(before) => self.within[before],
        };
        within / self.integral()
    }

    fn inner_rad(&self) -> f64 {
        self.shape.inner_rad()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::photometry::glare::InverseSquareKernel;

    /// 1 / max(t, inner)^2, whose kernel has a closed form.
    struct InverseSquare(f64);

    impl Shape for InverseSquare {
        fn relative(&self, angle_rad: f64) -> f64 {
            angle_rad.max(self.0).powi(-2)
        }

        fn inner_rad(&self) -> f64 {
            self.0
        }

        fn kinks_rad(&self) -> Vec<f64> {
            vec![self.0]
        }
    }

    #[track_caller]
    pub fn shares_are_integrals_of_the_density(kernel: &dyn GlareKernel) {
        assert!((kernel.share_within(PI) - 1.0).abs() < 1e-12);
        assert_eq!(kernel.share_within(0.0), 0.0);
        // Midpoints in the angle itself, independent of the tested code.
        for (from_deg, to_deg) in [(0.0, 0.02), (0.02, 0.7), (0.7, 13.0), (13.0, 180.0_f64)] {
            let (from, to) = (f64::to_radians(from_deg), to_deg.to_radians());
            let steps = 100_000;
            let step = (to - from) / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|i| from + step * (f64::from(i) + 0.5))
                .map(|t| TAU * t.sin() * kernel.per_sr(t) * step)
                .sum();
            let share = kernel.share_within(to) - kernel.share_within(from);
            assert!((sum - share).abs() < 1e-6, "{from_deg} to {to_deg} degrees: {sum} {share}");
        }
    }

    #[test]
    fn a_shape_with_a_known_integral_is_integrated_correctly() {
        for inner_deg in [0.003, 0.1, 5.0, 180.0_f64] {
            let inner = inner_deg.to_radians();
            let known = InverseSquareKernel::new(inner);
            let kernel = Normalised::new(InverseSquare(inner)).unwrap();
            assert_eq!(kernel.inner_rad(), inner);
            for angle in [0.0, 1e-9, 1e-4, 0.01, inner, 1.3 * inner, 1.0, 3.0, PI, 4.0] {
                let (found, expected) = (kernel.share_within(angle), known.share_within(angle));
                assert!((found - expected).abs() < 1e-8, "{inner_deg} within {angle}: {found} {expected}");
                let (found, expected) = (kernel.per_sr(angle.min(PI)), known.per_sr(angle.min(PI)));
                assert!((found / expected - 1.0).abs() < 1e-8, "{inner_deg} at {angle}: {found} {expected}");
            }
            // A kernel with another inner angle must fail.
            let other = Normalised::new(InverseSquare(0.5 * inner)).unwrap();
            assert!((other.per_sr(0.0) / known.per_sr(0.0) - 1.0).abs() > 0.05);
            shares_are_integrals_of_the_density(&kernel);
        }
    }

    #[test]
    fn a_shape_without_light_has_no_kernel() {
        struct Black;
        impl Shape for Black {
            fn relative(&self, _: f64) -> f64 {
                0.0
            }
            fn inner_rad(&self) -> f64 {
                0.1
            }
            fn kinks_rad(&self) -> Vec<f64> {
                Vec::new()
            }
        }
        assert!(Normalised::new(Black).is_none());
    }
}
