//! Distances of stars whose parallax is uncertain.
//!
//! The inverse of a parallax is a distance only if the error is small: if the parallax is five times the error, it is biased by 4 %. If the parallax
//! is smaller, the distance is the mode of the posterior with an exponentially decreasing density of stars in space, of scale length [`SCALE_PC`]
//! (Bailer-Jones 2015, PASP 127, 994, section 7). Without a parallax, the mode is twice the scale length.

use crate::catalogue::reader::MeasuredParallax;

/// Scale length of the density of stars, pc.
pub const SCALE_PC: f64 = 1350.0;

/// Smallest ratio of a parallax to its error for which the distance is the inverse of the parallax.
pub const LEAST_RATIO: f64 = 5.0;

/// Returns the distance of a star from the prior, pc; `None` if its parallax is good enough to be inverted.
pub fn prior_distance_pc(measured: MeasuredParallax) -> Option<f64> {
    match measured {
        MeasuredParallax { parallax_mas: Some(parallax), error_mas: Some(error) } => {
            (parallax < LEAST_RATIO * error).then(|| mode_pc(1e-3 * parallax, 1e-3 * error))
        }
        _ => Some(2.0 * SCALE_PC),
    }
}

/// The mode: the smallest root of r^3 / L - 2 r^2 + (parallax r - 1) / error^2, with parallax and error in arcsec.
fn mode_pc(parallax: f64, error: f64) -> f64 {
    let weight = error.powi(-2);
    let value = |r: f64| r * r * r / SCALE_PC - 2.0 * r * r + weight * (parallax * r - 1.0);
    let slope = |r: f64| 3.0 * r * r / SCALE_PC - 4.0 * r + weight * parallax;
    // From 0 to the inflection point the function is concave: Newton's method approaches a root there from below.
    let inflection = 2.0 / 3.0 * SCALE_PC;
    let mut r = 0.0;
    for _ in 0..100 {
        if slope(r) <= 0.0 || r > inflection {
            break;
        }
        let step = value(r) / slope(r);
        r -= step;
        if step.abs() < 1e-9 * r {
            return r;
        }
    }
    // Beyond the inflection point it is convex: Newton's method approaches the largest root from above.
    let mut r = 3.0 * SCALE_PC + (SCALE_PC * weight).cbrt() + (SCALE_PC * weight * parallax.abs()).sqrt();
    for _ in 0..200 {
        let step = value(r) / slope(r);
        r -= step;
        if step.abs() < 1e-9 * r {
            break;
        }
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(parallax_mas: f64, error_mas: f64) -> MeasuredParallax {
        MeasuredParallax { parallax_mas: Some(parallax_mas), error_mas: Some(error_mas) }
    }

    #[test]
    fn good_parallaxes_are_inverted_and_others_give_the_mode_of_the_posterior() {
        assert_eq!(prior_distance_pc(measured(5.0, 1.0)), None);
        assert_eq!(prior_distance_pc(MeasuredParallax::default()), Some(2700.0));
        for (parallax, error) in
            [(4.9, 1.0), (0.5, 0.2), (0.0, 0.3), (-1.0, 0.5), (0.3, 3.0), (0.02, 0.03), (-5.0, 0.1)]
        {
            let found = prior_distance_pc(measured(parallax, error)).expect("below five times the error");
            let log_density = |r: f64| {
                let z = (1.0 / r - 1e-3 * parallax) / (1e-3 * error);
                2.0 * r.ln() - r / SCALE_PC - 0.5 * z * z
            };
            // No other distance nearby has a larger posterior.
            assert!(
                [0.99, 1.01].iter().all(|factor| log_density(found) > log_density(found * factor)),
                "{parallax} {error}: {found}"
            );
            assert!((10.0..40_000.0).contains(&found), "{parallax} {error}: {found}");
        }
        // A parallax without information gives the mode of the prior.
        let vague = prior_distance_pc(measured(1.0, 1e4)).expect("vague");
        assert!((vague / 2700.0 - 1.0).abs() < 1e-3, "{vague}");
    }
}
