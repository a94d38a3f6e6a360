// Extinction of light in air: crates/sky/src/photometry/atmosphere.rs.

#import structs/AirAbove

// Air mass from the sine of the altitude; below the horizon the value at the horizon.
fn air_mass(sine: f32) -> f32 {
    let held = max(sine, 0.0);
    return 1.0 / (held + 0.025 * exp(-11.0 * held));
}

// Sine of the altitude that has the air of a direction: without ground the sky below the horizon mirrors that above it.
fn mirrored(sine: f32, has_ground: bool) -> f32 {
    return select(abs(sine), sine, has_ground);
}

// Share of light from a unit direction, world axes, that passes the air.
fn through_air(air: AirAbove, direction: vec3<f32>) -> vec3<f32> {
    let sine = dot(direction, air.zenith);
    return exp2(air.extinction * air_mass(mirrored(sine, air.present != 2u)));
}
