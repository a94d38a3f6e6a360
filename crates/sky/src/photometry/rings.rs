//! The rings of Saturn: four zones of particles that scatter light once.
//!
//! A zone has an optical depth and an albedo. Light that arrives at the cosine mu0 and leaves at mu is reflected by
//! mu0 / (4 (mu + mu0)) (1 - exp(-t (1/mu + 1/mu0))) (Chandrasekhar 1960); the share 1 - exp(-t/mu) of the light from
//! behind is hidden. Radii and depths: J. N. Cuzzi et al., "Saturn's rings", in *Saturn*, 1984, rounded; the relative
//! brightness of the zones is rounded too. Their total brightness follows from the measured magnitude of Saturn with
//! and without rings ([`super::phase_curve`]).

use std::f64::consts::PI;

/// A zone of the rings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zone {
    /// Outer radius, where the next zone begins, in Saturn's equatorial radii.
    pub outer: f64,
    /// Optical depth at normal incidence.
    pub depth: f64,
    /// Albedo, relative to the other zones.
    pub albedo: f64,
}

/// Inner radius of the innermost zone, in Saturn's equatorial radii.
pub const INNER: f64 = 1.239;
/// C, B, Cassini division, A.
pub const ZONES: [Zone; 4] = [
    Zone { outer: 1.526, depth: 0.10, albedo: 0.25 },
    Zone { outer: 1.950, depth: 1.80, albedo: 0.85 },
    Zone { outer: 2.030, depth: 0.12, albedo: 0.40 },
    Zone { outer: 2.269, depth: 0.60, albedo: 0.65 },
];
/// Outer radius of the outermost zone.
pub const OUTER: f64 = ZONES[3].outer;
/// Below these cosines the rings are invisible.
const LEAST_COSINE: f64 = 1e-3;

impl Zone {
    /// Luminance of the zone relative to that of a white surface that faces both the Sun and the eye; times 1 / pi, it
    /// is the share of the light that is reflected per sr.
    pub fn reflected(&self, mu_eye: f64, mu_sun: f64) -> f64 {
        self.albedo * mu_sun / (4.0 * (mu_eye + mu_sun)) * -(-self.depth * (1.0 / mu_eye + 1.0 / mu_sun)).exp_m1()
    }

    /// Share of the light from behind that the zone hides.
    pub fn hidden(&self, mu_eye: f64) -> f64 {
        -(-self.depth / mu_eye).exp_m1()
    }
}

/// Illuminance at an eye from rings whose luminance is [`Zone::reflected`]; the luminance for a given illuminance is
/// obtained by dividing by it. `radius_over_distance` is Saturn's equatorial radius divided by the distance of the eye.
/// `None` if the rings are seen or lit edge-on.
pub fn illuminance_of_unit(mu_eye: f64, mu_sun: f64, radius_over_distance: f64) -> Option<f64> {
    if mu_eye < LEAST_COSINE || mu_sun < LEAST_COSINE {
        return None;
    }
    let inner = std::iter::once(INNER).chain(ZONES.iter().map(|zone| zone.outer));
    let areas = ZONES
        .iter()
        .zip(inner)
        .map(|(zone, inner)| PI * (zone.outer * zone.outer - inner * inner) * zone.reflected(mu_eye, mu_sun));
    Some(mu_eye * radius_over_distance * radius_over_distance * areas.sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thick_rings_reflect_half_the_albedo_and_are_opaque() {
        let deep = Zone { outer: 2.0, depth: 50.0, albedo: 0.6 };
        assert!((deep.reflected(0.5, 0.5) - 0.6 / 8.0).abs() < 1e-12 && (deep.hidden(0.5) - 1.0).abs() < 1e-12);
        let thin = Zone { depth: 1e-6, ..deep };
        assert!((thin.reflected(0.5, 0.25) / (0.6 * 1e-6 / 4.0 / 0.5) - 1.0).abs() < 1e-4);
        assert!((thin.hidden(0.5) / 2e-6 - 1.0).abs() < 1e-5);
    }

    #[test]
    fn the_b_ring_is_brightest_and_edge_on_rings_are_dark() {
        let [c, b, division, a] = ZONES.map(|zone| zone.reflected(0.4, 0.4));
        assert!(b > a && a > division && a > c, "{c} {b} {division} {a}");
        assert_eq!(illuminance_of_unit(0.0, 0.3, 1e-4), None);
        let near = illuminance_of_unit(0.4, 0.4, 2e-4).unwrap();
        assert!((near / illuminance_of_unit(0.4, 0.4, 1e-4).unwrap() - 4.0).abs() < 1e-12);
    }
}
