// The samples that impostors are splatted onto at once.

#import constants/impostors

struct SplatBand {
    // Samples in a row, the first row of the target, and their number.
    width: u32,
    first_row: u32,
    rows: u32,
    // Blocks of samples in a row of them.
    blocks: u32,
}

// Where a sample stands, in blocks of 8 x 8: neighbours in both directions lie close together.
fn place_in_blocks(at: vec2<u32>, blocks: u32) -> u32 {
    let block = at / SPLAT_BLOCK;
    let within = at % SPLAT_BLOCK;
    return (block.y * blocks + block.x) * (SPLAT_BLOCK * SPLAT_BLOCK) + within.y * SPLAT_BLOCK + within.x;
}
