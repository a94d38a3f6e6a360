// Reads what accumulate_u64.wgsl has summed.

fn decode(words: vec4<u32>) -> vec3<f32> {
    return vec3<f32>(fields(words.xy)) + 2097152.0 * vec3<f32>(fields(words.zw));
}

fn fields(word: vec2<u32>) -> vec3<u32> {
    return vec3(word.x & 0x1fffffu, (word.x >> 21u) | ((word.y & 0x3ffu) << 11u), (word.y >> 10u) & 0x1fffffu);
}
