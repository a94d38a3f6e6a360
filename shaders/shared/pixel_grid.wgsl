// How the passes over pixels store and sum the light of pixels.

// R and G as the HDR image holds them: zero bits where the pixel is dark, and there alone. What such a pixel has in the second plane
// (B and the solid angle) is not to be read unless the whole image was asked for: it may be left from another frame.
fn red_green_words(luminance: vec3<f32>) -> vec2<u32> {
    let words = bitcast<vec2<u32>>(luminance.xy);
    if all(words == vec2(0u)) && luminance.z > 0.0 {
        // Minus zero: no light, but not dark.
        return vec2(0x80000000u, 0u);
    }
    return words;
}

// What a column of pixels hands to the exposure pass: the illuminance of its pixels in lx, and the solid angle in sr of those that do
// not count because their light is not finite. Told by the bits: compilers may take it that comparisons see numbers only.
fn metered(sum: vec2<f32>, illuminance: f32, omega: f32) -> vec2<f32> {
    let counts = (bitcast<u32>(illuminance) & 0x7f800000u) != 0x7f800000u;
    return sum + select(vec2(0.0, omega), vec2(illuminance, 0.0), counts);
}
