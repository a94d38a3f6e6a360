// Reads impostors' atlas and lights them by the strongest sun. Colour: luminance in units of the target, alpha 1. Depth
// is that of the surface, so that impostors and meshes meet where their surfaces do.

#import asteroids/impostors/atlas
#import asteroids/impostors/tiles
#import constants/impostors
#import shared/reflection
#import source = asteroids/listed | asteroids/impostors/given

struct ImpostorFragment {
    @builtin(frag_depth) depth: f32,
    @location(0) colour: vec4<f32>,
}

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
    let surface = textureSampleLevel(surfaces, trilinear, at, layer, level).xy;
    return Surface(normal.w, 2.0 * normal.xyz - 1.0, surface.x * atlas.albedo_scale, 2.0 * surface.y - 1.0);
}

@fragment
fn shade_impostor(corner: ImpostorCorner) -> ImpostorFragment {
    // Texels of the finest level per sample of the target.
    let step = max(length(dpdx(corner.offset)), length(dpdy(corner.offset)));
    let texels = step * (0.5 * f32(atlas.tile_px) - 1.0);
    let level = clamp(log2(max(texels, 1e-6)), 0.0, f32(atlas.levels - 1u));
    let layer = corner.tiles.w;
    let view_from_shape = mat3x3(corner.view_from_shape_x, corner.view_from_shape_y, corner.view_from_shape_z);
    let square = corner.centre.xyz + corner.offset;
    let ray = normalize(square);
    var sum = Surface(0.0, vec3(0.0), 0.0, 0.0);
    // Where the surface lies along the ray beyond the square, times coverage.
    var beyond = 0.0;
    if METHOD == METHOD_BLEND {
        let shape_from_view = transpose(view_from_shape);
        let start = shape_from_view * corner.offset;
        let along = shape_from_view * ray;
        for (var k = 0u; k < 3u; k++) {
            let weight = corner.weights[k];
            if weight <= 0.0 {
                continue;
            }
            // Each tile where the ray meets its picture at the depth that it holds there.
            let tile = corner.tiles[k];
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
            let share = weight * found.coverage;
            sum.coverage += share;
            sum.normal += share * found.normal;
            sum.albedo += share * found.albedo;
            beyond += share * (found.depth - before) / approach;
        }
        sum.albedo /= max(sum.coverage, 1e-6);
        beyond /= max(sum.coverage, 1e-6);
    } else {
        sum = surface_of(corner.tiles.x, layer, corner.place, level);
        beyond = -sum.depth;
    }
    if sum.coverage < 0.5 || faded(corner.sun.w, vec2<u32>(corner.clip.xy)) {
        discard;
    }
    let normal = normalize(view_from_shape * sum.normal);
    // What is seen faces the eye, also at the limb of a tile whose direction is a little off.
    let cos_e = max(dot(normal, -ray), 1e-3);
    let light = sum.albedo * reflected(u32(corner.luminance.w), dot(normal, corner.sun.xyz), cos_e);
    let place = clip_from_view((square + beyond * ray) * corner.centre.w);
    return ImpostorFragment(clamp(place.z / place.w, 0.0, 1.0), vec4(corner.luminance.xyz * light, 1.0));
}
