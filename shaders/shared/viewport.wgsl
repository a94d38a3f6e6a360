// Viewports and their tiles: transforms between view axes and world axes, and the position of the eye.

#import structs/Tile
#import structs/Viewport

// Whether short loops are kept as loops. GPUs are fastest with unrolled loops, but software drivers need seconds to compile them.
override ROLLED: bool = false;

// Returns the number of iterations of a loop. To keep the loop, the value is hidden from the driver; every viewport has pixels, so it is never 0.
fn turns(viewport: Viewport, count: i32) -> i32 {
    return select(count, 0, ROLLED && viewport.size.x == 0u);
}

// Rotates a direction from view axes to world axes. The rows are those of the inverse rotation, so their weighted sum
// is the result.
fn world_direction(viewport: Viewport, in_view: vec3<f32>) -> vec3<f32> {
    return in_view.x * viewport.view_from_world_x.xyz + in_view.y * viewport.view_from_world_y.xyz
        + in_view.z * viewport.view_from_world_z.xyz;
}

// Rotates a direction from world axes to view axes.
fn view_direction(viewport: Viewport, in_world: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(in_world, viewport.view_from_world_x.xyz),
        dot(in_world, viewport.view_from_world_y.xyz),
        dot(in_world, viewport.view_from_world_z.xyz));
}

// Returns the position of the eye relative to the camera, world axes, pc.
fn eye_of(viewport: Viewport) -> vec3<f32> {
    return vec3(viewport.view_from_world_x.w, viewport.view_from_world_y.w, viewport.view_from_world_z.w);
}

// Returns the position of the eye that sees a direction (a unit vector, view axes), relative to the centre of its circle, view axes, m: see
// `Viewport::eye_on_circle_m`.
fn eye_on_circle(viewport: Viewport, direction: vec3<f32>) -> vec3<f32> {
    return viewport.viewing_circle_m * vec3(-direction.y, direction.x, 0.0);
}

// Returns the direction in which the eye on the circle sees an object, given its direction (a unit vector, view axes) and distance from the centre.
// Each iteration multiplies the error by radius / distance.
fn direction_from_circle(viewport: Viewport, direction: vec3<f32>, distance_m: f32) -> vec3<f32> {
    if viewport.viewing_circle_m == 0.0 {
        return direction;
    }
    var seen = direction;
    for (var i = 0; i < 4; i++) {
        seen = normalize(direction - eye_on_circle(viewport, seen) / distance_m);
    }
    return seen;
}
