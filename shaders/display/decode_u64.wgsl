// Reads the sums of shared/accumulate_u64.wgsl, and replaces them with luminance. The 64-bit words are read as pairs of 32-bit words, the low one
// first. This is WGSL's memory layout, and such pairs are cheaper to unpack.

#import shared/pixel_grid

@group(0) @binding(3) var<storage, read_write> pixels: array<vec2<u32>>;
// Low words of the brightest stars, then their high words.
@group(0) @binding(5) var<storage, read> bright_words: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> high_words: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read> counters: array<u32>;

fn fields(word: vec2<u32>) -> vec3<f32> {
    // Converted as signed integers, for which CPUs have a single instruction.
    return vec3<f32>(
        vec3<i32>(vec3(word.x & 0x1fffffu, (word.x >> 21u) | ((word.y & 0x3ffu) << 11u), (word.y >> 10u) & 0x1fffffu)),
    );
}

// Whether the block of this flag may have high words.
fn has_high_words(flag: u32) -> bool {
    return counters[flag] != 0u;
}

// Returns the sums of a pixel's three channels, units. High words are reset to zero for the next frame.
fn sums(pixel: u32, high: bool) -> vec3<f32> {
    var units = fields(pixels[pixel]);
    if high {
        units += 2097152.0 * fields(high_words[pixel]);
        high_words[pixel] = vec2(0u);
    }
    return units;
}

fn bright_sums(pixel: u32) -> vec3<f32> {
    return fields(bright_words[pixel]) + 2097152.0 * fields(bright_words[parameters.first_bright_high + pixel]);
}

fn store_luminance(pixel: u32, luminance: vec4<f32>) {
    pixels[pixel] = red_green_words(luminance.xyz);
    pixels[parameters.plane_pixels + pixel] = bitcast<vec2<u32>>(luminance.zw);
}
