//! Twin of what the resolve pass adds of light that is of no single star.

use glam::DVec3;

use crate::{
    catalogue::diffuse::{DiffuseSky, EXPONENTS_AT_REST},
    relativity::{aberrated_cos, gamma},
    scene::surroundings::LocalSky,
};

/// Luminance towards a direction as an observer of a velocity (in units of the speed of light, world axes) sees it, linear Rec. 709, cd/m^2: through the air of a place, where there is some.
pub fn luminance_cd_m2(sky: &DiffuseSky, seen: DVec3, velocity_c: DVec3, local: Option<&LocalSky>) -> [f64; 3] {
    let seen = seen.normalize();
    let beta = velocity_c.length();
    let mut towards = local.map_or(seen, |local| local.arriving(seen));
    let mut shifted = [1.0; 3];
    if beta > 0.0 {
        let along = velocity_c / beta;
        let across = (seen - along * seen.dot(along)).normalize_or_zero();
        // The sky moves the other way for the eye: back to its own axes.
        let cosine = aberrated_cos(-beta, seen.dot(along));
        towards = along * cosine + across * (1.0 - cosine * cosine).max(0.0).sqrt();
        let doppler = gamma(beta) * (1.0 + beta * cosine);
        shifted = EXPONENTS_AT_REST.map(|x| x.exp_m1() / (x / doppler).exp_m1());
    }
    let luminance = sky.luminance_cd_m2(towards);
    let through = local.map_or([1.0; 3], |local| local.transmission(seen));
    [0, 1, 2].map(|c| luminance[c] * shifted[c] * through[c])
}
