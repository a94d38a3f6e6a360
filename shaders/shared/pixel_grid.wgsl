// Storage and summation of light in the passes over pixels.

// R and G as stored in the HDR image. Only a dark pixel has zero bits. Its values in the second plane (B and the solid angle) must not be read unless
// the whole image was requested, since they may be left from another frame.
fn red_green_words(luminance: vec3<f32>) -> vec2<u32> {
    let words = bitcast<vec2<u32>>(luminance.xy);
    if all(words == vec2(0u)) && luminance.z > 0.0 {
        // Minus zero: there is no light in R and G, but the pixel is not marked as dark.
        return vec2(0x80000000u, 0u);
    }
    return words;
}

// Adds a pixel to a column's sums for the exposure pass: illuminance in lx, and solid angle in sr of pixels excluded because their light is not
// finite. It tests bits, since compilers may assume that comparisons never see NaN.
fn metered(sum: vec2<f32>, illuminance: f32, omega: f32) -> vec2<f32> {
    let counts = (bitcast<u32>(illuminance) & 0x7f800000u) != 0x7f800000u;
    return sum + select(vec2(0.0, omega), vec2(illuminance, 0.0), counts);
}
