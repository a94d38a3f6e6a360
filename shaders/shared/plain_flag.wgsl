// Positions of the flags of plain blocks in the counters.

#import constants/plain_blocks
#import structs/PlainGrid

// Returns the index of the counter that is the flag of the block that contains a pixel of a picture.
fn flag_of_pixel(grid: PlainGrid, pixel: vec2<u32>) -> u32 {
    return grid.first_flag + pixel.y / PLAIN_BLOCK * grid.block_columns + pixel.x / PLAIN_BLOCK;
}
