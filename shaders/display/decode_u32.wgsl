// Reads the sums of shared/accumulate_u32.wgsl, and replaces them with luminance.

#import shared/pixel_grid

@group(0) @binding(3) var<storage, read_write> pixels: array<vec2<u32>>;
// Low words of the brightest stars, then their high words.
@group(0) @binding(5) var<storage, read> bright_words: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> high_words: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read> counters: array<u32>;

fn units_of(words: vec4<u32>) -> vec3<f32> {
    let carries = vec3(words.w & 0x7ffu, (words.w >> 11u) & 0x7ffu, words.w >> 22u);
    return vec3<f32>(words.xyz) + 4294967296.0 * vec3<f32>(carries);
}

// B is stored with the carries, so these words are always read. The binding of the flags is the same as in display/decode_u64.wgsl.
fn has_high_words(flag: u32) -> bool {
    return counters[flag] != 0xffffffffu;
}

// Returns the sums of a pixel's three channels, units.
fn sums(pixel: u32, high: bool) -> vec3<f32> {
    return units_of(vec4(pixels[pixel], high_words[pixel]));
}

fn bright_sums(pixel: u32) -> vec3<f32> {
    return units_of(vec4(bright_words[pixel], bright_words[parameters.first_bright_high + pixel]));
}

fn store_luminance(pixel: u32, luminance: vec4<f32>) {
    pixels[pixel] = red_green_words(luminance.xyz);
    pixels[parameters.plane_pixels + pixel] = bitcast<vec2<u32>>(luminance.zw);
}
