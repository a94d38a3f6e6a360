// What the atlas shows of an asteroid: its tiles, blended where a ray meets their pictures.

#import asteroids/impostors/atlas
#import asteroids/impostors/tiles

struct Surface {
    coverage: f32,
    // Shape's axes, not normalised.
    normal: vec3<f32>,
    albedo: f32,
    // Towards the eye of the tile, bounding radii.
    depth: f32,
}

// Texture coordinates of a place on a tile, held far enough inside that no other tile is mixed in at that level.
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
    let at = tile_coordinates(tile, place, level);
    let normal = textureSampleLevel(normals, trilinear, at, layer, level);
    let surface = textureSampleLevel(surfaces, trilinear, at, layer, level);
    return Surface(surface.z, 2.0 * normal.xyz - 1.0, surface.x * atlas.albedo_scale, 2.0 * surface.y - 1.0);
}

// The texel of a tile at a place on it, at a level of the atlas.
fn texel_at(tile: u32, place: vec2<f32>, level: u32) -> vec2<u32> {
    let side = f32(atlas.tile_px);
    let texel = clamp(0.5 * side + (0.5 * side - 1.0) * place * vec2(1.0, -1.0), vec2(0.0), vec2(side - 0.5));
    return (vec2(tile & 65535u, tile >> 16u) * atlas.tile_px + vec2<u32>(texel)) >> vec2(level);
}

fn texel_depth(tile: u32, layer: u32, place: vec2<f32>, level: u32) -> f32 {
    return 2.0 * textureLoad(surfaces, texel_at(tile, place, level), layer, level).y - 1.0;
}

// What a ray shows.
struct Seen {
    coverage: f32,
    // Shape's axes, not normalised.
    normal: vec3<f32>,
    albedo: f32,
    // Where the surface lies along the ray beyond the square, bounding radii.
    beyond: f32,
}

// The tile at a place of the square.
fn seen_on_tile(tile: u32, layer: u32, place: vec2<f32>, level: f32) -> Seen {
    let found = surface_of(tile, layer, place, level);
    return Seen(found.coverage, found.normal, found.albedo, -found.depth);
}

// The same without a filter: of a tile whose texels are no larger than samples.
fn texel_seen(tile: u32, layer: u32, place: vec2<f32>, level: u32) -> Seen {
    let at = texel_at(tile, place, level);
    let normal = textureLoad(normals, at, layer, level);
    let surface = textureLoad(surfaces, at, layer, level);
    return Seen(surface.z, 2.0 * normal.xyz - 1.0, surface.x * atlas.albedo_scale, 1.0 - 2.0 * surface.y);
}

// A tile where a ray meets its picture at the depth that it holds there. `start`: from the middle to the place on the square, bounding radii;
// `along`: the ray; both in the shape's axes.
fn seen_with_parallax(tile: u32, layer: u32, start: vec3<f32>, along: vec3<f32>, level: f32) -> Seen {
    let axes = octahedral_axes(vec2(tile & 65535u, tile >> 16u));
    let approach = dot(along, axes.direction);
    let before = dot(start, axes.direction);
    var reach = -before / approach;
    for (var i = 0u; i < 2u; i++) {
        let point = start + reach * along;
        let depth = depth_of(tile, layer, vec2(dot(point, axes.right), dot(point, axes.up)), level);
        reach = (depth - before) / approach;
    }
    let point = start + reach * along;
    let found = surface_of(tile, layer, vec2(dot(point, axes.right), dot(point, axes.up)), level);
    return Seen(found.coverage, found.normal, found.albedo, (found.depth - before) / approach);
}

// Three tiles with their weights, each with parallax.
fn seen_in_blend(
    tiles: vec3<u32>, weights: vec3<f32>, layer: u32, start: vec3<f32>, along: vec3<f32>, level: f32) -> Seen {
    var sum = Seen(0.0, vec3(0.0), 0.0, 0.0);
    for (var k = 0u; k < 3u; k++) {
        let weight = weights[k];
        if weight <= 0.0 {
            continue;
        }
        let found = seen_with_parallax(tiles[k], layer, start, along, level);
        let share = weight * found.coverage;
        sum.coverage += share;
        sum.normal += share * found.normal;
        sum.albedo += share * found.albedo;
        sum.beyond += share * found.beyond;
    }
    sum.albedo /= max(sum.coverage, 1e-6);
    sum.beyond /= max(sum.coverage, 1e-6);
    return sum;
}
