//! Light of an ellipsoid relative to that of a sphere: planets are flattened, and measurements refer to the light of the whole planet.
//!
//! In semi-axes the body is the unit sphere, and the visible and lit part is a lune. An element of it has the projected
//! area det(D) (D^-1 e . n), with the semi-axes D, the direction e to the eye and the point n of the unit sphere.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::{Body, suns::mean_radius_m};

/// Nodes across and along the lune.
const NODES: usize = 24;
/// Sum of the weights of the nodes before normalisation: the integral of 6 t (1 - t) from 0 to 1 is 1.
const fn crowded(index: usize) -> (f64, f64) {
    // Nodes are denser at both ends, where the reflection laws are steep.
    let t = (index as f64 + 0.5) / NODES as f64;
    ((3.0 - 2.0 * t) * t * t, 6.0 * t * (1.0 - t) / NODES as f64)
}

/// Light that a distant eye gets from a body in the light of a distant sun, relative to a sphere with the mean
/// projected area of the body; 1 for a sphere. Unit vectors, world axes. The spin is ignored, because it does not
/// change bodies with round equators.
pub(super) fn light_over_sphere(body: &Body, to_eye: DVec3, to_sun: DVec3) -> f64 {
    let radii_m = body.radii_m;
    let law = body.surface.law;
    let phase_rad = to_eye.cross(to_sun).length().atan2(to_eye.dot(to_sun));
    let of_sphere = law.phase_function(phase_rad);
    if radii_m == DVec3::splat(radii_m.x) || of_sphere <= 0.0 {
        return 1.0;
    }
    let shape = radii_m / mean_radius_m(radii_m);
    let to_body = body.orientation.conjugate();
    let (eye, sun) = (to_body * to_eye / shape, to_body * to_sun / shape);
    let first = eye.normalize();
    let across = sun - first * sun.dot(first);
    // In opposition, only rounding errors are left of this vector, in any direction.
    let is_known = across.length() > 1e-9 * sun.length();
    let second = if is_known { across.normalize() } else { first.any_orthonormal_vector() };
    let third = first.cross(second);
    let scaled_phase_rad = across.length().atan2(sun.dot(first));
    let from_rad = scaled_phase_rad - FRAC_PI_2;
    let mut sum = 0.0;
    for i in 0..NODES {
        let (part, weight) = crowded(i);
        let (sin, cos) = (from_rad + (FRAC_PI_2 - from_rad) * part).sin_cos();
        for j in 0..NODES {
            let (height, share) = crowded(j);
            let (up, level) = ((height - 0.5) * PI).sin_cos();
            let unit = (first * cos + second * sin) * level + third * up;
            let normal = (unit / shape).length();
            let factor = law.luminance_factor(sun.dot(unit) / normal, eye.dot(unit) / normal);
            sum += factor * eye.dot(unit) * level * weight * share;
        }
    }
    sum * (FRAC_PI_2 - from_rad) * shape.element_product() / of_sphere
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::bodies::{ReflectionLaw, SolarBody};

    #[test]
    fn a_sphere_is_the_limit_and_a_full_disc_has_its_area() {
        let mut body = Body::preset(SolarBody::Saturn, "body", DVec3::ZERO);
        for law in ReflectionLaw::ALL {
            body.surface.law = law;
            body.radii_m = DVec3::new(1.0, 1.0, 1.0 - 1e-9);
            for phase_deg in [0.0_f64, 30.0, 90.0, 150.0, 179.0] {
                let (sin, cos) = phase_deg.to_radians().sin_cos();
                let found = light_over_sphere(&body, DVec3::X, DVec3::new(cos, sin, 0.0));
                assert!((found - 1.0).abs() < 5e-3, "{law:?} {phase_deg}: {found}");
            }
        }
        // Without limb darkening: the projected areas of a spheroid from its pole and its equator.
        body.surface.law = ReflectionLaw::LommelSeeliger;
        body.radii_m = DVec3::new(1.0, 1.0, 0.8);
        let mean = mean_radius_m(body.radii_m).powi(2);
        for (towards, area) in [(DVec3::Z, 1.0), (DVec3::X, 0.8)] {
            let found = light_over_sphere(&body, body.orientation * towards, body.orientation * towards);
            assert!((found / (area / mean) - 1.0).abs() < 2e-3, "{towards}: {found}");
        }
    }
}
