// Total light of an asteroid: the phase functions of crates/sky/src/photometry/reflection.rs, and projected areas from a table.
// An entry of the table holds an area and the next one.

#import asteroids/instance
#import asteroids/shape
#import constants/asteroid_points
#import constants/reflection
#import shared/math
#import shared/reflection

// Returns the light of a sphere at a phase angle, relative to full phase.
fn phase_function(law: u32, phase: f32) -> f32 {
    let d = max(PI - phase, 0.0);
    if law == LAW_LAMBERT {
        if d < 0.2 {
            return d * d * d / PI * (1.0 / 3.0 - d * d / 30.0);
        }
        return (precise_sin(d) - d * precise_cos(d)) / PI;
    }
    let x = 0.5 * d;
    if x < 0.05 {
        return x * x * (2.0 / 3.0 - 4.0 / 45.0 * x * x);
    }
    let cosine = precise_cos(x);
    let sine = precise_sin(x);
    // This is tan(x / 2). At full phase the logarithm diverges, but its factor vanishes faster.
    let half_tangent = sine / (1.0 + cosine);
    if half_tangent >= 0.999999 {
        return 1.0;
    }
    return 1.0 - cosine * cosine / sine * log((1.0 + half_tangent) / (1.0 - half_tangent));
}

// Returns the projected area of a shape towards a direction in its axes (unit vector), in units of pi mean radii squared.
fn area_towards(shape: AsteroidShape, direction: vec3<f32>) -> f32 {
    let flat = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    let folded = (1.0 - abs(flat.yx)) * select(vec2(-1.0), vec2(1.0), flat >= vec2(0.0));
    let position = clamp((select(flat, folded, direction.z < 0.0) * 0.5 + 0.5) * f32(AREA_NODES - 1u), vec2(0.0), vec2(f32(AREA_NODES - 1u)));
    let node = min(vec2<u32>(position), vec2(AREA_NODES - 2u));
    let f = position - vec2<f32>(node);
    let first = shape.first_area + node.y * AREA_NODES + node.x;
    let above = asteroid_tables[first];
    let below = asteroid_tables[first + AREA_NODES];
    let upper = above.x * (1.0 - f.x) + above.y * f.x;
    let lower = below.x * (1.0 - f.x) + below.y * f.x;
    return upper * (1.0 - f.y) + lower * f.y;
}
