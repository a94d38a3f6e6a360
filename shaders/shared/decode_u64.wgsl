// Reads what accumulate_u64.wgsl has summed, and writes luminance in its place. The 64-bit words are read as pairs of 32
// bits, low first, which is as WGSL stores them and cheaper to take apart.

@group(0) @binding(3) var<storage, read_write> pixels: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> bright_pixels: array<vec2<u32>>;

fn fields(word: vec2<u32>) -> vec3<f32> {
    return vec3<f32>(vec3(word.x & 0x1fffffu, (word.x >> 21u) | ((word.y & 0x3ffu) << 11u), (word.y >> 10u) & 0x1fffffu));
}

// Units of the three channels of a pixel.
fn sums(pixel: u32) -> vec3<f32> {
    return fields(pixels[pixel]) + 2097152.0 * fields(pixels[parameters.plane_pixels + pixel]);
}

fn bright_sums(pixel: u32) -> vec3<f32> {
    return fields(bright_pixels[pixel]) + 2097152.0 * fields(bright_pixels[parameters.plane_pixels + pixel]);
}

fn store_luminance(pixel: u32, luminance: vec4<f32>) {
    pixels[pixel] = bitcast<vec2<u32>>(luminance.xy);
    pixels[parameters.plane_pixels + pixel] = bitcast<vec2<u32>>(luminance.zw);
}
