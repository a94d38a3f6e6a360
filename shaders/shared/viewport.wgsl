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

// Whether loops of few turns stay loops. A GPU is best served by code that is written out; a software driver takes seconds to compile that.
override ROLLED: bool = false;

// So many turns of a loop; where it is to stay one, in a form that the driver cannot know. Every viewport has pixels.
fn turns(viewport: Viewport, count: i32) -> i32 {
    return select(count, 0, ROLLED && viewport.size.x == 0u);
}

// A direction from view axes to those of the world: the rows turn the other way, so that their sum is the way back.
fn world_direction(viewport: Viewport, in_view: vec3<f32>) -> vec3<f32> {
    return in_view.x * viewport.view_from_world_x.xyz + in_view.y * viewport.view_from_world_y.xyz
        + in_view.z * viewport.view_from_world_z.xyz;
}

// A direction from the world's axes to those of the view.
fn view_direction(viewport: Viewport, in_world: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(in_world, viewport.view_from_world_x.xyz),
        dot(in_world, viewport.view_from_world_y.xyz),
        dot(in_world, viewport.view_from_world_z.xyz));
}

// Where the eye stands, relative to the camera, world axes, pc.
fn eye_of(viewport: Viewport) -> vec3<f32> {
    return vec3(viewport.view_from_world_x.w, viewport.view_from_world_y.w, viewport.view_from_world_z.w);
}

// Where the eye is that sees a direction (a unit vector, view axes), from its place, view axes, m: see `Viewport::eye_on_circle_m`.
fn eye_on_circle(viewport: Viewport, direction: vec3<f32>) -> vec3<f32> {
    return viewport.viewing_circle_m * vec3(-direction.y, direction.x, 0.0);
}

// The direction in which the eye on the circle sees what lies in a direction (a unit vector, view axes) and at a distance from its centre. It comes nearer by the
// factor of radius over distance with every step.
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
