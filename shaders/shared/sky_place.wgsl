// Six round pictures of the sky, read in a direction. The pictures' axes are those of `world_from_face` in
// crates/sky/src/sky_pictures.rs.

#import shared/math
#import structs/SkyMap

// Position between four texels.
struct TexelPlace {
    // Index of the upper left texel.
    first: u32,
    // Weights of the right texels and of the lower texels.
    share: vec2<f32>,
}

// Direction in terms of a picture of any size.
struct PictureDirection {
    // Index of the picture.
    number: u32,
    // Offset to the right and down from the picture's centre, rad.
    offset: vec2<f32>,
}

// Converts a unit direction, world axes.
fn picture_direction(towards: vec3<f32>) -> PictureDirection {
    let sizes = abs(towards);
    let first = sizes.x >= sizes.y && sizes.x >= sizes.z;
    let second = !first && sizes.y >= sizes.z;
    // Components along the axis, along the next axis, and along the previous axis.
    let along = select(select(towards.zxy, towards.yzx, second), towards, first);
    let behind = along.x < 0.0;
    let number = select(select(2u, 1u, second), 0u, first) + select(0u, 3u, behind);
    let right = select(along.z, -along.z, behind);
    let across = sqrt(right * right + along.y * along.y);
    let angle = precise_atan2(across, abs(along.x));
    return PictureDirection(number, vec2(right, -along.y) * select(angle / across, 1.0, across < 1e-6));
}

// Texel position of a direction in the pictures of a map.
fn sky_place(map: SkyMap, direction: PictureDirection) -> TexelPlace {
    // Centres of texels are at half-integers.
    let place = 0.5 * f32(map.side) - 0.5 + direction.offset * map.texels_per_rad;
    let corner = floor(place);
    let first = (direction.number * map.side + u32(i32(corner.y))) * map.side + u32(i32(corner.x));
    return TexelPlace(first, place - corner);
}
