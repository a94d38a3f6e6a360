// Refraction by the air around an eye: crates/sky/src/observer/refraction.rs.

#import constants/refraction
#import shared/air_mass

// c[0] / (sine + c[1] / (sine + c[2] / (sine + c[3] / (sine + c[4])))) with one division. The sums of products do not cancel, even for the negative
// sines that occur.
fn refraction_fraction(c: array<f32, 5>, sine: f32) -> f32 {
    let first = sine + c[4];
    let second = sine * first + c[3];
    let third = sine * second + c[2] * first;
    return c[0] * third / (sine * third + c[1] * second);
}

// Returns the tangent of the refraction divided by the cosine of the altitude, from the sine of the apparent altitude.
fn refraction_of_seen(density: f32, sine: f32) -> f32 {
    let kept = clamp((sine - REFRACTION_GONE) / (REFRACTION_WHOLE - REFRACTION_GONE), 0.0, 1.0);
    return density * kept * refraction_fraction(REFRACTION_OF_SEEN, max(sine, REFRACTION_LOWEST_SEEN));
}

// Returns the same, computed from the sine of the true altitude, divided by the cosine of that altitude. The error after two steps is 0.1 arcsec
// above the horizon in air at sea level, 3 arcsec in air of half that density.
fn refraction_of_arriving(density: f32, sine: f32) -> f32 {
    let cosine_squared = max(1.0 - sine * sine, 0.0);
    var found = density * refraction_fraction(REFRACTION_OF_ARRIVING, max(sine, REFRACTION_LOWEST_ARRIVING));
    for (var i = 0u; i < 2u; i++) {
        let cosine = inverseSqrt(1.0 + found * found * cosine_squared);
        let seen = (sine + found * cosine_squared) * cosine;
        found = refraction_of_seen(density, seen) * (1.0 - sine * found) * cosine;
    }
    return found;
}

// Returns the apparent direction of light from a true unit direction, world axes.
fn refracted(air: AirAbove, arriving: vec3<f32>) -> vec3<f32> {
    let sine = dot(arriving, air.zenith);
    return normalize(arriving + refraction_of_arriving(air.density, sine) * (air.zenith - sine * arriving));
}

// Returns the true direction of light seen in an apparent unit direction.
fn arriving_from(air: AirAbove, seen: vec3<f32>) -> vec3<f32> {
    let sine = dot(seen, air.zenith);
    return normalize(seen - refraction_of_seen(air.density, sine) * (air.zenith - sine * seen));
}
