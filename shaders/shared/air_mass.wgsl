// Extinction of light in air: src/photometry/atmosphere.rs.

// The air around an eye.
struct AirAbove {
    // Unit vector to the zenith, world axes.
    zenith: vec3<f32>,
    // 1: there is air.
    present: u32,
    // Power of two by which light becomes less for each air mass, linear Rec. 709.
    extinction: vec3<f32>,
    // Density over that for which refraction is told; 0: it bends nothing.
    density: f32,
}

// Air mass from the sine of the altitude; below the horizon the value at the horizon.
fn air_mass(sine: f32) -> f32 {
    let held = max(sine, 0.0);
    return 1.0 / (held + 0.025 * exp(-11.0 * held));
}

// Share of light from a unit direction, world axes, that passes the air.
fn through_air(air: AirAbove, direction: vec3<f32>) -> vec3<f32> {
    return exp2(air.extinction * air_mass(dot(direction, air.zenith)));
}
