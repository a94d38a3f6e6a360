// How surfaces spread the light that falls on them; the same laws stand in src/photometry/reflection.rs.

#import constants/reflection

// Luminance over that of a white Lambert surface in full light times the geometric albedo; 0 where the surface faces away from either.
fn reflected(law: u32, cos_i: f32, cos_e: f32) -> f32 {
    if cos_i <= 0.0 || cos_e < 0.0 {
        return 0.0;
    }
    if law == LAW_LAMBERT {
        return 1.5 * cos_i;
    }
    return 2.0 * cos_i / (cos_i + cos_e);
}
