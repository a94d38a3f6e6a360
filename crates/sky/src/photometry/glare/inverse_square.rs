//! The inverse square of the angle, constant within an inner angle: k = C / max(theta, theta_0)^2 up to 180 degrees.

use std::f64::consts::{PI, TAU};

use super::GlareKernel;

/// An inverse-square kernel; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseSquareKernel {
    inner_rad: f64,
    /// C, 1/sr times rad^2.
    constant: f64,
}

/// Integral of sin(t) / t^2 from 0 to `x` without its first term 1 / t: the rest of the sine's series.
fn regular_part(x: f64) -> f64 {
    // Terms (-1)^k x^(2k) / (2k (2k+1)!): for x up to pi, twenty of them give the exact value.
    let mut sum = 0.0;
    let mut term = 1.0;
    for k in 1..=20 {
        let n = f64::from(2 * k);
        term *= -x * x / (n * (n + 1.0));
        sum += term / n;
    }
    sum
}

impl InverseSquareKernel {
    /// The kernel with an inner angle above 0 and at most pi, rad.
    pub fn new(inner_rad: f64) -> Self {
        let unscaled = Self { inner_rad, constant: 1.0 };
        Self { inner_rad, constant: 1.0 / unscaled.share_within(PI) }
    }

    /// C: the value times the square of the angle, beyond the inner angle.
    pub fn constant(&self) -> f64 {
        self.constant
    }
}

impl GlareKernel for InverseSquareKernel {
    fn per_sr(&self, angle_rad: f64) -> f64 {
        self.constant / angle_rad.max(self.inner_rad).powi(2)
    }

    fn share_within(&self, angle_rad: f64) -> f64 {
        let angle_rad = angle_rad.clamp(0.0, PI);
        let core = angle_rad.min(self.inner_rad);
        // 1 - cos(t) without cancellation.
        let core_share = 2.0 * (0.5 * core).sin().powi(2) / (self.inner_rad * self.inner_rad);
        // The integral of sin(t) / t^2 is ln(t) plus the regular part.
        let outer = (angle_rad / self.inner_rad).max(1.0).ln() + regular_part(angle_rad.max(self.inner_rad))
            - regular_part(self.inner_rad);
        TAU * self.constant * (core_share + outer)
    }

    fn inner_rad(&self) -> f64 {
        self.inner_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_over_the_sphere_is_one_and_the_constant_is_correct() {
        let kernel = InverseSquareKernel::new(0.1_f64.to_radians());
        assert!((kernel.constant - 0.02166).abs() < 5e-6, "{}", kernel.constant);
        for inner_deg in [0.01, 0.1, 5.0, 90.0, 180.0_f64] {
            let kernel = InverseSquareKernel::new(inner_deg.to_radians());
            for to_deg in [0.05, 0.1, 1.0, 30.0, 180.0_f64] {
                // Midpoints in the logarithm of the angle.
                let (from, to) = (1e-7_f64.ln(), to_deg.to_radians().ln());
                let steps = 200_000;
                let sum: f64 = (0..steps)
                    .map(|i| (from + (to - from) * (f64::from(i) + 0.5) / f64::from(steps)).exp())
                    .map(|t| TAU * t.sin() * kernel.per_sr(t) * t * (to - from) / f64::from(steps))
                    .sum();
                let share = kernel.share_within(to_deg.to_radians());
                assert!((sum - share).abs() < 1e-6, "{inner_deg} within {to_deg}: {sum} {share}");
            }
            assert!((kernel.share_within(PI) - 1.0).abs() < 1e-14);
        }
    }
}
