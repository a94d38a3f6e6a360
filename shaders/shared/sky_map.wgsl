// Reads the map of faint light in a direction. The importer binds `sky_texels`.

#import shared/sky_pieces
#import shared/sky_place
#import shared/sky_texel

// A picture of the map: one of the whole sky, or a piece.
struct SkyPicture {
    // Index of its first texel.
    first: u32,
    // Its width, texels.
    width: u32,
    piece: Piece,
}

// Returns the picture that contains a direction.
fn sky_picture(map: SkyMap, direction: PictureDirection) -> SkyPicture {
    var picture: SkyPicture;
    if map.pieces_per_edge > 0u {
        let first = first_of_piece(map.pieces_per_edge, direction_of_picture(direction));
        picture = SkyPicture(first + PIECE_WORDS, sky_texels[first + PIECE_WORDS - 1u], piece_at(first));
    } else {
        picture.first = direction.number * map.side * map.side;
        picture.width = map.side;
    }
    return picture;
}

// Returns the position of a direction in a picture, texels from the centre of the first one.
fn place_in_picture(map: SkyMap, picture: SkyPicture, direction: PictureDirection) -> vec2<f32> {
    if map.pieces_per_edge > 0u {
        return place_in_piece(picture.piece, direction_of_picture(direction));
    }
    return place_in_face(map, direction);
}

// Returns the luminance at a position in a picture, cd/m^2, interpolated between four texels. `first`: index of its first texel; `width`: texels.
fn light_in_picture(map: SkyMap, first: u32, width: u32, place: vec2<f32>) -> vec3<f32> {
    let corner = floor(place);
    let share = place - corner;
    let start = first + u32(i32(corner.y)) * width + u32(i32(corner.x));
    let upper = mix(light_of_texel(sky_texels[start]), light_of_texel(sky_texels[start + 1u]), share.x);
    let below = start + width;
    let lower = mix(light_of_texel(sky_texels[below]), light_of_texel(sky_texels[below + 1u]), share.x);
    return map.unit_cd_m2 * mix(upper, lower, share.y);
}
