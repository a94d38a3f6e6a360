// The samples that impostors are splatted onto at once.

struct SplatBand {
    // Samples in a row, the first row of the target, and their number.
    width: u32,
    first_row: u32,
    rows: u32,
    // Blocks of samples in a row of them.
    blocks: u32,
}

const BLOCK: u32 = 8u;

// Where a sample stands, in blocks of 8 x 8: neighbours in both directions lie close together.
fn place_in_blocks(at: vec2<u32>, blocks: u32) -> u32 {
    let block = at / BLOCK;
    let within = at % BLOCK;
    return (block.y * blocks + block.x) * (BLOCK * BLOCK) + within.y * BLOCK + within.x;
}
