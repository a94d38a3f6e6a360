// Band of samples that impostors are splatted onto at once.

#import constants/impostors
#import structs/SplatBand

// Returns the index of a sample. Samples are stored in blocks of 8 x 8, so that neighbours in both directions are close in memory.
fn place_in_blocks(position: vec2<u32>, blocks: u32) -> u32 {
    let block = position / SPLAT_BLOCK;
    let within = position % SPLAT_BLOCK;
    return (block.y * blocks + block.x) * (SPLAT_BLOCK * SPLAT_BLOCK) + within.y * SPLAT_BLOCK + within.x;
}
