// Surface of an asteroid from the atlas: blends tiles at the intersection of a ray with their pictures.

#import asteroids/impostors/atlas
#import asteroids/impostors/tiles

struct Surface {
    coverage: f32,
    // Shape's axes, not normalised.
    normal: vec3<f32>,
    albedo: f32,
    // Depth towards the tile's eye, bounding radii.
    depth: f32,
}

// Returns the texture coordinates of a position on a tile, clamped so that filtering at this level does not read other tiles.
fn tile_coordinates(tile: u32, place: vec2<f32>, level: f32) -> vec2<f32> {
    let side = f32(atlas.tile_px);
    let margin = 0.5 * exp2(ceil(level));
    let texel = clamp(0.5 * side + (0.5 * side - 1.0) * place * vec2(1.0, -1.0), vec2(margin), vec2(side - margin));
    let corner = vec2(f32(tile & 65535u), f32(tile >> 16u)) * side;
    return (corner + texel) / (f32(atlas.tiles) * side);
}

fn depth_of(tile: u32, layer: u32, place: vec2<f32>, level: f32) -> f32 {
    return 2.0 * textureSampleLevel(surfaces, trilinear, tile_coordinates(tile, place, level), layer, level).y - 1.0;
}

fn surface_of(tile: u32, layer: u32, place: vec2<f32>, level: f32) -> Surface {
    let coordinates = tile_coordinates(tile, place, level);
    let normal = textureSampleLevel(normals, trilinear, coordinates, layer, level);
    let surface = textureSampleLevel(surfaces, trilinear, coordinates, layer, level);
    return Surface(surface.z, 2.0 * normal.xyz - 1.0, surface.x * atlas.albedo_scale, 2.0 * surface.y - 1.0);
}

// Surface seen along a ray.
struct Seen {
    coverage: f32,
    // Shape's axes, not normalised.
    normal: vec3<f32>,
    albedo: f32,
    // Distance of the surface beyond the square along the ray, bounding radii.
    beyond: f32,
}

// Returns the surface of a tile at a position of the square.
fn seen_on_tile(tile: u32, layer: u32, place: vec2<f32>, level: f32) -> Seen {
    let found = surface_of(tile, layer, place, level);
    return Seen(found.coverage, found.normal, found.albedo, -found.depth);
}

// How positions on tiles are found: the number of steps towards the intersection of the ray with the depth stored in the tile, and the share of that
// depth that is used.
struct Parallax {
    steps: u32,
    share: f32,
}

// Blends three tiles. `start`: vector from the centre to the position on the square, bounding radii; `along`: the ray;
// both in the shape's axes.
fn seen_in_blend(
    tiles: vec3<u32>, weights: vec3<f32>, layer: u32, start: vec3<f32>, along: vec3<f32>, parallax: Parallax, level: f32) -> Seen {
    var sum = Seen(0.0, vec3(0.0), 0.0, 0.0);
    for (var k = 0u; k < 3u; k++) {
        let weight = weights[k];
        if weight <= 0.0 {
            continue;
        }
        let tile = tiles[k];
        let axes = octahedral_axes(vec2(tile & 65535u, tile >> 16u));
        let approach = dot(along, axes.direction);
        let before = dot(start, axes.direction);
        var reach = -before / approach;
        for (var i = 0u; i < parallax.steps; i++) {
            let point = start + reach * along;
            let depth = depth_of(tile, layer, vec2(dot(point, axes.right), dot(point, axes.up)), level);
            reach = (parallax.share * depth - before) / approach;
        }
        let point = start + reach * along;
        let found = surface_of(tile, layer, vec2(dot(point, axes.right), dot(point, axes.up)), level);
        let share = weight * found.coverage;
        sum.coverage += share;
        sum.normal += share * found.normal;
        sum.albedo += share * found.albedo;
        sum.beyond += share * (found.depth - before) / approach;
    }
    sum.albedo /= max(sum.coverage, 1e-6);
    sum.beyond /= max(sum.coverage, 1e-6);
    return sum;
}
