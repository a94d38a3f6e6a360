// The factor that brings the light of a frame into the range of half floats: a power of two, so that it is exact, with which the
// brightest channel of the frame comes to between 2^14 and 2^15. `maximum` is its bits.

fn glare_scale(maximum: u32) -> f32 {
    return bitcast<f32>(u32(clamp(268 - i32(maximum >> 23u), 1, 253)) << 23u);
}

// A colour as half floats hold it, to the nearest: adapters that store to a texture may cut off instead, and after twenty stores that
// is light.
fn nearest_half(colour: vec3<f32>) -> vec4<f32> {
    let bits = bitcast<vec3<u32>>(colour);
    let rounded = (bits + 0xfffu + ((bits >> vec3(13u)) & vec3(1u))) & vec3(0xffffe000u);
    return vec4(bitcast<vec3<f32>>(rounded), 1.0);
}
