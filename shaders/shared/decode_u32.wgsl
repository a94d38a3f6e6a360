// Reads what accumulate_u32.wgsl has summed.

fn decode(words: vec4<u32>) -> vec3<f32> {
    let carries = vec3(words.w & 0x7ffu, (words.w >> 11u) & 0x7ffu, words.w >> 22u);
    return vec3<f32>(words.xyz) + 4294967296.0 * vec3<f32>(carries);
}
