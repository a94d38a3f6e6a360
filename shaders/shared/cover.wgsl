// Result of the geometry pass per pixel: luminance in cd/m^2 (the first three words, as f32), and a word that describes
// the surfaces in front of the stars: covered share of the pixel, distance, and flags for further tests.

// Returns the covered share of the pixel, stored in steps of 1/255.
fn coverage_of(word: u32) -> f32 {
    return f32(word >> 24u) / 255.0;
}

// Flag: the limb of a body passes through the pixel or close to it, so occlusion of points of light must be tested
// against the bodies.
const COVER_LIMB: u32 = 0x800000u;
// Flag: asteroids cover a part of the pixel.
const COVER_MESH: u32 = 0x400000u;

// Returns the distance of the nearest surface, m: an f32 without its sign bit and its nine lowest bits.
fn distance_of(word: u32) -> f32 {
    return bitcast<f32>((word & 0x3fffffu) << 9u);
}

// Mark of a pixel that `bodies/crossed.wgsl` draws again: the sign of its first word, whose luminance is not negative. No later pass sees the mark.
const CROSSED_MARK: u32 = 0x80000000u;

// Returns a word with another covered share.
fn with_coverage(word: u32, coverage: f32) -> u32 {
    // The value 255 is reserved for complete coverage.
    let parts = select(min(u32(round(coverage * 255.0)), 254u), 255u, coverage >= 1.0);
    return (parts << 24u) | (word & 0xffffffu);
}

fn cover_word(coverage: f32, flags: u32, distance_m: f32) -> u32 {
    return with_coverage(flags | (bitcast<u32>(max(distance_m, 0.0)) >> 9u), coverage);
}
