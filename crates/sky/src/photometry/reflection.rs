//! Reflection of surfaces: two laws, scaled by the geometric albedo p, and the light of spheres that obey them.
//!
//! A surface with the illuminance E (measured perpendicular to the light's direction) at an angle of incidence i has,
//! at an angle of emission e, the luminance L = p E / pi * f(cos i, cos e):
//!
//! - Lambert: f = 1.5 cos i,
//! - Lommel-Seeliger: f = 2 cos i / (cos i + cos e).
//!
//! Both are scaled so that a sphere at full phase gives p E (R / D)^2, by the definition of p: over its disc the mean of
//! cos i is 2/3, and cos i / (cos i + cos e) is 1/2. Away from full phase the light falls by the phase function, in
//! closed form for both (Lester, McCall and Tatum 1979, "Theory of planetary photometry", JRASC 73, 233).
//!
//! Units: rad, m, lx, cd/m^2.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Reflection law of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReflectionLaw {
    /// Lambertian: L = (3 p / 2) E cos(i) / pi.
    Lambert,
    /// Lommel-Seeliger, single scattering in a dark regolith: L = 2 p E / pi * cos(i) / (cos(i) + cos(e)); no limb
    /// darkening at full phase.
    #[default]
    LommelSeeliger,
}

named!(ReflectionLaw {
    Lambert = "lambert",
    LommelSeeliger = "lommel_seeliger",
});

impl ReflectionLaw {
    /// The factor f in L = p E / pi * f, for the cosines of the angles of incidence and of emission. 0 if the light
    /// or the eye is below the horizon.
    pub fn luminance_factor(self, cos_i: f64, cos_e: f64) -> f64 {
        if cos_i <= 0.0 || cos_e < 0.0 {
            return 0.0;
        }
        match self {
            Self::Lambert => 1.5 * cos_i,
            Self::LommelSeeliger => 2.0 * cos_i / (cos_i + cos_e),
        }
    }

    /// Light of a sphere at a phase angle (between the directions to the light and to the eye, both distant), rad, 0
    /// to pi, relative to full phase.
    pub fn phase_function(self, phase_rad: f64) -> f64 {
        let from_new_rad = (PI - phase_rad).clamp(0.0, PI);
        match self {
            Self::Lambert => lambert_phase(from_new_rad),
            Self::LommelSeeliger => lommel_seeliger_phase(from_new_rad),
        }
    }
}

/// (sin a + (pi - a) cos a) / pi, from d = pi - a.
fn lambert_phase(d: f64) -> f64 {
    if d < 0.01 {
        // Both terms are nearly d here; their difference is of third order.
        return d.powi(3) / PI * (1.0 / 3.0 - d * d / 30.0);
    }
    (d.sin() - d * d.cos()) / PI
}

/// 1 - sin(a / 2) tan(a / 2) ln(cot(a / 4)), from d = pi - a. With x = d / 2 this is 1 - cos^2 x / sin x * 2
/// artanh(tan(x / 2)).
fn lommel_seeliger_phase(d: f64) -> f64 {
    let x = d / 2.0;
    if x < 3e-3 {
        return x * x * (2.0 / 3.0 - 4.0 / 45.0 * x * x);
    }
    let half_tangent = (x / 2.0).tan();
    if half_tangent >= 1.0 {
        // At full phase the logarithm diverges and its factor vanishes faster.
        return 1.0;
    }
    1.0 - x.cos().powi(2) / x.sin() * 2.0 * half_tangent.atanh()
}

/// Illuminance from a sphere at a distant eye, lx: p E (R / D)^2 times the phase function. `illuminance_lx` is the
/// illuminance on the sphere.
pub fn sphere_illuminance_lx(
    law: ReflectionLaw,
    geometric_albedo: f64,
    illuminance_lx: f64,
    radius_m: f64,
    distance_m: f64,
    phase_rad: f64,
) -> f64 {
    geometric_albedo * illuminance_lx * (radius_m / distance_m).powi(2) * law.phase_function(phase_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light of a unit sphere at a phase angle from the luminance factor alone: the integral of f cos e over the part
    /// of the sphere that is visible and lit, divided by pi, in luminance longitude and latitude (midpoint rule; the
    /// eye at longitude 0, the light at the phase angle).
    fn phase_by_quadrature(law: ReflectionLaw, phase_rad: f64, factor: f64) -> f64 {
        const N: usize = 1000;
        let [from, to] = [phase_rad - PI / 2.0, PI / 2.0];
        let mut sum = 0.0;
        for i in 0..N {
            // Nodes are denser at both ends, where the integrand of Lommel-Seeliger is steep.
            let t = (i as f64 + 0.5) / N as f64;
            let longitude = from + (to - from) * (3.0 - 2.0 * t) * t * t;
            let step = (to - from) * 6.0 * t * (1.0 - t) / N as f64;
            for j in 0..N {
                let latitude = ((j as f64 + 0.5) / N as f64 - 0.5) * PI;
                let cos_e = latitude.cos() * longitude.cos();
                let cos_i = latitude.cos() * (longitude - phase_rad).cos();
                let area = latitude.cos() * step * PI / N as f64;
                sum += factor * law.luminance_factor(cos_i, cos_e) * cos_e * area;
            }
        }
        sum / PI
    }

    #[test]
    fn closed_phase_functions_equal_the_integrals_of_the_laws() {
        for law in ReflectionLaw::ALL {
            for phase_deg in [0.0, 1.0, 20.0, 60.0, 90.0, 120.0, 150.0, 170.0] {
                let phase_rad = f64::to_radians(phase_deg);
                let (closed, summed) = (law.phase_function(phase_rad), phase_by_quadrature(law, phase_rad, 1.0));
                assert!((closed - summed).abs() < 2e-5 * closed.max(1e-2), "{law:?} {phase_deg}: {closed} {summed}");
                // A law that is 1 % brighter must fail.
                let wrong = phase_by_quadrature(law, phase_rad, 1.01);
                assert!((closed - wrong).abs() > 5e-3 * closed, "{law:?} {phase_deg}: {closed} {wrong}");
            }
        }
        let laws = ReflectionLaw::ALL.map(|law| phase_by_quadrature(law, 2.0, 1.0));
        assert!((laws[0] - laws[1]).abs() > 0.02, "the laws differ: {laws:?}");
    }

    #[test]
    fn limits_at_full_and_new_phase_are_finite_and_smooth() {
        for law in ReflectionLaw::ALL {
            assert_eq!(law.phase_function(0.0), 1.0);
            assert_eq!(law.phase_function(PI), 0.0);
            assert!((law.phase_function(1e-9) - 1.0).abs() < 1e-12);
            let mut last = 1.0;
            for i in 1..100_000 {
                let value = law.phase_function(PI * f64::from(i) / 1e5);
                assert!(value < last && value > 0.0, "{law:?} {i}: {last} {value}");
                last = value;
            }
        }
        // On both sides of the limit of the series.
        for (law, limit) in [(ReflectionLaw::Lambert, 0.01), (ReflectionLaw::LommelSeeliger, 6e-3)] {
            let [below, above] = [-1e-9, 1e-9].map(|step| law.phase_function(PI - limit - step));
            assert!((below / above - 1.0).abs() < 2e-6, "{law:?}: {below} {above}");
        }
        assert!((ReflectionLaw::Lambert.phase_function(PI / 2.0) - 1.0 / PI).abs() < 1e-15);
        // Both decrease with the power of their series.
        let tail = |law: ReflectionLaw, d: f64| law.phase_function(PI - d);
        assert!((tail(ReflectionLaw::Lambert, 1e-4) / (1e-12 / (3.0 * PI)) - 1.0).abs() < 1e-6);
        assert!((tail(ReflectionLaw::LommelSeeliger, 1e-4) / (1e-8 / 6.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn surfaces_that_are_unlit_or_face_away_are_dark() {
        for law in ReflectionLaw::ALL {
            assert_eq!(law.luminance_factor(-0.1, 0.5), 0.0);
            assert_eq!(law.luminance_factor(0.5, -0.1), 0.0);
            assert_eq!(law.luminance_factor(0.0, 0.0), 0.0);
            assert_eq!(ReflectionLaw::from_name(law.name()), Some(law));
        }
        assert_eq!(ReflectionLaw::LommelSeeliger.luminance_factor(0.3, 0.3), 1.0);
        assert_eq!(ReflectionLaw::from_name("phong"), None);
    }

    #[test]
    fn the_full_moon_has_its_published_magnitude() {
        // Albedo 0.12, 1737 km at 384,400 km, in sunlight of magnitude -26.74: V = -12.7 (slightly fainter, because
        // the opposition surge is left out).
        let sun_lx = crate::units::illuminance_lx_from_magnitude(-26.74);
        let moon_lx = sphere_illuminance_lx(ReflectionLaw::LommelSeeliger, 0.12, sun_lx, 1.7374e6, 3.844e8, 0.0);
        let magnitude = crate::units::magnitude_from_illuminance_lx(moon_lx);
        assert!((magnitude + 12.7).abs() < 0.05, "{magnitude}");
    }
}
