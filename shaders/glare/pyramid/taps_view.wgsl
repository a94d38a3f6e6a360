// Taps of a blur along two great circles of view space that cross at right angles in the texel's direction. The first circle is the published
// mixture: near the horizontal centre line of the picture it runs vertically, and farther up and down it runs away from the view axis. On +-x it has
// no direction.

#import constants/projections
#import shared/projection
#import shared/viewport

struct Taps {
    direction: vec3<f32>,
    // Unit vector along the great circle.
    tangent: vec3<f32>,
    // 0 if the texel is outside the picture.
    exists: f32,
}

// `centre` and `texel` are fractions of the level's sides.
fn taps_at(viewport: Viewport, centre: vec2<f32>, texel: vec2<f32>) -> Taps {
    let found = direction_from_pixel(viewport, centre * 2.0 * vec2<f32>((viewport.size + 1u) / 2u));
    let d = found.xyz;
    let upwards = vec3(0.0, -d.z, d.y);
    // The circle runs away from the axis, or towards it in the lower half, so that both directions point up.
    let radial = (vec3(0.0, 0.0, 1.0) - d * d.z) * select(1.0, -1.0, d.y < 0.0);
    let mixed = mix(upwards, radial, min(2.0 * abs(d.y), 1.0));
    let length_squared = dot(mixed, mixed);
    // If the direction is undefined, use an arbitrary one.
    let first = select(vec3(0.0, 1.0, 0.0), mixed * inverseSqrt(max(length_squared, 1e-30)), length_squared > 1e-12);
    return Taps(d, select(first, cross(first, d), parameters.axis == 1u), found.w);
}

// Returns the position of a tap as a fraction of the sides; z = 1 if it exists.
fn place_of_tap(viewport: Viewport, taps: Taps, k: i32) -> vec3<f32> {
    let side = select(1.0, -1.0, k < 0);
    var direction = taps.direction * parameters.cosines[abs(k)] + taps.tangent * (side * parameters.sines[abs(k)]);
    // A flat plane divides by the depth regardless of its sign, so directions behind the eye are mirrored.
    if viewport.kind <= KIND_CUBE_FACE && direction.z > 0.0 {
        direction = -direction;
    }
    let image = pixel_from_direction(viewport, direction);
    return vec3(image.xy / (2.0 * vec2<f32>((viewport.size + 1u) / 2u)), image.z * taps.exists);
}
