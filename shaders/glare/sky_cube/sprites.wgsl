// Sources drawn individually, for the passes that find them and the pass that draws them.

#import constants/glare_sprites
#import structs/GlareSprite
#import structs/GlareSpriteCell
#import structs/GlareView
#import structs/SkyCubeParameters

fn square_grid(parameters: SkyCubeParameters) -> vec3<u32> {
    return vec3((vec2(parameters.columns, parameters.rows) + SQUARE_BLOCKS - 1u) / SQUARE_BLOCKS, parameters.tiles);
}

// Returns the first word of the list of a block.
fn list_of_block(parameters: SkyCubeParameters, block: vec3<u32>) -> u32 {
    let number = (block.z * parameters.rows + block.y) * parameters.columns + block.x;
    return parameters.first_list + number * parameters.list_words;
}

// Whether a sprite visible to the view may reach a cone.
fn reaches(sprite: GlareSprite, view: GlareView, axis: vec3<f32>, chord: f32) -> bool {
    return sprite.inverse_squared <= view.greatest_inverse
        && length(sprite.direction - axis) <= chord + inverseSqrt(sprite.inverse_squared) * 1.00001;
}
