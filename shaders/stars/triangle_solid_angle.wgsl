// Solid angle of a pixel as published with the packed rasteriser: two spherical triangles between the directions of its
// corners, in f32. It suffers from cancellation; docs/benchmarks.md lists the errors.

#import shared/projection
#import shared/viewport

// Returns the solid angle of the spherical triangle between three unit vectors (van Oosterom and Strackee 1983), sr.
fn triangle_solid_angle(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> f32 {
    return 2.0 * atan2(abs(dot(a, cross(b, c))), 1.0 + dot(a, b) + dot(b, c) + dot(c, a));
}

// Returns the solid angle of a pixel. If a corner is outside the picture, it is that of the closed form.
fn pixel_of_triangles(viewport: Viewport, pixel: vec2<i32>) -> f32 {
    let corner = vec2<f32>(pixel);
    let top_left = direction_from_pixel(viewport, corner);
    let top_right = direction_from_pixel(viewport, corner + vec2(1.0, 0.0));
    let bottom_left = direction_from_pixel(viewport, corner + vec2(0.0, 1.0));
    let bottom_right = direction_from_pixel(viewport, corner + vec2(1.0, 1.0));
    if top_left.w * top_right.w * bottom_left.w * bottom_right.w == 0.0 {
        return solid_angle(viewport, pixel);
    }
    return triangle_solid_angle(top_left.xyz, bottom_left.xyz, top_right.xyz)
        + triangle_solid_angle(top_right.xyz, bottom_left.xyz, bottom_right.xyz);
}
