// Extinction of light in air: crates/sky/src/photometry/atmosphere.rs.

#import structs/AirAbove

// Computes the air mass from the sine of the altitude. Below the horizon it is the value at the horizon.
fn air_mass(sine: f32) -> f32 {
    let held = max(sine, 0.0);
    return 1.0 / (held + 0.025 * exp(-11.0 * held));
}

// Returns the sine of the altitude whose air a direction has. Without ground, the sky below the horizon mirrors the sky above it.
fn mirrored(sine: f32, has_ground: bool) -> f32 {
    return select(abs(sine), sine, has_ground);
}

// Returns the share of light from a unit direction, world axes, that passes the air.
fn through_air(air: AirAbove, direction: vec3<f32>) -> vec3<f32> {
    let sine = dot(direction, air.zenith);
    return exp2(air.extinction * air_mass(mirrored(sine, air.present != 2u)));
}
