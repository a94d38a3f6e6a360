// Orientation of an impostor's square that faces the eye, and its tiles.

#import asteroids/impostors/atlas
#import asteroids/impostors/tiles
#import constants/impostors

struct Square {
    // Half sides, view axes, bounding radii. The square contains the outline in perspective.
    right: vec3<f32>,
    up: vec3<f32>,
    // Up to three tiles, column in the low half of the word, row in the high half, and their weights.
    tiles: vec3<u32>,
    weights: vec3<f32>,
}

// Returns the square of an asteroid at `centre` (bounding radii, view axes). `blends`: three tiles are blended.
fn facing_square(centre: vec3<f32>, view_from_shape: mat3x3<f32>, blends: bool) -> Square {
    let distance = length(centre);
    let to_eye = -centre / distance;
    let direction = transpose(view_from_shape) * to_eye;
    let tile = octahedral_nearest(direction);
    var square: Square;
    square.tiles = vec3(tile.x | (tile.y << 16u), 0u, 0u);
    square.weights = vec3(1.0, 0.0, 0.0);
    if blends {
        let blend = octahedral_blend(direction);
        square.tiles = blend.tiles;
        square.weights = blend.weights;
    }
    // The tile's axes, rotated by the shortest arc until they face the eye.
    let axes = octahedral_axes(tile);
    let seen = view_from_shape * axes.direction;
    let between = (seen + to_eye) / (1.0 + dot(seen, to_eye));
    let right = view_from_shape * axes.right;
    let up = view_from_shape * axes.up;
    let outline = distance * inverseSqrt(max(distance * distance - 1.0, 1e-6));
    square.right = outline * (right - dot(right, to_eye) * between);
    square.up = outline * (up - dot(up, to_eye) * between);
    return square;
}
