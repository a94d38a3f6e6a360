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

// A direction as pictures of any size have it.
struct PictureDirection {
    // Number of the picture.
    number: u32,
    // To the right and down from its middle, rad.
    offset: vec2<f32>,
}

// Of a unit direction, world axes.
fn picture_direction(towards: vec3<f32>) -> PictureDirection {
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
    return PictureDirection(number, vec2(right, -along.y) * select(angle / across, 1.0, across < 1e-6));
}

// The place of a direction in the pictures of a map.
fn sky_place(map: SkyMap, direction: PictureDirection) -> TexelPlace {
    // Middles of texels are halves.
    let place = 0.5 * f32(map.side) - 0.5 + direction.offset * map.texels_per_rad;
    let corner = floor(place);
    let first = (direction.number * map.side + u32(i32(corner.y))) * map.side + u32(i32(corner.x));
    return TexelPlace(first, place - corner);
}
