// Cone around the directions of a rectangle of pixels.

#import shared/projection
#import shared/viewport

struct Cone {
    // Unit vector, world axes.
    axis: vec3<f32>,
    // Greatest chord from the axis to a direction inside; negative: no direction.
    chord: f32,
}

fn point_of(from_pixel: vec2<f32>, step: vec2<f32>, points: vec2<u32>, i: u32) -> vec2<f32> {
    return from_pixel + step * vec2(f32(i % points.x), f32(i / points.x));
}

// Returns a cone around `size` pixels that begin at `corner`, sampled at `points` points per side. If some points are outside the picture, the centre
// of every pixel is used instead.
fn cone_of(viewport: Viewport, corner: vec2<f32>, size: vec2<u32>, some_points: u32) -> Cone {
    var points = vec2(some_points);
    var first = corner;
    var step = vec2<f32>(size) / f32(some_points - 1u);
    var axis = vec3(0.0);
    var seen = 0u;
    for (var i = 0u; i < points.x * points.y; i++) {
        let direction = direction_from_pixel(viewport, point_of(first, step, points, i));
        axis += direction.xyz * direction.w;
        seen += u32(direction.w);
    }
    let whole = seen == points.x * points.y;
    if !whole {
        points = size;
        first = corner + 0.5;
        step = vec2(1.0);
        axis = vec3(0.0);
        seen = 0u;
        for (var i = 0u; i < points.x * points.y; i++) {
            let direction = direction_from_pixel(viewport, point_of(first, step, points, i));
            axis += direction.xyz * direction.w;
            seen += u32(direction.w);
        }
    }
    if seen == 0u {
        return Cone(vec3(0.0), -1.0);
    }
    // Directions all around have no mean; use a cone that contains everything.
    if length(axis) < 0.1 * f32(seen) {
        return Cone(vec3(0.0, 0.0, 1.0), 2.0);
    }
    axis = normalize(axis);
    var chord = 0.0;
    var bend = 0.0;
    for (var i = 0u; i < points.x * points.y; i++) {
        let point = point_of(first, step, points, i);
        let direction = direction_from_pixel(viewport, point);
        if direction.w == 0.0 {
            continue;
        }
        chord = max(chord, length(direction.xyz - axis));
        if whole {
            // Between three consecutive points, a smooth curve departs from the polygon through them by less than their second difference.
            let ahead = vec2<bool>(i % points.x + 2u < points.x, i / points.x + 2u < points.y);
            for (var axis_index = 0u; axis_index < 2u; axis_index++) {
                if ahead[axis_index] {
                    let along = select(vec2(0.0, step.y), vec2(step.x, 0.0), axis_index == 0u);
                    let middle = direction_from_pixel(viewport, point + along).xyz;
                    let end = direction_from_pixel(viewport, point + 2.0 * along).xyz;
                    bend = max(bend, length(direction.xyz - 2.0 * middle + end));
                }
            }
        }
    }
    // Margin for the rounding of f32.
    return Cone(world_direction(viewport, axis), (chord + 2.0 * bend) * 1.0001 + 1e-6);
}
