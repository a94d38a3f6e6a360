// Stars of the culled and sorted catalogue, and the runs of stars that workgroups take.

#import constants/star_light

struct Star {
    // pc from the chunk's origin; unit vector at infinity.
    offset_x: f32,
    offset_y: f32,
    offset_z: f32,
    // Illuminance at 1 pc (7 bits exponent, 14 bits mantissa) and temperature (11 bits): src/catalogue/packed.rs.
    light: u32,
}

struct StarItem {
    // Chunk origin minus camera, pc.
    origin: vec3<f32>,
    first: u32,
    count: u32,
    // Bit i: tile i of the batch may see these stars.
    tiles: u32,
    // Number of the first star among all stars of the scene: what the dither depends on.
    first_number: u32,
    // 1 if the stars are at infinity, where the eye's place does not matter.
    at_infinity: u32,
}

// Illuminance at 1 pc, lx; for stars at infinity, their actual illuminance.
fn illuminance_at_1_pc(star: Star) -> f32 {
    return bitcast<f32>(((star.light >> TEMPERATURE_BITS) << 9u) + (EXPONENT_BIAS << 23u));
}
