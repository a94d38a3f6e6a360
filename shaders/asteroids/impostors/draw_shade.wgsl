// Shades impostors: reads the atlas, and lights the surface with the strongest sun. Colour: luminance in units of the target, alpha 1. Depth is that
// of the surface, so that impostors and meshes intersect correctly.

#import asteroids/impostors/atlas
#import asteroids/impostors/surface
#import constants/impostors
#import shared/reflection
#import source = asteroids/listed | asteroids/impostors/given

struct ImpostorFragment {
    @builtin(frag_depth) depth: f32,
    @location(0) colour: vec4<f32>,
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
    var seen: Seen;
    if METHOD == METHOD_BLEND {
        let shape_from_view = transpose(view_from_shape);
        seen = seen_in_blend(
            corner.tiles.xyz, corner.weights, layer, shape_from_view * corner.offset, shape_from_view * ray, Parallax(2u, 1.0), level);
    } else {
        seen = seen_on_tile(corner.tiles.x, layer, corner.place, level);
    }
    if seen.coverage < 0.5 || faded(corner.sun.w, vec2<u32>(corner.clip.xy)) {
        discard;
    }
    let normal = normalize(view_from_shape * seen.normal);
    // Visible surfaces face the eye, even at the limb of a tile whose direction deviates slightly.
    let cos_e = max(dot(normal, -ray), 1e-3);
    let light = seen.albedo * reflected(u32(corner.luminance.w), dot(normal, corner.sun.xyz), cos_e);
    let place = clip_from_view((square + seen.beyond * ray) * corner.centre.w);
    return ImpostorFragment(clamp(place.z / place.w, 0.0, 1.0), vec4(corner.luminance.xyz * light, 1.0));
}
