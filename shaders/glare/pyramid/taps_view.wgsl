// Taps of a blur along two great circles of view space that cross at right angles in the texel's direction. The first
// one goes up and down near the horizontal middle of the picture and away from the axis of view further up and down,
// the published mixture; it has no direction on +-x.

#import constants/projections
#import shared/projection
#import shared/viewport

struct Taps {
    direction: vec3<f32>,
    // Unit vector along the great circle.
    tangent: vec3<f32>,
    // 0 where the texel lies outside of the picture.
    exists: f32,
}

// `centre` and `texel` as parts of the level's sides.
fn taps_at(viewport: Viewport, centre: vec2<f32>, texel: vec2<f32>) -> Taps {
    let found = direction_from_pixel(viewport, centre * 2.0 * vec2<f32>((viewport.size + 1u) / 2u));
    let d = found.xyz;
    let upwards = vec3(0.0, -d.z, d.y);
    // Away from the axis, below the middle towards it, so that both always go up.
    let radial = (vec3(0.0, 0.0, 1.0) - d * d.z) * select(1.0, -1.0, d.y < 0.0);
    let mixed = mix(upwards, radial, min(2.0 * abs(d.y), 1.0));
    let length_squared = dot(mixed, mixed);
    // Any direction will do where there is none.
    let first = select(vec3(0.0, 1.0, 0.0), mixed * inverseSqrt(max(length_squared, 1e-30)), length_squared > 1e-12);
    return Taps(d, select(first, cross(first, d), parameters.axis == 1u), found.w);
}

// Place of a tap as part of the sides; z = 1 where there is one.
fn place_of_tap(viewport: Viewport, taps: Taps, k: i32) -> vec3<f32> {
    let side = select(1.0, -1.0, k < 0);
    var direction = taps.direction * parameters.cosines[abs(k)] + taps.tangent * (side * parameters.sines[abs(k)]);
    // A flat plane divides by the depth and does not ask for its sign: what lies behind the eye is mirrored.
    if viewport.kind <= KIND_CUBE_FACE && direction.z > 0.0 {
        direction = -direction;
    }
    let image = pixel_from_direction(viewport, direction);
    return vec3(image.xy / (2.0 * vec2<f32>((viewport.size + 1u) / 2u)), image.z * taps.exists);
}
