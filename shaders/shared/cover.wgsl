// What the geometry pass leaves in a pixel: luminance in cd/m^2 (the first three words, as f32), and a word that says what stands before
// the stars: how much of the pixel is covered, how far away it is, and whether to ask more.

// Parts of 255 of the pixel that are covered.
fn coverage_of(word: u32) -> f32 {
    return f32(word >> 24u) / 255.0;
}

// The limb of a body goes through the pixel, or nearly: whether it hides a point of light is to be asked of the body.
const COVER_LIMB: u32 = 0x800000u;
// Asteroids cover a part of the pixel.
const COVER_MESH: u32 = 0x400000u;

// Distance of the nearest of it, m: f32 without its sign and its nine last digits.
fn distance_of(word: u32) -> f32 {
    return bitcast<f32>((word & 0x3fffffu) << 9u);
}

fn cover_word(coverage: f32, flags: u32, distance_m: f32) -> u32 {
    // Full only where it is.
    let parts = select(min(u32(round(coverage * 255.0)), 254u), 255u, coverage >= 1.0);
    return (parts << 24u) | flags | (bitcast<u32>(max(distance_m, 0.0)) >> 9u);
}
