// What the exposure pass finds, and the tone-mapping pass reads. The same struct stands in src/gpu/layout.rs.

struct Exposure {
    // What this frame is shown with, and what the meter reads.
    ev100: f32,
    metered_ev100: f32,
    mean_luminance_cd_m2: f32,
    // Display values per cd/m^2.
    display_per_cd_m2: f32,
}
