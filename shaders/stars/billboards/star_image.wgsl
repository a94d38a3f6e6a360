// Image of a star, read with bilinear interpolation. It is black outside.

@group(2) @binding(0) var star_image: texture_2d<f32>;

fn texel(position: vec2<i32>) -> vec3<f32> {
    let size = vec2<i32>(textureDimensions(star_image));
    if any(position < vec2(0)) || any(position >= size) {
        return vec3(0.0);
    }
    return textureLoad(star_image, position, 0).xyz;
}

// `place` is in texels, with centres at +0.5.
fn sample_star_image(place: vec2<f32>) -> vec3<f32> {
    let first = floor(place - 0.5);
    let part = place - 0.5 - first;
    let position = vec2<i32>(first);
    let upper = mix(texel(position), texel(position + vec2(1, 0)), part.x);
    let lower = mix(texel(position + vec2(0, 1)), texel(position + vec2(1, 1)), part.x);
    return mix(upper, lower, part.y);
}
