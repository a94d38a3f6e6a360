// Pieces of a map of the sky: small flat pictures, read in a direction. The division of the sky is that of
// crates/render/src/plan/smooth_light/pieces.rs. The importer binds `sky_texels`: the address of each piece, in the order of their numbers, then the
// pieces, each with three axes of four words before its texels.

#import constants/sky_pieces
#import shared/sky_place

// Axes of the picture of a piece.
struct Piece {
    // Right and down, texels; w: position of the centre, measured from the centre of the first texel.
    right: vec4<f32>,
    down: vec4<f32>,
    // Towards the centre, a unit vector.
    outwards: vec3<f32>,
}

// Returns the column or row of a piece, from the tangent of an angle along the edge of a face.
fn along_edge(per_edge: u32, tangent: f32) -> u32 {
    let edge = tangent * (1.0 + PIECE_EVENNESS) / (1.0 + PIECE_EVENNESS * abs(tangent));
    return min(u32(0.5 * (edge + 1.0) * f32(per_edge)), per_edge - 1u);
}

// Returns the index of the first word of the piece that contains a unit direction, world axes.
fn first_of_piece(per_edge: u32, towards: vec3<f32>) -> u32 {
    let face = face_direction(towards);
    let column = along_edge(per_edge, face.right / face.along);
    let row = along_edge(per_edge, -face.up / face.along);
    return sky_texels[(face.number * per_edge + row) * per_edge + column];
}

fn axis_of_piece(first: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(
        vec4(sky_texels[first], sky_texels[first + 1u], sky_texels[first + 2u], sky_texels[first + 3u]));
}

fn piece_at(first: u32) -> Piece {
    return Piece(axis_of_piece(first), axis_of_piece(first + 4u), axis_of_piece(first + 8u).xyz);
}

// Returns the position of a unit direction, world axes, in the picture of a piece: texels from the centre of the first one.
fn place_in_piece(piece: Piece, towards: vec3<f32>) -> vec2<f32> {
    let offset = vec2(dot(towards, piece.right.xyz), dot(towards, piece.down.xyz)) / dot(towards, piece.outwards);
    return offset + vec2(piece.right.w, piece.down.w);
}
