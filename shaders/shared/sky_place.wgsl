// Six round pictures of the sky, read towards a direction. The pictures' axes are those of `world_from_face` in src/sky_pictures.rs.

#import shared/math

// Where the texels of pictures lie.
struct SkyMap {
    // Luminance of a texel's unit, cd/m^2.
    unit_cd_m2: f32,
    texels_per_rad: f32,
    // Side of a picture, texels.
    side: u32,
    unused_0: u32,
}

// A place between four texels.
struct TexelPlace {
    // Index of the upper left one.
    first: u32,
    // Share of the right ones and of the lower ones.
    share: vec2<f32>,
}

// The place of a unit direction, world axes.
fn sky_place(map: SkyMap, towards: vec3<f32>) -> TexelPlace {
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
    return TexelPlace((number * map.side + u32(i32(corner.y))) * map.side + u32(i32(corner.x)), place - corner);
}
