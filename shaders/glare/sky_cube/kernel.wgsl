// The glare kernel in the pixels of a view, evaluated in four directions at a time. The importer binds the parameters `sky` and the table
// `kernel_table`.

#import glare/sky_cube/sprites
#import shared/math
#import shared/viewport

// Whether the kernel is read from the table; otherwise it is the inverse square.
override TABULATED: bool = false;

// Converts squared chords to squared angles, for chords up to those of sprites.
fn near_angle_squared(squared: vec4<f32>) -> vec4<f32> {
    return squared * (1.0 + squared * (1.0 / 12.0) * (1.0 + squared * (2.0 / 15.0)));
}

// Converts squared chords to squared angles, for any chord.
fn angle_squared(squared: vec4<f32>) -> vec4<f32> {
    let sines = sqrt(squared);
    let cosines = sqrt(max(4.0 - squared, vec4(0.0)));
    let half = vec4(
        precise_atan2(sines.x, cosines.x), precise_atan2(sines.y, cosines.y),
        precise_atan2(sines.z, cosines.z), precise_atan2(sines.w, cosines.w));
    return select(near_angle_squared(squared), 4.0 * half * half, squared > vec4(0.05));
}

// Returns the kernel in the view's pixels, 1/sr, computed from squared chords and squared angles.
fn kernel_in_view(view: GlareView, squared: vec4<f32>, angles_squared: vec4<f32>) -> vec4<f32> {
    let u = squared / view.core_squared;
    let core = view.core.x + u * (view.core.y + u * view.core.z);
    var beyond = sky.constant / max(angles_squared, vec4(sky.inner_squared));
    if TABULATED {
        let last = vec4(f32(sky.entries - 1u) - 0.001);
        let place = clamp((log2(squared) - sky.first_octave) * sky.entries_per_octave, vec4(0.0), last);
        let entry = vec4<u32>(place);
        let from_entry = vec4(
            kernel_table[entry.x], kernel_table[entry.y], kernel_table[entry.z], kernel_table[entry.w]);
        let to_entry = vec4(
            kernel_table[entry.x + 1u], kernel_table[entry.y + 1u], kernel_table[entry.z + 1u], kernel_table[entry.w + 1u]);
        beyond = mix(from_entry, to_entry, place - floor(place)) / squared;
    }
    return select(beyond, core, squared < vec4(view.core_squared));
}

// Directions of four pixels, world axes.
struct Directions4 {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Sets the direction of one of the four lanes; `lane` may vary between iterations of a loop.
fn set_lane(four: ptr<function, Directions4>, lane: u32, direction: vec3<f32>) {
    let here = vec4(0u, 1u, 2u, 3u) == vec4(lane);
    (*four).x = select((*four).x, vec4(direction.x), here);
    (*four).y = select((*four).y, vec4(direction.y), here);
    (*four).z = select((*four).z, vec4(direction.z), here);
}

// Returns the squared chords from a direction.
fn chords_squared(directions: Directions4, other: vec3<f32>) -> vec4<f32> {
    let x = directions.x - other.x;
    let y = directions.y - other.y;
    let z = directions.z - other.z;
    return x * x + y * y + z * z;
}

// Returns the kernel of a sprite in four directions. It has no branches, since a software driver would execute all of them.
fn sprite_kernel(view: GlareView, sprite: GlareSprite, directions: Directions4) -> vec4<f32> {
    let squared = chords_squared(directions, sprite.direction);
    let share = min(squared * sprite.inverse_squared, vec4(1.0));
    let value = kernel_in_view(view, squared, near_angle_squared(squared));
    let u = squared * sky.soft_inverse;
    let left = select(vec4(0.0), value - sky.soft.x - u * (sky.soft.y + u * sky.soft.z), share < vec4(1.0));
    let fade = 1.0 - share * share * (3.0 - 2.0 * share);
    return select(value * fade, left, sprite.whole != 0u);
}
