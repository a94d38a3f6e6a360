// Combines the levels of a glare pyramid at the resolution of the first level: their weighted sum. A lookup is a cubic
// B-spline made of four bilinear lookups (Sigg and Hadwiger 2005).

#import constants/workgroups
#import glare/pyramid/scale
#import structs/GlareCombineParameters

@group(0) @binding(0) var<uniform> parameters: GlareCombineParameters;
@group(0) @binding(1) var levels: texture_2d<f32>;
@group(0) @binding(2) var bilinear: sampler;
@group(0) @binding(3) var combined: texture_storage_2d<rgba16float, write>;

fn cubic_lookup(place: vec2<f32>, level: u32) -> vec3<f32> {
    let size = vec2<f32>(textureDimensions(levels, level));
    let texel = place * size - 0.5;
    let part = fract(texel);
    let rest = 1.0 - part;
    // Along each axis, the two outer ones of the four texels have the weights part^3 / 6 and rest^3 / 6. A bilinear lookup between two texels reads
    // both.
    let weight_0 = rest * rest * rest / 6.0;
    let weight_1 = (4.0 + part * part * (3.0 * part - 6.0)) / 6.0;
    let weight_3 = part * part * part / 6.0;
    let lower = weight_0 + weight_1;
    let upper = 1.0 - lower;
    let first = (floor(texel) - 0.5 + weight_1 / lower) / size;
    let second = (floor(texel) + 1.5 + weight_3 / upper) / size;
    let l = f32(level);
    return lower.y * (lower.x * textureSampleLevel(levels, bilinear, first, l).xyz
            + upper.x * textureSampleLevel(levels, bilinear, vec2(second.x, first.y), l).xyz)
        + upper.y * (lower.x * textureSampleLevel(levels, bilinear, vec2(first.x, second.y), l).xyz
            + upper.x * textureSampleLevel(levels, bilinear, second, l).xyz);
}

@compute @workgroup_size(PYRAMID_SIDE, PYRAMID_SIDE)
fn combine_levels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(combined);
    if any(id.xy >= size) {
        return;
    }
    let place = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(size);
    var sum = vec3(0.0);
    var weight = parameters.first_weight;
    for (var level = 0u; level < parameters.levels; level++) {
        sum += weight * cubic_lookup(place, level);
        weight *= parameters.ratio;
    }
    textureStore(combined, vec2<i32>(id.xy), nearest_half(sum));
}
