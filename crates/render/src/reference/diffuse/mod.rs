//! Twin of the diffuse light that the resolve pass adds.

use glam::DVec3;

use crate::{
    catalogue::{
        diffuse::{DiffuseSky, EXPONENTS_AT_REST},
        zodiacal_light::ZodiacalLight,
    },
    relativity::{aberrated_cos, gamma},
    scene::surroundings::LocalSky,
};

/// Returns the luminance in a direction, linear Rec. 709, cd/m^2, for an observer with a velocity in units of the speed of light, world axes. If
/// there is local air, the light has passed through it.
pub fn luminance_cd_m2(sky: &DiffuseSky, seen: DVec3, velocity_c: DVec3, local: Option<&LocalSky>) -> [f64; 3] {
    let seen = seen.normalize();
    let beta = velocity_c.length();
    let mut towards = local.map_or(seen, |local| local.arriving(seen));
    let mut shifted = [1.0; 3];
    if beta > 0.0 {
        let along = velocity_c / beta;
        let across = (seen - along * seen.dot(along)).normalize_or_zero();
        // The inverse aberration: transform the direction back to the rest frame of the sky.
        let cosine = aberrated_cos(-beta, seen.dot(along));
        towards = along * cosine + across * (1.0 - cosine * cosine).max(0.0).sqrt();
        let doppler = gamma(beta) * (1.0 + beta * cosine);
        shifted = EXPONENTS_AT_REST.map(|x| x.exp_m1() / (x / doppler).exp_m1());
    }
    let luminance = sky.luminance_cd_m2(towards);
    let through = local.map_or([1.0; 3], |local| local.transmission(seen));
    [0, 1, 2].map(|c| luminance[c] * shifted[c] * through[c])
}

/// Returns the luminance of the zodiacal light in a direction, world axes, linear Rec. 709, cd/m^2. If there is local air, the light has passed
/// through it.
pub fn zodiacal_cd_m2(light: &ZodiacalLight, seen: DVec3, local: Option<&LocalSky>) -> [f64; 3] {
    let seen = seen.normalize();
    let luminance = light.luminance_cd_m2(local.map_or(seen, |local| local.arriving(seen)));
    let through = local.map_or([1.0; 3], |local| local.transmission(seen));
    [0, 1, 2].map(|c| luminance[c] * through[c])
}
