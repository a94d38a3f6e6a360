// Position of a cell of a plain grid in the map of faint light. Each cell has SKY_CELL_ENTRIES entries, which `shaders/plain_blocks/mark.wgsl`
// writes; cells are numbered by their first points. The importer binds `grid_points`.

#import constants/plain_blocks

// Places of the corners in a picture of the map, texels from the centre of its first texel.
struct SkyCell {
    // Index of the first texel of the picture.
    first: u32,
    // Width of the picture, texels.
    width: u32,
    // The left and the right corner above, then those below.
    top: vec4<f32>,
    bottom: vec4<f32>,
}

// An index is held in two floats, because one is not exact.
const INDEX_BITS: u32 = 12u;

fn index_entry(first: u32, width: u32) -> vec4<f32> {
    return vec4(f32(first >> INDEX_BITS), f32(first & ((1u << INDEX_BITS) - 1u)), f32(width), 0.0);
}

// Returns the cell whose entries begin at `entry`.
fn sky_cell(entry: u32) -> SkyCell {
    let index = grid_points[entry];
    let first = (u32(index.x) << INDEX_BITS) | u32(index.y);
    return SkyCell(first, u32(index.z), grid_points[entry + 1u], grid_points[entry + 2u]);
}
