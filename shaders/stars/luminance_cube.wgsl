// Luminance drawn on the six faces of a cube around the view axes. Faces are drawn a few texels larger than those of
// the cube, so that interpolation never crosses an edge.

#import shared/projection
#import shared/viewport

@group(1) @binding(0) var drawn: texture_2d_array<f32>;

// `parameters.source_0`: texels along an edge of the cube. `parameters.source_1`: extra texels on each side.
fn luminance_of(viewport: Viewport, index: u32, pixel: vec2<i32>) -> vec3<f32> {
    let direction = direction_from_pixel(viewport, vec2<f32>(pixel) + 0.5).xyz;
    let face = cube_face_of(direction);
    let on_face = face_from_face(face, 0u, direction);
    let tangents = on_face.xy / -on_face.z;
    let edge = f32(parameters.source_0);
    let place = vec2(0.5 * edge * (1.0 + tangents.x), 0.5 * edge * (1.0 - tangents.y)) + f32(parameters.source_1) - 0.5;
    let first = vec2<i32>(floor(place));
    let part = place - floor(place);
    let layer = i32(face);
    let upper = mix(textureLoad(drawn, first, layer, 0), textureLoad(drawn, first + vec2(1, 0), layer, 0), part.x);
    let lower = mix(
        textureLoad(drawn, first + vec2(0, 1), layer, 0), textureLoad(drawn, first + vec2(1, 1), layer, 0), part.x);
    return mix(upper, lower, part.y).xyz;
}
