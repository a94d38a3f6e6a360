// Linear light of the display image. A target that encodes sRGB restores the codes of the display image, including
// dither.

#import display/encode

@group(0) @binding(1) var<storage, read> display: array<u32>;

fn linear_light(index: u32) -> vec3<f32> {
    let word = display[index];
    let codes = vec3(word & 255u, (word >> 8u) & 255u, (word >> 16u) & 255u);
    return linear_from_srgb(vec3<f32>(codes) / 255.0);
}
