// Footprint of an impostor on the samples of a target, and its surface there.
//
// One division maps between positions on the square that faces the eye and samples. The map is exact on flat pictures. On other pictures it is linear
// around the centre. Its error is below that of straight edges and at most half a pixel, since larger images are drawn through flat faces.

#import asteroids/impostors/atlas
#import asteroids/impostors/splat_band
#import asteroids/impostors/square
#import asteroids/impostors/surface
#import asteroids/listed
#import constants/asteroid_classes
#import structs/SplatTarget

@group(2) @binding(0) var<uniform> splat: SplatTarget;

// Whether three tiles are blended with parallax. Impostors too small for a visible difference use one tile.
override PARALLAX: bool;

struct Footprint {
    // Index of the entry in the lists.
    slot: u32,
    asteroid: Asteroid,
    // Centre relative to the eye in units of `radius`, view axes, and that radius, m.
    centre: vec3<f32>,
    radius: f32,
    square: Square,
    // Map from a sample's centre relative to the square's centre, (x, y, 1), to a position on the square: (across,
    // upward) / beneath.
    across: vec2<f32>,
    upward: vec2<f32>,
    beneath: vec2<f32>,
    // Sample coordinates of the centre; first sample that it may touch, and end of that range.
    middle: vec2<f32>,
    first: vec2<i32>,
    end: vec2<i32>,
    // Upper limit of its depth values.
    nearest: f32,
    // Nearest tile: the one with the greatest weight of the three.
    tile: u32,
    // Share of the depth that is used for the parallax of tiles. It is also the share of the two other tiles.
    parallax: f32,
    // Level of the atlas, an integer: its texels are at most as large as samples, if such a level exists.
    level: f32,
}

// Returns the footprint of an entry of the lists. An entry that touches no samples has an empty range.
fn footprint_of(slot: u32) -> Footprint {
    let asteroid = load_asteroid(slot);
    let viewport = asteroid_target.viewport;
    let on_plane = viewport.kind <= KIND_CUBE_FACE;
    let radius = asteroid.radius * bound_of_shape(asteroid.first_shape + asteroid.shape);
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
        // Intersection of the ray through a sample with the square's plane. It is linear in the sample, except for one division.
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
    // Half of the box around the ellipse of the bounding sphere, samples. It follows from the rows of the inverse of the two rows above.
    let turn = footprint.across.x * footprint.upward.y - footprint.across.y * footprint.upward.x;
    let inverse_x = vec2(footprint.upward.y, -footprint.across.y) / turn;
    let inverse_y = vec2(-footprint.upward.x, footprint.across.x) / turn;
    let outer = vec2(length(inverse_x), length(inverse_y));
    // Perspective enlarges one side of it.
    let half = outer * (1.0 + 2.0 * dot(abs(footprint.beneath), outer)) + 0.5;
    exists = exists && all(half < vec2(1e6));
    let size = vec2(f32(splat.band.width), f32(splat.band.rows));
    let shifted = footprint.middle - vec2(0.0, f32(splat.band.first_row));
    let first = clamp(floor(shifted - half), vec2(0.0), size);
    let end = clamp(ceil(shifted + half), vec2(0.0), size);
    footprint.first = vec2<i32>(first) + vec2(0, i32(splat.band.first_row));
    footprint.end = select(footprint.first, vec2<i32>(end) + vec2(0, i32(splat.band.first_row)), vec2(exists));
    // The depth limit is that of the nearest possible point: its position on the square and its depth along the ray are each at most the radius of
    // the outline.
    let reach = select(distance, -centre.z, on_plane) - 1.4143 * sqrt(outline_squared);
    footprint.nearest = asteroid_target.near / (max(reach, 1e-6) * radius);
    // Size of a sample on the square, in bounding radii, and the bounding radius in pixels.
    let step = max(
        length(vec2(footprint.across.x, footprint.upward.x)), length(vec2(footprint.across.y, footprint.upward.y)));
    let radius_px = max(outer.x, outer.y) / samples * inverseSqrt(outline_squared) * splat.quality;
    let texels = step * sqrt(outline_squared) * (0.5 * f32(atlas.tile_px) - 1.0);
    footprint.level = floor(clamp(log2(max(texels, 1e-6)), 0.0, f32(atlas.levels - 1u)));
    // A single tile is sufficient if the errors of its direction and of its parallel projection are at most half a
    // pixel. Parallax and the other tiles fade in over a tenth of the distance.
    let wrong = max(2.0 * splat.tile_error_rad * radius_px, radius_px / distance);
    footprint.parallax = clamp((wrong * (1.0 + BAND) - 1.0) / BAND, 0.0, 1.0);
    footprint.tile = square.tiles[heaviest(square.weights)];
    return footprint;
}

// Returns half the distance between the images of the points at +side and -side of a position, pixels. If one of the points has no image, it is the
// one-sided difference from the position itself.
fn difference_of_pixels(place: vec3<f32>, side: vec3<f32>) -> vec2<f32> {
    let one = pixel_of(place + side);
    let other = pixel_of(place - side);
    let between = pixel_of(place);
    if one.z > 0.0 && other.z > 0.0 {
        return 0.5 * (one.xy - other.xy);
    }
    return select(between.xy - other.xy, one.xy - between.xy, one.z > 0.0);
}

// Returns the position of a sample on the square. Outside the bounding sphere its length exceeds 1.
fn place_on_square(footprint: Footprint, sample_at: vec2<i32>) -> vec2<f32> {
    let offset = vec2<f32>(sample_at) + 0.5 - footprint.middle;
    return vec2(dot(footprint.across, offset), dot(footprint.upward, offset)) / (1.0 + dot(footprint.beneath, offset));
}

fn heaviest(weights: vec3<f32>) -> u32 {
    let greatest = max(weights.x, max(weights.y, weights.z));
    return select(select(2u, 1u, weights.y == greatest), 0u, weights.x == greatest);
}

// Returns the coverage and depth at a position of the square, and along the ray through it.
fn shape_at(footprint: Footprint, place: vec2<f32>, ray: vec3<f32>, offset: vec3<f32>) -> Seen {
    if !PARALLAX {
        return seen_on_tile(footprint.tile, footprint.asteroid.shape, place, footprint.level);
    }
    let nearest_alone = vec3<f32>(vec3(heaviest(footprint.square.weights)) == vec3(0u, 1u, 2u));
    return blended(footprint, mix(nearest_alone, footprint.square.weights, footprint.parallax), ray, offset);
}

// Returns the full appearance at that position. The normals of a single tile could be wrong by up to the angle between tiles.
fn appearance_at(footprint: Footprint, ray: vec3<f32>, offset: vec3<f32>) -> Seen {
    return blended(footprint, footprint.square.weights, ray, offset);
}

fn blended(footprint: Footprint, weights: vec3<f32>, ray: vec3<f32>, offset: vec3<f32>) -> Seen {
    let start = offset * footprint.asteroid.view_from_shape;
    let along = ray * footprint.asteroid.view_from_shape;
    let parallax = Parallax(select(0u, 2u, PARALLAX), footprint.parallax);
    return seen_in_blend(footprint.square.tiles, weights, footprint.asteroid.shape, start, along, parallax, footprint.level);
}
