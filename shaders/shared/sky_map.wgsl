// The map of faint light, read towards a direction. The importer binds `sky_texels`.

#import shared/math
#import shared/sky_texel

// Where the map's texels lie.
struct SkyMap {
    // Luminance of a texel's unit, cd/m^2.
    unit_cd_m2: f32,
    texels_per_rad: f32,
    // Side of a picture, texels.
    side: u32,
    unused_0: u32,
}

// Luminance towards a unit direction, world axes, cd/m^2, between four texels. The pictures' axes are those of `world_from_face` in
// src/plan/smooth_light.rs.
fn sky_luminance(map: SkyMap, towards: vec3<f32>) -> vec3<f32> {
    let sizes = abs(towards);
    let first = sizes.x >= sizes.y && sizes.x >= sizes.z;
    let second = !first && sizes.y >= sizes.z;
    // Along the axis, along the one after it, along the one before it.
    let along = select(select(towards.zxy, towards.yzx, second), towards, first);
    let behind = along.x < 0.0;
    let number = select(select(2u, 1u, second), 0u, first) + select(0u, 3u, behind);
    let right = select(along.z, -along.z, behind);
    let across = sqrt(right * right + along.y * along.y);
    let angle = precise_atan2(across, abs(along.x));
    let scale = select(angle / across, 1.0, across < 1e-6) * map.texels_per_rad;
    // Middles of texels are halves.
    let place = 0.5 * f32(map.side) - 0.5 + vec2(right, -along.y) * scale;
    let corner = floor(place);
    let share = place - corner;
    let start = (number * map.side + u32(i32(corner.y))) * map.side + u32(i32(corner.x));
    let upper = mix(light_of_texel(sky_texels[start]), light_of_texel(sky_texels[start + 1u]), share.x);
    let lower =
        mix(light_of_texel(sky_texels[start + map.side]), light_of_texel(sky_texels[start + map.side + 1u]), share.x);
    return map.unit_cd_m2 * mix(upper, lower, share.y);
}
