// Taps of a blur along the rows of the picture, then along its columns.

#import shared/viewport

struct Taps {
    centre: vec2<f32>,
    step: vec2<f32>,
}

// `centre` and `texel` are fractions of the level's sides.
fn taps_at(viewport: Viewport, centre: vec2<f32>, texel: vec2<f32>) -> Taps {
    return Taps(centre, select(vec2(texel.x, 0.0), vec2(0.0, texel.y), parameters.axis == 1u));
}

// Returns the position of a tap as a fraction of the sides; z = 1 if it exists.
fn place_of_tap(viewport: Viewport, taps: Taps, k: i32) -> vec3<f32> {
    return vec3(taps.centre + f32(k) * taps.step, 1.0);
}
