// Reads what accumulate_u64.wgsl has summed, and writes luminance in its place.

@group(0) @binding(3) var<storage, read_write> pixels: array<u64>;
@group(0) @binding(5) var<storage, read> bright_pixels: array<u64>;

fn fields(word: u64) -> vec3<f32> {
    let low = u32(word & 0xfffffffflu);
    let high = u32(word >> 32u);
    return vec3<f32>(vec3(low & 0x1fffffu, (low >> 21u) | ((high & 0x3ffu) << 11u), (high >> 10u) & 0x1fffffu));
}

// Units of the three channels of a pixel.
fn sums(pixel: u32) -> vec3<f32> {
    let low = pixels[pixel];
    let high = pixels[parameters.plane_pixels + pixel];
    if (low | high) == 0lu {
        return vec3(0.0);
    }
    return fields(low) + 2097152.0 * fields(high);
}

fn bright_sums(pixel: u32) -> vec3<f32> {
    return fields(bright_pixels[pixel]) + 2097152.0 * fields(bright_pixels[parameters.plane_pixels + pixel]);
}

fn store_luminance(pixel: u32, luminance: vec4<f32>) {
    let bits = bitcast<vec4<u32>>(luminance);
    pixels[pixel] = u64(bits.x) | (u64(bits.y) << 32u);
    pixels[parameters.plane_pixels + pixel] = u64(bits.z) | (u64(bits.w) << 32u);
}
