// Light of no single star from all over the sky (src/catalogue/diffuse.rs), read towards a direction: through the air where there is some, and as a moving observer sees it. The importer binds
// `diffuse_texels`. The f64 twin is src/reference/diffuse/mod.rs.

#import constants/diffuse
#import shared/air_mass
#import shared/sky_place
#import shared/sky_texel

struct DiffuseLight {
    map: SkyMap,
    // Unit vector to the zenith, world axes.
    zenith: vec3<f32>,
    // 1: there is air.
    has_air: u32,
    // Power of two by which light becomes less for each air mass.
    extinction: vec3<f32>,
    unused_0: u32,
    // Unit vector of the observer's velocity, world axes.
    velocity: vec3<f32>,
    // Speed over that of light.
    beta: f32,
}

// Luminance towards a unit direction as it is seen, world axes, cd/m^2.
fn diffuse_luminance(light: DiffuseLight, seen: vec3<f32>) -> vec3<f32> {
    var towards = seen;
    var shifted = vec3(1.0);
    if light.beta > 0.0 {
        // Back to the axes at rest: the velocity is the opposite one.
        let cosine = dot(seen, light.velocity);
        let gamma = inverseSqrt(1.0 - light.beta * light.beta);
        let behind = gamma * (1.0 - light.beta * cosine);
        let along = (cosine - light.beta) * gamma / behind;
        towards = normalize((seen - light.velocity * cosine) / behind + light.velocity * along);
        // A black body stays one, of a temperature that the Doppler factor multiplies: its own is 1 / behind.
        shifted = (exp(DIFFUSE_EXPONENTS) - 1.0) / (exp(min(DIFFUSE_EXPONENTS * behind, vec3(87.0))) - 1.0);
    }
    let place = sky_place(light.map, towards);
    let start = place.first;
    let upper = mix(light_of_texel(diffuse_texels[start]), light_of_texel(diffuse_texels[start + 1u]), place.share.x);
    let below = start + light.map.side;
    let lower = mix(light_of_texel(diffuse_texels[below]), light_of_texel(diffuse_texels[below + 1u]), place.share.x);
    var luminance = light.map.unit_cd_m2 * shifted * mix(upper, lower, place.share.y);
    if light.has_air != 0u {
        luminance *= exp2(light.extinction * air_mass(dot(seen, light.zenith)));
    }
    return luminance;
}
