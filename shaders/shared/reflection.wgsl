// Reflection laws of surfaces, also defined in crates/sky/src/photometry/reflection.rs.

#import constants/reflection

// Returns the luminance relative to a fully lit white Lambert surface times the geometric albedo; 0 if the surface faces away from the sun or the
// eye.
fn reflected(law: u32, cos_i: f32, cos_e: f32) -> f32 {
    if cos_i <= 0.0 || cos_e < 0.0 {
        return 0.0;
    }
    if law == LAW_LAMBERT {
        return 1.5 * cos_i;
    }
    return 2.0 * cos_i / (cos_i + cos_e);
}
