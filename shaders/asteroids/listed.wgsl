// Draws asteroids from the lists written by culling, onto a picture or a face of the cube behind it. Shared by meshes
// and impostors: position, rotation and lighting of an asteroid, projection onto the target, and fading.
//
// Depth is near / distance, so greater is nearer. On flat pictures and faces, the distance is measured along the axis, because hardware divides by
// it. On other pictures, it is measured from the eye.

#import asteroids/instance
#import asteroids/lists
#import asteroids/shape
#import constants/asteroid_instances
#import constants/asteroid_lists
#import constants/frame_lists
#import constants/projections
#import shared/math
#import shared/projection
#import shared/viewport
#import structs/AsteroidBucket
#import structs/AsteroidTarget

@group(0) @binding(0) var<uniform> asteroid_target: AsteroidTarget;
@group(0) @binding(1) var<uniform> bucket: AsteroidBucket;
@group(0) @binding(2) var<storage, read> items: array<AsteroidItem>;
@group(0) @binding(3) var<uniform> fields: array<AsteroidField, MAX_FIELDS>;
@group(0) @binding(4) var<storage, read> instances: array<u32>;
@group(0) @binding(5) var<storage, read> entries: array<AsteroidEntry>;
@group(0) @binding(6) var<storage, read> bases: array<u32>;
// Tables of pictures and shapes.
@group(0) @binding(7) var<storage, read> asteroid_tables: array<vec2<f32>>;

// Asteroid in view axes.
struct Asteroid {
    // Centre relative to the eye, m.
    centre: vec3<f32>,
    // Mean radius, m.
    radius: f32,
    // Index of the shape within its field's set, and index of the set's first shape.
    shape: u32,
    first_shape: u32,
    view_from_shape: mat3x3<f32>,
    // Unit vector towards the sun.
    sun: vec3<f32>,
    // Geometric albedo times illuminance over pi, in units of the target.
    luminance: vec3<f32>,
    law: u32,
    fade: f32,
}

// Image position of the last loaded asteroid on an equirectangular picture. It keeps the asteroid's vertices together. It consists of the longitude
// of the centre divided by 2 pi, and the shift of the image, pixels.
var<private> seam_turn: f32;
var<private> seam_shift: f32;

fn view_from_world(v: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(asteroid_target.viewport.view_from_world_x.xyz, v),
        dot(asteroid_target.viewport.view_from_world_y.xyz, v),
        dot(asteroid_target.viewport.view_from_world_z.xyz, v));
}

// Returns the entry of the draw's bucket.
fn slot_of(instance_index: u32) -> u32 {
    return bases[asteroid_target.plane * asteroid_target.kinds + bucket.kind] + instance_index;
}

fn load_asteroid(slot: u32) -> Asteroid {
    let entry = entries[slot];
    let item = items[entry.item & ~SEAM_BIT];
    let field = fields[item.field];
    let word = INSTANCE_WORDS * entry.instance;
    let offset = bitcast<vec3<f32>>(vec3(instances[word], instances[word + 1u], instances[word + 2u]));
    let radius_and_shape = instances[word + 3u];
    var asteroid: Asteroid;
    asteroid.centre = view_from_world(place_of(item, field, offset) - asteroid_target.eye);
    asteroid.radius = radius_of(field, radius_and_shape);
    asteroid.shape = shape_of(field, radius_and_shape) - field.first_shape;
    asteroid.first_shape = field.first_shape;
    let turned = field_from_shape(field, instances[word + 4u], instances[word + 5u]);
    asteroid.view_from_shape = mat3x3(
        view_from_world(world_from_field(field, turned[0])),
        view_from_world(world_from_field(field, turned[1])),
        view_from_world(world_from_field(field, turned[2])));
    asteroid.sun = view_from_world(item.sun);
    asteroid.luminance = field.albedo * item.illuminance * (asteroid_target.units_per_cd_m2 / PI);
    asteroid.law = field.law;
    asteroid.fade = entry.fade;
    seam_turn = precise_atan2(asteroid.centre.x, -asteroid.centre.z) / (2.0 * PI);
    let width = f32(asteroid_target.viewport.size.x);
    seam_shift = select(0.0, select(width, -width, seam_turn > 0.0), (entry.item & SEAM_BIT) != 0u);
    return asteroid;
}

// Returns the pixel coordinates of a position relative to the eye, view axes, m; z = 0 if it has no image.
fn pixel_of(place: vec3<f32>) -> vec3<f32> {
    let viewport = asteroid_target.viewport;
    var image = pixel_from_direction(viewport, place);
    if viewport.kind == KIND_EQUIRECTANGULAR {
        let turn = image.x / f32(viewport.size.x) - 0.5;
        image.x = (0.5 + turn - round(turn - seam_turn)) * f32(viewport.size.x) + seam_shift;
    }
    return image;
}

fn depth_of_place(place: vec3<f32>) -> f32 {
    let on_plane = asteroid_target.viewport.kind <= KIND_CUBE_FACE;
    return asteroid_target.near / select(length(place), -place.z, on_plane);
}

// Returns the clip coordinates of a position relative to the eye, view axes, m.
fn clip_from_view(place: vec3<f32>) -> vec4<f32> {
    let viewport = asteroid_target.viewport;
    let size = vec2(f32(viewport.size.x), f32(asteroid_target.rows));
    let row = f32(asteroid_target.first_row);
    if viewport.kind <= KIND_CUBE_FACE {
        // Perspective: pixel coordinates times w, so that hardware clips and interpolates correctly for a plane.
        let w = -place.z;
        let pixel_w = (viewport.plane_offset - vec2(0.0, row)) * w + viewport.plane_scale * place.xy;
        return vec4(2.0 * pixel_w.x / size.x - w, w - 2.0 * pixel_w.y / size.y, asteroid_target.near, w);
    }
    let image = pixel_of(place);
    if image.z == 0.0 {
        // If there is no image, the position is beyond the far plane, where everything is clipped.
        return vec4(0.0, 0.0, -1.0, 1.0);
    }
    let ndc = 2.0 * (image.xy - vec2(0.0, row)) / size - 1.0;
    return vec4(ndc.x, -ndc.y, depth_of_place(place), 1.0);
}

// Whether a fading asteroid omits a sample at the target position `pixel`. A fade of at least 1 omits no samples, w draws the share w of the samples,
// and -w omits that share. The ordered pattern of 8 x 8 samples is fixed on the target.
fn faded(fade: f32, pixel: vec2<u32>) -> bool {
    if fade >= 1.0 {
        return false;
    }
    let position = pixel + vec2(0u, asteroid_target.first_row * asteroid_target.samples);
    let mixed = vec2(position.x ^ position.y, position.y);
    var order = 0u;
    for (var bit = 0u; bit < 3u; bit++) {
        order = (order << 2u) | (((mixed.x >> bit) & 1u) << 1u) | ((mixed.y >> bit) & 1u);
    }
    let threshold = (f32(order) + 0.5) / 64.0;
    return select(threshold >= fade, threshold < -fade, fade < 0.0);
}
