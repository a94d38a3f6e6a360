// Where an impostor falls onto the samples of a target, and what it shows there.
//
// A place on the square that faces the eye and a sample are mapped onto each other in one division: on flat pictures exactly, on others by
// the derivative at the middle, which is off by less than straight edges are there, half a pixel at most: others go through flat faces.

#import asteroids/impostors/atlas
#import asteroids/impostors/splat_band
#import asteroids/impostors/square
#import asteroids/impostors/surface
#import asteroids/listed
#import constants/asteroid_classes

struct SplatTarget {
    band: SplatBand,
    // First word of the list's arguments: workgroups along x, y and z, number of entries, first entry.
    arguments: u32,
    // 0: the greatest depth of every sample is found; 1: whose it is; 2: samples are lit.
    stage: u32,
    // Factor on distances of detail.
    quality: f32,
    // Greatest error of the direction of the nearest tile, rad.
    tile_error_rad: f32,
}

@group(2) @binding(0) var<uniform> splat: SplatTarget;

// Whether three tiles are blended, each with parallax: impostors that are too small to tell are others.
override PARALLAX: bool;

struct Footprint {
    // Entry of the lists.
    slot: u32,
    asteroid: Asteroid,
    // The middle relative to the eye, view axes, and the radius that it is measured in, m.
    centre: vec3<f32>,
    radius: f32,
    square: Square,
    // From a sample's centre relative to the middle of the square (x, y, 1) to a place on it: (across, upward) / beneath.
    across: vec2<f32>,
    upward: vec2<f32>,
    beneath: vec2<f32>,
    // Sample coordinates of the middle; of what it may touch the first sample and the one behind the last.
    middle: vec2<f32>,
    first: vec2<i32>,
    end: vec2<i32>,
    // Depth that nothing of it exceeds.
    nearest: f32,
    // The nearest tile; its place among the three is that of the greatest weight.
    tile: u32,
    // Share of the depth that counts for where tiles are read, and of the two other tiles.
    parallax: f32,
    // Level of the atlas, a whole number: its texels are no larger than samples where the atlas has such.
    level: f32,
}

// The footprint of an entry of the lists. One that touches nothing has no samples.
fn footprint_of(slot: u32) -> Footprint {
    let asteroid = load_asteroid(slot);
    let viewport = asteroid_target.viewport;
    let on_plane = viewport.kind <= KIND_CUBE_FACE;
    let radius = asteroid.radius * shapes[asteroid.first_shape + asteroid.shape].bound;
    let centre = asteroid.centre / radius;
    let distance = length(centre);
    let square = facing_square(centre, asteroid.view_from_shape, true);
    var footprint: Footprint;
    footprint.slot = slot;
    footprint.asteroid = asteroid;
    footprint.centre = centre;
    footprint.radius = radius;
    footprint.square = square;
    let samples = f32(asteroid_target.samples);
    let row = vec2(0.0, f32(asteroid_target.first_row));
    let middle = pixel_of(asteroid.centre);
    footprint.middle = (middle.xy - row) * samples;
    var exists = middle.z > 0.0 && distance > 1.0;
    let outline_squared = dot(square.right, square.right);
    if on_plane {
        // The ray through a sample meets the plane of the square; all of it is linear in the sample but for a division.
        let axis = max(-centre.z, 1e-6);
        let steps = 1.0 / (viewport.plane_scale * samples);
        footprint.across = square.right.xy * steps * (axis / outline_squared);
        footprint.upward = square.up.xy * steps * (axis / outline_squared);
        footprint.beneath = centre.xy * steps * (axis / (distance * distance));
    } else {
        let right = difference_of_pixels(asteroid.centre, square.right * radius) * samples;
        let up = difference_of_pixels(asteroid.centre, square.up * radius) * samples;
        let area = right.x * up.y - right.y * up.x;
        exists = exists && abs(area) > 1e-12;
        footprint.across = vec2(up.y, -up.x) / area;
        footprint.upward = vec2(-right.y, right.x) / area;
        footprint.beneath = vec2(0.0);
    }
    // Half the box around the ellipse of the bounding sphere, samples: rows of the inverse of the two rows above.
    let turn = footprint.across.x * footprint.upward.y - footprint.across.y * footprint.upward.x;
    let inverse_x = vec2(footprint.upward.y, -footprint.across.y) / turn;
    let inverse_y = vec2(-footprint.upward.x, footprint.across.x) / turn;
    let outer = vec2(length(inverse_x), length(inverse_y));
    // Perspective makes one side of it larger.
    let half = outer * (1.0 + 2.0 * dot(abs(footprint.beneath), outer)) + 0.5;
    exists = exists && all(half < vec2(1e6));
    let size = vec2(f32(splat.band.width), f32(splat.band.rows));
    let shifted = footprint.middle - vec2(0.0, f32(splat.band.first_row));
    let first = clamp(floor(shifted - half), vec2(0.0), size);
    let end = clamp(ceil(shifted + half), vec2(0.0), size);
    footprint.first = vec2<i32>(first) + vec2(0, i32(splat.band.first_row));
    footprint.end = select(footprint.first, vec2<i32>(end) + vec2(0, i32(splat.band.first_row)), vec2(exists));
    // A place on the square and a depth along the ray, each no more than the outline.
    let reach = select(distance, -centre.z, on_plane) - 1.4143 * sqrt(outline_squared);
    footprint.nearest = asteroid_target.near / (max(reach, 1e-6) * radius);
    // How far a sample reaches on the square, bounding radii; the bounding radius in pixels.
    let step = max(
        length(vec2(footprint.across.x, footprint.upward.x)), length(vec2(footprint.across.y, footprint.upward.y)));
    let radius_px = max(outer.x, outer.y) / samples * inverseSqrt(outline_squared) * splat.quality;
    let texels = step * sqrt(outline_squared) * (0.5 * f32(atlas.tile_px) - 1.0);
    footprint.level = floor(clamp(log2(max(texels, 1e-6)), 0.0, f32(atlas.levels - 1u)));
    // One tile will do as it is where its direction and its parallel projection are off by half a pixel at most. Parallax and the other
    // tiles set in over a tenth of the distance.
    let wrong = max(2.0 * splat.tile_error_rad * radius_px, radius_px / distance);
    footprint.parallax = clamp((wrong * (1.0 + BAND) - 1.0) / BAND, 0.0, 1.0);
    footprint.tile = square.tiles[heaviest(square.weights)];
    return footprint;
}

// Half the way on the picture from one side of a place to the other, pixels; from the place itself where a side has no image.
fn difference_of_pixels(place: vec3<f32>, side: vec3<f32>) -> vec2<f32> {
    let one = pixel_of(place + side);
    let other = pixel_of(place - side);
    let between = pixel_of(place);
    if one.z > 0.0 && other.z > 0.0 {
        return 0.5 * (one.xy - other.xy);
    }
    return select(between.xy - other.xy, one.xy - between.xy, one.z > 0.0);
}

// What a sample is on the square; outside of the bounding sphere the length exceeds 1.
fn place_on_square(footprint: Footprint, sample_at: vec2<i32>) -> vec2<f32> {
    let at = vec2<f32>(sample_at) + 0.5 - footprint.middle;
    return vec2(dot(footprint.across, at), dot(footprint.upward, at)) / (1.0 + dot(footprint.beneath, at));
}

fn heaviest(weights: vec3<f32>) -> u32 {
    let greatest = max(weights.x, max(weights.y, weights.z));
    return select(select(2u, 1u, weights.y == greatest), 0u, weights.x == greatest);
}

// What an impostor has at a place of its square, and the ray to there: whether anything, and where.
fn form_at(footprint: Footprint, place: vec2<f32>, ray: vec3<f32>, offset: vec3<f32>) -> Seen {
    if !PARALLAX {
        return seen_on_tile(footprint.tile, footprint.asteroid.shape, place, footprint.level);
    }
    let nearest_alone = vec3<f32>(vec3(heaviest(footprint.square.weights)) == vec3(0u, 1u, 2u));
    return blended(footprint, mix(nearest_alone, footprint.square.weights, footprint.parallax), ray, offset);
}

// What it looks like there. One tile's normals would be those of a face that is turned by up to the angle between tiles.
fn look_at(footprint: Footprint, ray: vec3<f32>, offset: vec3<f32>) -> Seen {
    return blended(footprint, footprint.square.weights, ray, offset);
}

fn blended(footprint: Footprint, weights: vec3<f32>, ray: vec3<f32>, offset: vec3<f32>) -> Seen {
    let start = offset * footprint.asteroid.view_from_shape;
    let along = ray * footprint.asteroid.view_from_shape;
    let parallax = Parallax(select(0u, 2u, PARALLAX), footprint.parallax);
    return seen_in_blend(footprint.square.tiles, weights, footprint.asteroid.shape, start, along, parallax, footprint.level);
}
