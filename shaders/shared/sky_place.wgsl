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

// Direction in terms of the face of a cube that contains it.
struct FaceDirection {
    // Index of the face.
    number: u32,
    right: f32,
    up: f32,
    // Towards the centre of the face; positive.
    along: f32,
}

fn face_direction(towards: vec3<f32>) -> FaceDirection {
    let sizes = abs(towards);
    let first = sizes.x >= sizes.y && sizes.x >= sizes.z;
    let second = !first && sizes.y >= sizes.z;
    // Components along the axis, along the next axis, and along the previous axis.
    let along = select(select(towards.zxy, towards.yzx, second), towards, first);
    let behind = along.x < 0.0;
    let number = select(select(2u, 1u, second), 0u, first) + select(0u, 3u, behind);
    return FaceDirection(number, select(along.z, -along.z, behind), along.y, abs(along.x));
}

// Converts a unit direction, world axes.
fn picture_direction(towards: vec3<f32>) -> PictureDirection {
    let face = face_direction(towards);
    let across = sqrt(face.right * face.right + face.up * face.up);
    let angle = precise_atan2(across, face.along);
    return PictureDirection(face.number, vec2(face.right, -face.up) * select(angle / across, 1.0, across < 1e-6));
}

// Returns the unit direction, world axes, of an offset from the centre of a picture.
fn direction_of_picture(direction: PictureDirection) -> vec3<f32> {
    let angle = length(direction.offset);
    let across = direction.offset * select(precise_sin(angle) / angle, 1.0, angle < 1e-6);
    let behind = direction.number >= 3u;
    // Components along the axis, along the next axis, and along the previous axis.
    let along = vec3(select(precise_cos(angle), -precise_cos(angle), behind), -across.y, select(across.x, -across.x, behind));
    let axis = select(direction.number, direction.number - 3u, behind);
    return select(select(along.yzx, along.zxy, axis == 1u), along, axis == 0u);
}

// Returns the position of a direction in its picture: texels from the centre of the first one.
fn place_in_face(map: SkyMap, direction: PictureDirection) -> vec2<f32> {
    return 0.5 * f32(map.side) - 0.5 + direction.offset * map.texels_per_rad;
}

// Returns the texel position of a direction in the pictures of a map.
fn sky_place(map: SkyMap, direction: PictureDirection) -> TexelPlace {
    let place = place_in_face(map, direction);
    let corner = floor(place);
    let first = (direction.number * map.side + u32(i32(corner.y))) * map.side + u32(i32(corner.x));
    return TexelPlace(first, place - corner);
}
