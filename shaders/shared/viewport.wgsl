// What the renderer knows of a viewport and of the tiles it is cut into. The same structs stand in src/gpu/layout.rs; a
// test compares names, offsets and sizes.

struct Viewport {
    // Rows of the rotation from world axes to view axes; w: the eye's offset from the camera along world x, y, z, pc.
    view_from_world_x: vec4<f32>,
    view_from_world_y: vec4<f32>,
    view_from_world_z: vec4<f32>,
    // Flat planes: pixels per unit of tangent (y negative). Fisheye: the circle's radius in pixels, twice.
    plane_scale: vec2<f32>,
    // Pixel coordinates of the principal ray or of the circle's centre.
    plane_offset: vec2<f32>,
    size: vec2<u32>,
    kind: u32,
    // Cube faces: number of the face. Tabulated: where the table begins, in groups of four words.
    face: u32,
    // Fisheye: the rim's radius before normalisation, F/2, sin(F/4), sin(F/2) or tan(F/4).
    rim: f32,
    // Equidistant: pi - F/2. Orthographic: cos^2(F/2). Both from f64: f32 would cancel.
    rim_complement: f32,
    // Fisheye and tabulated: 1 where the picture shows the full sphere, so that its rim is no border.
    full_sphere: u32,
    // 1 where the density at the pixel's centre is not good enough and nine points are averaged.
    quadrature: u32,
    // Stars below this take the tent, others the B-spline: illuminance over the solid angle of a pixel at their place, cd/m^2.
    tent_below_cd_m2: f32,
    // Index of the view, for counting stars.
    view: u32,
    // Stars from this on take the Gaussian, the same.
    gaussian_from_cd_m2: f32,
    // Its standard deviation: the larger of an angle in rad and of pixels.
    gaussian_sigma_rad: f32,
    gaussian_sigma_px: f32,
    // How far beyond a border a star may stand whose Gaussian reaches over it, pixels.
    gaussian_reach_px: f32,
    // 1: the Gaussian lies on the image plane and takes the B-spline's place by and by. 0: it is round in view space.
    gaussian_on_plane: u32,
    // Omni-directional stereo: radius of the circle on which the eye goes round with the direction of sight, m; positive for the right eye. 0: it stays.
    viewing_circle_m: f32,
}

// Whether short loops stay loops. GPUs are fastest with unrolled loops; software drivers need seconds to compile them.
override ROLLED: bool = false;

// Number of iterations of a loop. To keep the loop, the value is hidden from the driver; every viewport has pixels, so
// it is never 0.
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

// Position of the eye relative to the camera, world axes, pc.
fn eye_of(viewport: Viewport) -> vec3<f32> {
    return vec3(viewport.view_from_world_x.w, viewport.view_from_world_y.w, viewport.view_from_world_z.w);
}

// Position of the eye that sees a direction (a unit vector, view axes), relative to the centre of its circle, view
// axes, m: see `Viewport::eye_on_circle_m`.
fn eye_on_circle(viewport: Viewport, direction: vec3<f32>) -> vec3<f32> {
    return viewport.viewing_circle_m * vec3(-direction.y, direction.x, 0.0);
}

// Direction in which the eye on the circle sees an object, given its direction (a unit vector, view axes) and distance
// from the centre. Each iteration reduces the error by the factor radius over distance.
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

struct Tile {
    viewport: u32,
    // The tile is the viewport's rows first_row .. first_row + rows.
    first_row: u32,
    rows: u32,
    // Index of its first pixel in the batch's buffer.
    first_pixel: u32,
    // Index of its first partial sum of illuminance.
    first_partial: u32,
    // Counter that is the flag of its first block of pixels.
    first_flag: u32,
    unused_0: u32,
    unused_1: u32,
}
