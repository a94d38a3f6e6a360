// Texel of the map of faint light: R, G and B with nine bits each, and a shared exponent of five bits. The range is
// 2^-24 to 2^16 units; larger values are clamped.

const LEAST_EXPONENT: i32 = -15;
const MOST_EXPONENT: i32 = 16;

fn texel_of(light: vec3<f32>) -> u32 {
    let most = clamp(max(light.x, max(light.y, light.z)), 0.0, 65408.0);
    // The mantissa is from 1 to 2. Halving it leaves one bit for rounding up.
    var exponent = max(i32(bitcast<u32>(most) >> 23u) - 126, LEAST_EXPONENT);
    let unit_scale = bitcast<f32>(u32(127 + 9 - exponent) << 23u);
    if floor(most * unit_scale + 0.5) > 511.0 {
        exponent = min(exponent + 1, MOST_EXPONENT);
    }
    let scale = bitcast<f32>(u32(127 + 9 - exponent) << 23u);
    let digits = vec3<u32>(min(max(light, vec3(0.0)) * scale + 0.5, vec3(511.0)));
    return digits.x | (digits.y << 9u) | (digits.z << 18u) | (u32(exponent - LEAST_EXPONENT) << 27u);
}

fn light_of_texel(texel: u32) -> vec3<f32> {
    // Converted as signed integers, for which CPUs have a single instruction.
    let digits = vec3<f32>(vec3<i32>(vec3(texel & 511u, (texel >> 9u) & 511u, (texel >> 18u) & 511u)));
    return digits * bitcast<f32>(((texel >> 27u) + 103u) << 23u);
}
