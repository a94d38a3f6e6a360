// An image of a star, read with bilinear interpolation; black outside of it.

@group(2) @binding(0) var star_image: texture_2d<f32>;

fn texel(at: vec2<i32>) -> vec3<f32> {
    let size = vec2<i32>(textureDimensions(star_image));
    if any(at < vec2(0)) || any(at >= size) {
        return vec3(0.0);
    }
    return textureLoad(star_image, at, 0).xyz;
}

// `place` in texels, whose centres are at +0.5.
fn sample_star_image(place: vec2<f32>) -> vec3<f32> {
    let first = floor(place - 0.5);
    let part = place - 0.5 - first;
    let at = vec2<i32>(first);
    let upper = mix(texel(at), texel(at + vec2(1, 0)), part.x);
    let lower = mix(texel(at + vec2(0, 1)), texel(at + vec2(1, 1)), part.x);
    return mix(upper, lower, part.y);
}
