//! Splitting of a kernel at an angle into a smooth part and one that ends there.
//!
//! A glare kernel is steep at its source and smooth far from it. The smooth part can be computed on a coarse grid;
//! the rest reaches only to the angle of the split (the multilevel summation of R. D. Skeel, I. Tezcan and D. J.
//! Hardy, "Multiple grid methods for classical molecular dynamics", 2002, on the sphere). Angles are represented by
//! the square of their chord, s = 4 sin^2(angle / 2): f32 computes it from two unit vectors without cancellation, and
//! the solid angle within s is exactly pi s. Units: radians, sr.

use std::f64::consts::PI;

use super::GlareKernel;

/// Squared chord of an angle from 0 to pi.
pub fn chord_squared(angle_rad: f64) -> f64 {
    4.0 * (0.5 * angle_rad).sin().powi(2)
}

/// Angle of a squared chord from 0 to 4, rad.
pub fn angle_of_chord_squared(squared: f64) -> f64 {
    2.0 * (0.5 * squared.max(0.0).sqrt()).min(1.0).asin()
}

/// A quadratic polynomial in u = s / s_a that replaces a kernel within s_a. At s_a its value, slope and curvature are
/// those of the power of s that approximates the kernel there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftCore {
    /// s_a.
    pub squared: f64,
    /// Coefficients of 1, u and u^2, 1/sr.
    pub coefficients: [f64; 3],
}

impl SoftCore {
    /// The polynomial that replaces a kernel within an angle.
    pub fn new(kernel: &dyn GlareKernel, angle_rad: f64) -> Self {
        // Distance on either side at which noise, rows and the end of a table do not distort the slope.
        const SIDE: f64 = 1.2;
        // Limit of the slope: steeper than the glare of any eye. It also limits the slope at the end of a table.
        const STEEPEST: f64 = 2.5;
        let squared = chord_squared(angle_rad);
        let density = |u: f64| kernel.per_sr(angle_of_chord_squared((u * squared).min(4.0)));
        let value = density(1.0);
        let power = (density(1.0 / SIDE) / density(SIDE)).ln() / (2.0 * SIDE.ln());
        // Without light the power is undefined.
        let power = if power.is_nan() { 0.0 } else { power.clamp(0.0, STEEPEST) };
        let half_curvature = value * power * (power + 1.0) / 2.0;
        let slope = -value * power;
        Self { squared, coefficients: [value - slope + half_curvature, slope - 2.0 * half_curvature, half_curvature] }
    }

    /// Value at a squared chord within s_a, 1/sr.
    pub fn per_sr(&self, squared: f64) -> f64 {
        let u = squared / self.squared;
        self.coefficients[0] + u * (self.coefficients[1] + u * self.coefficients[2])
    }

    /// Integral within s_a.
    pub fn share(&self) -> f64 {
        let [c0, c1, c2] = self.coefficients;
        PI * self.squared * (c0 + c1 / 2.0 + c2 / 3.0)
    }
}

/// Fade-out of a source that is drawn individually, over u = s / s_R from 0 to 1. It ends late, so that little of the
/// source's light is left to the part that is drawn for many sources together.
pub fn fade(u: f64) -> f64 {
    1.0 - u * u * (3.0 - 2.0 * u)
}

/// Share of a bump (1 - s / s_b)^2 of height 1 within its radius, sr.
pub fn bump_share(squared: f64) -> f64 {
    PI * squared / 3.0
}

/// The kernel as displayed in pixels: within a pixel or two of its source it is a smooth function with the same
/// light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShownCore {
    /// The polynomial applies within this squared chord, the kernel beyond it.
    pub core: SoftCore,
}

impl ShownCore {
    /// The kernel for pixels that do not resolve details within `angle_rad`.
    pub fn new(kernel: &dyn GlareKernel, angle_rad: f64) -> Self {
        let mut core = SoftCore::new(kernel, angle_rad);
        // The light that the polynomial lacks is added as a bump, which is a quadratic polynomial too.
        let left = kernel.share_within(angle_rad) - core.share();
        let height = left / bump_share(core.squared);
        for (coefficient, of_bump) in core.coefficients.iter_mut().zip([1.0, -2.0, 1.0]) {
            *coefficient += height * of_bump;
        }
        Self { core }
    }

    /// Value at a squared chord, 1/sr.
    pub fn per_sr(&self, kernel: &dyn GlareKernel, squared: f64) -> f64 {
        if squared < self.core.squared {
            self.core.per_sr(squared)
        } else {
            kernel.per_sr(angle_of_chord_squared(squared))
        }
    }

    /// Integral of the displayed kernel times [`fade`] within `squared`.
    pub fn faded_share(&self, kernel: &dyn GlareKernel, squared: f64) -> f64 {
        // Midpoints in the logarithm of s beyond the core and in s within it: the integrands are smooth there.
        const STEPS: u32 = 256;
        let window = |s: f64| fade(s / squared);
        let core_end = self.core.squared.min(squared);
        let width = core_end / f64::from(STEPS);
        let midpoint = |i: u32| f64::from(i) + 0.5;
        let within: f64 =
            (0..STEPS).map(|i| midpoint(i) * width).map(|s| self.core.per_sr(s) * window(s)).sum::<f64>() * width;
        let e_folds = (squared / core_end).ln() / f64::from(STEPS);
        let beyond: f64 = (0..STEPS)
            .map(|i| core_end * (midpoint(i) * e_folds).exp())
            .map(|s| kernel.per_sr(angle_of_chord_squared(s)) * window(s) * s * e_folds)
            .sum();
        PI * (within + beyond)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::glare::InverseSquareKernel;

    #[test]
    fn the_soft_core_joins_the_kernel_and_its_share_is_its_integral() {
        let kernel = InverseSquareKernel::new(0.1_f64.to_radians());
        for angle in [0.01, 0.1, 0.5, 1.5] {
            let soft = SoftCore::new(&kernel, angle);
            for u in [0.99, 0.999, 1.0] {
                let exact = kernel.per_sr(angle_of_chord_squared(u * soft.squared));
                assert!((soft.per_sr(u * soft.squared) / exact - 1.0).abs() < 2e-4, "{angle} {u}");
            }
            let steps = 10_000;
            let sum: f64 =
                (0..steps).map(|i| soft.per_sr(soft.squared * (f64::from(i) + 0.5) / f64::from(steps))).sum::<f64>()
                    * PI
                    * soft.squared
                    / f64::from(steps);
            assert!((sum / soft.share() - 1.0).abs() < 1e-6);
            assert!(soft.share() < kernel.share_within(angle), "light remains for the sources");
        }
    }

    #[test]
    fn the_displayed_kernel_has_the_light_of_the_kernel() {
        let kernel = InverseSquareKernel::new(0.1_f64.to_radians());
        for pixel_deg in [0.02_f64, 0.3, 2.0] {
            let displayed = ShownCore::new(&kernel, pixel_deg.to_radians());
            assert!((displayed.core.share() / kernel.share_within(pixel_deg.to_radians()) - 1.0).abs() < 1e-12);
            // With a window this wide, which is practically 1 where there is light, the share is that of the kernel
            // without its tail.
            let window = chord_squared(3.0_f64.to_radians().max(2.0 * pixel_deg.to_radians()));
            let steps = 2_000_000;
            let sum: f64 = (0..steps)
                .map(|i| window * (f64::from(i) + 0.5) / f64::from(steps))
                .map(|s| displayed.per_sr(&kernel, s) * fade(s / window))
                .sum::<f64>()
                * PI
                * window
                / f64::from(steps);
            let share = displayed.faded_share(&kernel, window);
            assert!((sum / share - 1.0).abs() < 1e-3, "{pixel_deg}: {sum} {share}");
        }
    }

    /// A kernel defined by a function, with an arbitrary integral.
    struct FunctionKernel(fn(f64) -> f64);

    impl GlareKernel for FunctionKernel {
        fn per_sr(&self, angle_rad: f64) -> f64 {
            (self.0)(angle_rad)
        }

        fn share_within(&self, _: f64) -> f64 {
            1.0
        }

        fn inner_rad(&self) -> f64 {
            0.001
        }
    }

    #[test]
    fn noise_and_the_end_of_a_table_do_not_distort_the_core() {
        let noisy = FunctionKernel(|angle| (1.0 + 0.01 * (angle * 5e3).sin()) / (angle * angle));
        let ends = FunctionKernel(|angle| if angle < 0.126 { 1.0 / (angle * angle) } else { 0.0 });
        let beyond = FunctionKernel(|angle| if angle < 0.12 { 1.0 } else { 0.0 });
        for angle in [0.125, 0.25, 0.5] {
            let ratio = SoftCore::new(&noisy, angle).coefficients[0] / noisy.per_sr(angle);
            assert!((2.6..3.4).contains(&ratio), "{angle}: {ratio}");
        }
        let ratio = SoftCore::new(&ends, 0.125).coefficients[0] / ends.per_sr(0.125);
        assert!((3.0..9.0).contains(&ratio), "{ratio}");
        assert_eq!(SoftCore::new(&beyond, 0.125).coefficients, [0.0; 3]);
    }

    #[test]
    fn fade_is_flat_at_both_ends_and_keeps_the_light_near_the_source() {
        assert_eq!((fade(0.0), fade(0.5), fade(1.0)), (1.0, 0.5, 0.0));
        // Both ends are flat.
        assert!(1.0 - fade(0.01) < 3.1e-4 && fade(0.99) < 3.1e-4);
    }

    #[test]
    fn chords_and_angles_are_inverse() {
        for angle in [0.0, 1e-8, 0.1, 1.0, 3.0, PI] {
            assert!((angle_of_chord_squared(chord_squared(angle)) - angle).abs() < 1e-7, "{angle}");
        }
    }
}
