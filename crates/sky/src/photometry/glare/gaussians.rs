//! The sum of Gaussians of Schneegans, Kreskowski and Gerndt, "Smaller than Pixels: Rendering Millions of Stars in
//! Real-Time", equations 3 and 4: standard deviations 2^i degrees for i = -10 to 10, each with a peak of 1 / sigma^2.
//! Their sum is nearly c / theta^2 with c near 1 / ln 2: the deviation is at most 0.95 % from 0.2 to 90 degrees.
//!
//! The common factor 1 / sqrt(2 pi) of equation 3 is left out; the integral over the sphere is normalised to 1. An
//! inner angle removes the narrower Gaussians, so that the narrowest sigma is one to two times that angle (2^-10
//! degrees for smaller inner angles). The remaining plateau has the value of c / theta^2 at 1.04 times the narrowest
//! sigma.

use super::normalised::Shape;

/// Narrowest and widest Gaussian: powers of two, degrees.
const EXPONENTS: [i32; 2] = [-10, 10];

/// A sum of Gaussians; see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussians {
    /// Standard deviations, narrowest first, rad.
    sigmas_rad: Vec<f64>,
}

impl Gaussians {
    /// The Gaussians that are at least as wide as an angle (above 0 and at most pi), rad.
    pub fn new(inner_rad: f64) -> Self {
        let [first, last] = EXPONENTS;
        let sigmas = (first..=last).map(|i| 2.0_f64.powi(i).to_radians());
        Self { sigmas_rad: sigmas.filter(|sigma| *sigma >= inner_rad).collect() }
    }
}

impl Shape for Gaussians {
    fn relative(&self, angle_rad: f64) -> f64 {
        self.sigmas_rad.iter().map(|sigma| (-0.5 * (angle_rad / sigma).powi(2)).exp() / (sigma * sigma)).sum()
    }

    /// A twentieth of the narrowest standard deviation: there the sum is a thousandth below its peak.
    fn inner_rad(&self) -> f64 {
        self.sigmas_rad[0] / 20.0
    }

    fn kinks_rad(&self) -> Vec<f64> {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::glare::{GlareKernel, Normalised, normalised::tests::shares_are_integrals_of_the_density};

    /// The c for which a density is nearest to c / theta^2 from 0.2 to 90 degrees, and the largest relative
    /// deviation.
    fn nearest(density: impl Fn(f64) -> f64) -> (f64, f64) {
        let (least, most) = (0..=20_000)
            .map(|i| (0.2 * 450.0_f64.powf(f64::from(i) / 20_000.0)).to_radians())
            .map(|t| density(t) * t * t)
            .fold((f64::INFINITY, 0.0_f64), |(least, most), c| (least.min(c), most.max(c)));
        (0.5 * (least + most), (most - least) / (most + least))
    }

    #[test]
    fn the_sum_is_nearly_the_inverse_square() {
        let (c, deviation) = nearest(|t| Gaussians::new(1e-9).relative(t));
        assert!((deviation - 0.0095).abs() < 1e-4, "{deviation}");
        assert!((c * 2.0_f64.ln() - 1.0).abs() < 2e-3, "{c}");
        // With weights halved once more, as in the published pyramid, it is a different function.
        let narrower = |t: f64| {
            let gaussians = Gaussians::new(1e-9);
            let peak = |sigma: &f64| (-0.5 * (t / sigma).powi(2)).exp() * sigma.powi(-3);
            gaussians.sigmas_rad.iter().map(peak).sum::<f64>()
        };
        assert!(nearest(narrower).1 > 0.9);
    }

    #[test]
    fn the_inner_angle_is_where_the_plateau_meets_the_inverse_square() {
        for (inner_deg, narrowest_deg) in [(0.1, 0.125), (0.125, 0.125), (1e-5, 1.0 / 1024.0), (180.0, 256.0_f64)] {
            let gaussians = Gaussians::new(f64::to_radians(inner_deg));
            let sigma = narrowest_deg.to_radians();
            assert!((gaussians.sigmas_rad[0] / sigma - 1.0).abs() < 1e-12, "{inner_deg}");
            let lost = 1.0 - gaussians.relative(gaussians.inner_rad()) / gaussians.relative(0.0);
            assert!((0.0005..0.0015).contains(&lost), "{lost}");
        }
        let gaussians = Gaussians::new(0.1_f64.to_radians());
        let met = 1.0 / (2.0_f64.ln() * gaussians.relative(0.0)).sqrt() / gaussians.sigmas_rad[0];
        assert!((met - 1.04).abs() < 1e-3, "{met}");
    }

    #[test]
    fn the_integral_over_the_sphere_is_one() {
        let kernel = Normalised::new(Gaussians::new(0.1_f64.to_radians())).unwrap();
        shares_are_integrals_of_the_density(&kernel);
        // Half as much at 10 degrees as at 7.07.
        assert!((kernel.per_sr(0.1) / kernel.per_sr(0.1 / 2.0_f64.sqrt()) - 0.5).abs() < 0.01);
    }
}
