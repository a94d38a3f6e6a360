// Flags of the plain blocks of a picture. The importer binds `plain_grids` and `counters`.

#import constants/plain_blocks
#import shared/plain_flag

// Whether the frame has plain blocks.
override HAS_PLAIN: bool = false;

// Returns the flags of the block that contains a pixel of a picture.
fn block_flags(viewport: u32, pixel: vec2<u32>) -> u32 {
    if !HAS_PLAIN {
        return BLOCK_IS_MIXED;
    }
    return counters[flag_of_pixel(plain_grids[viewport], pixel)];
}
