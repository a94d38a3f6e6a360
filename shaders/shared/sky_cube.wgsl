// A cube around the world's axes whose faces are cut into cells. Needs viewport.wgsl, math.wgsl and projection.wgsl.

// Place on a face with `edge` cells along an edge, from its top left, of a direction in the axes of the face.
fn place_on_face(on_face: vec3<f32>, edge: f32) -> vec2<f32> {
    return 0.5 * edge * (1.0 + vec2(on_face.x, -on_face.y) / -on_face.z);
}

// Weights of a quadratic B-spline at a place, for the cells around the one that holds it.
fn spline_weights(place: vec2<f32>, held: vec2<f32>) -> array<vec2<f32>, 3> {
    let f = place - held - 0.5;
    return array<vec2<f32>, 3>(0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f));
}
