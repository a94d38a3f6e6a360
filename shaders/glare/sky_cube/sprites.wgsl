// Sources drawn individually, for the passes that search for them and that draw them.

#import constants/glare_sprites

struct GlareSprite {
    // Unit vector, world axes.
    direction: vec3<f32>,
    // 1 over the square of the chord at which it ends.
    inverse_squared: f32,
    // Linear Rec. 709, lx.
    light: vec3<f32>,
    // 1: it reaches as far as any, and is what the map's kernel leaves.
    whole: u32,
}

// Sprites of a part of the sky, or cells of a region of it.
struct GlareSpriteCell {
    // Unit vector to its middle.
    direction: vec3<f32>,
    // None of its sprites reaches a direction farther away than this chord.
    reach: f32,
    first: u32,
    count: u32,
    unused_0: u32,
    unused_1: u32,
}

// How a viewport sees the sky that glares.
struct GlareView {
    // The kernel within the square of a chord: coefficients of 1, u and u^2, u the square over that one.
    core: vec3<f32>,
    core_squared: f32,
    // Sprites whose inverse square is greater are too narrow for the view.
    greatest_inverse: f32,
    // First point of its map.
    first_point: u32,
    // Its own sources.
    first_near: u32,
    near_count: u32,
}

struct SkyCubeParameters {
    // What the map's kernel is within a square of a chord: coefficients of 1, u and u^2.
    soft: vec3<f32>,
    // 1 over that square.
    soft_inverse: f32,
    // Cells along an edge of a face of the map.
    edge_cells: u32,
    // Regions that have sprites.
    regions: u32,
    // Inverse square: its constant, 1/sr, and the square of the angle within which it stays the same, rad^2.
    constant: f32,
    inner_squared: f32,
    // Table of the kernel times the square of the chord: its first logarithm to base 2 of that square, entries per octave, number.
    first_octave: f32,
    entries_per_octave: f32,
    entries: u32,
    // Words of the list of a block and of a square of blocks; the first is the number of its sprites.
    list_words: u32,
    square_words: u32,
    // Blocks of the grid of this batch.
    columns: u32,
    rows: u32,
    tiles: u32,
}

fn square_grid(parameters: SkyCubeParameters) -> vec3<u32> {
    return vec3((vec2(parameters.columns, parameters.rows) + SQUARE_BLOCKS - 1u) / SQUARE_BLOCKS, parameters.tiles);
}

// Whether a sprite visible to the view may reach a cone.
fn reaches(sprite: GlareSprite, view: GlareView, axis: vec3<f32>, chord: f32) -> bool {
    return sprite.inverse_squared <= view.greatest_inverse
        && length(sprite.direction - axis) <= chord + inverseSqrt(sprite.inverse_squared) * 1.00001;
}
