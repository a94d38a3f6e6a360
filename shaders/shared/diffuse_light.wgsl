// Diffuse light from the whole sky (crates/sky/src/catalogue/diffuse.rs) in a direction, as a moving observer sees it. The
// importer binds `diffuse_texels`. The f64 twin is crates/render/src/reference/diffuse/mod.rs.

#import constants/diffuse
#import shared/sky_place
#import shared/sky_texel
#import structs/DiffuseLight

// Whether the observer moves.
override MOVES: bool = false;

// Returns the luminance in the apparent unit direction `seen`, world axes, cd/m^2. `at_rest`: the same direction in the pictures, for an observer at
// rest.
fn diffuse_luminance(light: DiffuseLight, seen: vec3<f32>, at_rest: PictureDirection) -> vec3<f32> {
    return luminance_beyond(light, seen, at_rest) + zodiacal_luminance(light, seen);
}

// Returns the part that comes from beyond the Solar System.
fn luminance_beyond(light: DiffuseLight, seen: vec3<f32>, at_rest: PictureDirection) -> vec3<f32> {
    if light.map.side == 0u {
        return vec3(0.0);
    }
    var direction = at_rest;
    var shifted = vec3(1.0);
    if MOVES {
        // Transform the direction back to the frame at rest, which has the opposite velocity.
        let cosine = dot(seen, light.velocity);
        let gamma = inverseSqrt(1.0 - light.beta * light.beta);
        let behind = gamma * (1.0 - light.beta * cosine);
        let along = (cosine - light.beta) * gamma / behind;
        direction = picture_direction(normalize((seen - light.velocity * cosine) / behind + light.velocity * along));
        // The spectrum of a black body stays that of a black body. Its temperature is multiplied by the Doppler factor 1 / behind.
        shifted = (exp(DIFFUSE_EXPONENTS) - 1.0) / (exp(min(DIFFUSE_EXPONENTS * behind, vec3(87.0))) - 1.0);
    }
    return shifted * map_luminance(light.map, 0u, direction);
}

// Returns the zodiacal light, which is that seen from the Earth. So it is neither aberrated nor shifted.
fn zodiacal_luminance(light: DiffuseLight, seen: vec3<f32>) -> vec3<f32> {
    if light.zodiacal.side == 0u {
        return vec3(0.0);
    }
    let towards = vec3(dot(light.zodiacal_x, seen), dot(light.zodiacal_y, seen), dot(light.zodiacal_z, seen));
    return map_luminance(light.zodiacal, light.first_zodiacal, picture_direction(towards));
}

// Returns the luminance of a map in a direction, interpolated between four texels. `first`: index of its first texel.
fn map_luminance(map: SkyMap, first: u32, direction: PictureDirection) -> vec3<f32> {
    let place = sky_place(map, direction);
    let start = first + place.first;
    let upper = mix(light_of_texel(diffuse_texels[start]), light_of_texel(diffuse_texels[start + 1u]), place.share.x);
    let below = start + map.side;
    let lower = mix(light_of_texel(diffuse_texels[below]), light_of_texel(diffuse_texels[below + 1u]), place.share.x);
    return map.unit_cd_m2 * mix(upper, lower, place.share.y);
}
