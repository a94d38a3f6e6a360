// Lights the samples owned by an impostor. Colour: luminance in units of the target, alpha 1.

#import asteroids/impostors/footprint
#import shared/reflection

@group(2) @binding(4) var colour: texture_storage_2d<rgba16float, write>;

fn may_be_own(footprint: Footprint, sample_at: u32) -> bool {
    return is_own(sample_at, footprint.slot);
}

fn process_sample(footprint: Footprint, sample_at: u32, position: vec2<i32>, place: vec2<f32>) -> bool {
    let offset = place.x * footprint.square.right + place.y * footprint.square.up;
    let ray = normalize(footprint.centre + offset);
    let seen = appearance_at(footprint, ray, offset);
    let asteroid = footprint.asteroid;
    let normal = normalize(asteroid.view_from_shape * seen.normal);
    // Visible surfaces face the eye, even at the limb of a tile whose direction deviates slightly.
    let cos_e = max(dot(normal, -ray), 1e-3);
    let light = seen.albedo * reflected(asteroid.law, dot(normal, asteroid.sun), cos_e);
    textureStore(colour, position, vec4(asteroid.luminance * light, 1.0));
    return true;
}
