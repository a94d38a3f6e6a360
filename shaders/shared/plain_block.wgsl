// Flags of the plain blocks of a picture. The importer binds `plain_grids` and `counters`.

#import constants/plain_blocks
#import structs/PlainGrid

// Whether the frame has plain blocks.
override HAS_PLAIN: bool = false;

// Flags of the block that contains a pixel of a picture.
fn block_flags(viewport: u32, pixel: vec2<u32>) -> u32 {
    if !HAS_PLAIN {
        return BLOCK_IS_MIXED;
    }
    let grid = plain_grids[viewport];
    return counters[grid.first_flag + pixel.y / PLAIN_BLOCK * grid.block_columns + pixel.x / PLAIN_BLOCK];
}
