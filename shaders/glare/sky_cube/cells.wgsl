// A cube around the world axes whose faces are divided into cells. The importer binds `map`.

#import shared/projection

// Returns the position of a direction on a face with `edge` cells along an edge, from the top left of the face. The direction is in the axes of the
// face.
fn place_on_face(on_face: vec3<f32>, edge: f32) -> vec2<f32> {
    return 0.5 * edge * (1.0 + vec2(on_face.x, -on_face.y) / -on_face.z);
}

// Returns the weights of a quadratic B-spline at a position, for the cells around the one that contains it.
fn spline_weights(place: vec2<f32>, held: vec2<f32>) -> array<vec2<f32>, 3> {
    let f = place - held - 0.5;
    return array<vec2<f32>, 3>(0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f));
}

// Returns the value of a map in a direction. The map has `edge` cells per side and begins at `first_point` in `map`. Its faces have a rim of one
// point, so the index of the cell that contains the direction is also that of the previous point.
fn read_map(first_point: u32, edge: u32, direction: vec3<f32>) -> vec3<f32> {
    let face = cube_face_of(direction);
    let place = place_on_face(face_from_face(face, 0u, direction), f32(edge));
    let held = clamp(floor(place), vec2(0.0), vec2(f32(edge) - 1.0));
    let weights = spline_weights(place, held);
    let row_points = edge + 2u;
    let first = first_point + (face * row_points + u32(held.y)) * row_points + u32(held.x);
    var sum = vec3(0.0);
    for (var j = 0u; j < 3u; j++) {
        for (var i = 0u; i < 3u; i++) {
            sum += weights[i].x * weights[j].y * map[first + j * row_points + i].xyz;
        }
    }
    return sum;
}
