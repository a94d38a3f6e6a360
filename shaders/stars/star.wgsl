// Stars of the culled and sorted catalogue, and the runs of stars that workgroups take.

#import constants/star_light
#import structs/StarItem

struct Star {
    // pc from the chunk's origin; unit vector at infinity.
    offset_x: f32,
    offset_y: f32,
    offset_z: f32,
    // Illuminance at 1 pc (7 bits exponent, 14 bits mantissa) and temperature (11 bits): crates/sky/src/catalogue/packed.rs.
    light: u32,
}

// Returns the illuminance at 1 pc, lx; for stars at infinity, their actual illuminance.
fn illuminance_at_1_pc(star: Star) -> f32 {
    return bitcast<f32>(((star.light >> TEMPERATURE_BITS) << 9u) + (EXPONENT_BIAS << 23u));
}
