// Air masses: src/photometry/atmosphere.rs.

// At an altitude, by its sine; below the horizon those of the horizon.
fn air_mass(sine: f32) -> f32 {
    let held = max(sine, 0.0);
    return 1.0 / (held + 0.025 * exp(-11.0 * held));
}
