// Scale that maps the light of a frame to the range of half floats: an exact power of two that brings the brightest
// channel of the frame between 2^14 and 2^15. `maximum` holds the bits of that channel.

fn glare_scale(maximum: u32) -> f32 {
    return bitcast<f32>(u32(clamp(268 - i32(maximum >> 23u), 1, 253)) << 23u);
}

// Rounds a colour to the nearest half floats. Texture stores of some adapters truncate, and the light lost by twenty such stores would be
// significant.
fn nearest_half(colour: vec3<f32>) -> vec4<f32> {
    let bits = bitcast<vec3<u32>>(colour);
    let rounded = (bits + 0xfffu + ((bits >> vec3(13u)) & vec3(1u))) & vec3(0xffffe000u);
    return vec4(bitcast<vec3<f32>>(rounded), 1.0);
}
